"""Plain values: classes with named fields that nobody changes once they are made.

``@record`` is ``@dataclass(frozen=True, slots=True)`` to whoever reads or checks the code. It doesn't watch over that while
the program runs: an object is then made in 40 % of the time, and a scene is read by making some ten thousand of them.

Example::

    @record
    class Number:
        value: float
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Callable, dataclass_transform


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def record(cls: type | None = None, *, eq: bool = True) -> Any:
    """Without ``eq``, objects are equal only to themselves."""
    make: Callable[[type], type] = dataclass(slots=True, eq=eq, unsafe_hash=eq)
    return make if cls is None else make(cls)
