"""What was found out about the nodes of a model, kept from one check of a scene to the next.

Questions are functions of nodes that never change (model.py) and of some more values, and their answers depend on nothing
else. So an answer holds as long as the nodes are the same objects, and after an edit only what it touched is worked out
again; a value that comes out as it was before touches nothing further.

Example::

    memory = Memory()
    memory.ask(guards_of, symbol)               # guards_of(symbol)
    memory.ask(guards_of, symbol)               # known
    memory.ask(decided, symbol, given=(0.0,))   # decided(symbol, 0.0)
    memory.end_round()                          # what wasn't asked since the last time is forgotten
"""

from __future__ import annotations

from typing import Any, Callable, Hashable


class Memory:
    def __init__(self) -> None:
        self._known: dict[tuple, tuple[tuple, Any]] = {}
        self._asked: dict[tuple, tuple[tuple, Any]] = {}

    def ask(self, question: Callable[..., Any], *nodes: object, given: tuple[Hashable, ...] = ()) -> Any:
        """``question(*nodes, *given)``, worked out once; nodes are told apart by identity, what is given by value. The answer
        is shared: it must not be changed."""
        found = self._recall((question, given, *map(id, nodes)))
        return found[1] if found is not None else self._keep(question, given, nodes, question(*nodes, *given))

    def ask_in_turn(self, question: Callable[..., Any], *nodes: object, given: tuple[Hashable, ...] = ()) -> Any:
        """As ``ask``, of a question that asks others: ``question(ask, *nodes, *given)``."""
        found = self._recall((question, given, *map(id, nodes)))
        return found[1] if found is not None else self._keep(question, given, nodes, question(self.ask, *nodes, *given))

    def _recall(self, key: tuple) -> tuple[tuple, Any] | None:
        found = self._asked.get(key)
        if found is None:
            found = self._known.get(key)
            if found is not None:
                self._asked[key] = found
        return found

    def _keep(self, question: Callable[..., Any], given: tuple, nodes: tuple, answer: Any) -> Any:
        key = (question, given, *map(id, nodes))
        self._known[key] = self._asked[key] = nodes, answer  # the nodes, so that their ids stay their own
        return answer

    def end_round(self) -> None:
        """Forget what wasn't asked since the last call: it is about nodes that are gone."""
        self._known, self._asked = self._asked, {}
