"""Plain values: classes with named fields that nobody changes once they are made.

``@record`` is ``@dataclass(frozen=True, slots=True)`` to whoever reads or checks the code. It doesn't watch over that while
the program runs: an object is then made in 40 % of the time, and a scene is read by making some ten thousand of them. The
methods that compare and print are closures, not code written and compiled for each class: that would be a twentieth of
drawing a small scene.

Example::

    @record
    class Number:
        value: float

``lazy_property`` is functools' ``cached_property`` without a lock, which Python 3.11 still has and which costs more than most of
what is kept so here.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from operator import attrgetter
from typing import Any, Callable, Generic, TypeVar, dataclass_transform

T = TypeVar("T")


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def record(cls: type | None = None, *, eq: bool = True, frozen: bool = True) -> Any:
    """Without ``eq``, objects are equal only to themselves. What isn't ``frozen`` may change, and has no hash if it has an ``eq``."""
    if cls is None:
        return lambda cls: record(cls, eq=eq, frozen=frozen)
    cls.__doc__ = cls.__doc__ or cls.__name__  # for those without, dataclass() reads signatures half as long as all else takes
    return _finished(dataclass(slots=True, eq=False, repr=False)(cls), eq, frozen)


def _finished(cls: Any, eq: bool, frozen: bool) -> type:
    names = [each.name for each in fields(cls) if each.repr]

    def show(self: Any) -> str:
        return f"{cls.__qualname__}({', '.join(f'{name}={getattr(self, name)!r}' for name in names)})"

    cls.__repr__ = show
    if compared := [each.name for each in fields(cls) if each.compare and eq]:
        values = attrgetter(*compared)
        cls.__eq__ = lambda self, other: (
            values(self) == values(other) if other.__class__ is self.__class__ else NotImplemented
        )
        cls.__hash__ = (lambda self: hash(values(self))) if frozen else None
    return cls


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
