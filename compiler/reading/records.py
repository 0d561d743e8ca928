"""Plain values: classes with named fields that nobody changes once they are made.

``@record`` is ``@dataclass(frozen=True, slots=True)`` to whoever reads or checks the code. It doesn't watch over that while
the program runs: an object is then made in 40 % of the time, and a scene is read by making some ten thousand of them.

Example::

    @record
    class Number:
        value: float

``lazy_property`` is functools' ``cached_property`` without a lock, which Python 3.11 still has and which costs more than most of
what is kept so here.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Callable, Generic, TypeVar, dataclass_transform

T = TypeVar("T")


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def record(cls: type | None = None, *, eq: bool = True) -> Any:
    """Without ``eq``, objects are equal only to themselves."""
    make: Callable[[type], type] = dataclass(slots=True, eq=eq, unsafe_hash=eq)
    return make if cls is None else make(cls)


class lazy_property(Generic[T]):
    """A value worked out when first asked for, then an attribute like others."""

    def __init__(self, read: Callable[[Any], T]) -> None:
        self._read, self.__doc__ = read, read.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, instance: Any, owner: type | None = None) -> T:
        if instance is None:
            return self  # type: ignore[return-value]
        value = instance.__dict__[self._name] = self._read(instance)
        return value
