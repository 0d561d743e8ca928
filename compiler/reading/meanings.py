"""What the definitions of a scene came to when it was resolved, kept from one time to the next.

A definition's meaning depends on its text and on the names in it. Whoever keeps :class:`Meanings` forgets those of a source
(an editor's block) when a name that stands there means something else; all others are taken over, with the references that
they make. What has a message is worked out each time.

Example::

    meanings = Meanings()
    resolve(file, diagnostics, meanings=meanings)
    meanings.forget(block)
    resolve(other_file, diagnostics, meanings=meanings)      # resolves what is new and what was forgotten
"""

from __future__ import annotations

from typing import Any, Callable, Hashable, NamedTuple

from . import syntax
from .source import Source, Span


class Meaning(NamedTuple):
    """``value`` with the ``references`` (name, place) that lead to it. ``reached``: whether one Selection leads to another,
    (from, to, answer), where that decided."""

    value: Any
    references: tuple[tuple[str, Span], ...]
    reached: tuple[tuple[str, str, bool], ...]


class Record:
    """What is noted while a definition is resolved."""

    def __init__(self) -> None:
        self.references: list[tuple[str, Span]] = []
        self.reached: list[tuple[str, str, bool]] = []
        self.is_lasting = True


class Meanings:
    def __init__(self) -> None:
        self._of: dict[Source, dict[tuple, tuple[syntax.Node, Any]]] = {}
        self._seed: float | None = None
        self.edges: dict[str, set[str]] | None = None  # from Selection to Selection, where all that is kept holds

    def recall(self, node: syntax.Node, *given: Hashable) -> Any:
        """What was kept of ``node``, as far as the same was ``given``; None if nothing."""
        try:
            return self._of[node.span.source][id(node), *given][1]
        except KeyError:
            return None

    def keep(self, node: syntax.Node, value: Any, *given: Hashable) -> None:
        self._of.setdefault(node.span.source, {})[id(node), *given] = (node, value)  # the node, so that its id stays its own

    def once(self, node: syntax.Node, what: str, make: Callable[[], Any]) -> Any:
        """``make()``, which depends on nothing but ``node``; worked out once."""
        found = self.recall(node, what)
        if found is None:
            found = make()
            self.keep(node, found, what)
        return found

    def forget(self, source: Source) -> None:
        """Forget what stands in ``source``."""
        self._of.pop(source, None)

    def forget_all(self) -> None:
        self._of.clear()

    def use_seed(self, seed: float) -> None:
        """Constants may be made with the scene's seed."""
        if seed != self._seed:
            self.forget_all()
            self._seed = seed
