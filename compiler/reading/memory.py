"""What was found out about the nodes of a model, kept from one check of a scene to the next.

Questions are functions of nodes that never change (model.py) and of some more values, and their answers depend on nothing
else. So an answer holds as long as the nodes are the same objects, and after an edit only what it touched is worked out
again; a value that comes out as it was before touches nothing further.

Example::

    memory = Memory()
    memory.ask(guards_of, symbol)               # guards_of(symbol)
    memory.ask(guards_of, symbol)               # known
    memory.ask(decided, symbol, given=(0.0,))   # decided(symbol, 0.0)
    memory.end_round()                          # now and then what isn't asked any more is forgotten
"""

from __future__ import annotations

from typing import Any, Callable, Hashable, Sequence


class Memory:
    def __init__(self) -> None:
        self._known: dict[tuple, tuple[tuple, Any]] = {}
        self._asked: dict[tuple, tuple[tuple, Any]] | None = {}  # in this round; None in most rounds
        self._last: dict[Callable[..., Any], tuple[Any, Any]] = {}
        self._each: dict[Callable[..., Any], tuple[list, list, list]] = {}
        self._most = 0  # answers, before it is noted again which are asked for

    def ask(self, question: Callable[..., Any], *nodes: object, given: tuple[Hashable, ...] = ()) -> Any:
        """``question(*nodes, *given)``, worked out once; nodes are told apart by identity, what is given by value. The answer
        is shared: it must not be changed."""
        key = (question, given, *map(id, nodes))
        found = self._known.get(key)
        if found is None:
            return self._keep(key, nodes, question(*nodes, *given))
        if self._asked is not None:
            self._asked[key] = found
        return found[1]

    def ask_in_turn(self, question: Callable[..., Any], *nodes: object, given: tuple[Hashable, ...] = ()) -> Any:
        """As ``ask``, of a question that asks others: ``question(ask, *nodes, *given)``."""
        key = (question, given, *map(id, nodes))
        found = self._known.get(key)
        if found is None:
            return self._keep(key, nodes, question(self.ask, *nodes, *given))
        if self._asked is not None:
            self._asked[key] = found
        return found[1]

    def ask_each(
        self, question: Callable[..., Any], nodes: list[Any], given: Sequence[tuple], in_turn: bool = False
    ) -> list[Any]:
        """The answers of ``ask`` (or ``ask_in_turn``) for each of many ``nodes`` with what is ``given`` for it. After an edit
        nearly all are those of the last time, in the same places: these aren't even looked up."""
        ask = self.ask_in_turn if in_turn else self.ask
        before, known, answers = self._each.get(question, ((), (), []))
        if len(before) != len(nodes) or self._asked is not None:
            answers = [ask(question, node, given=each) for node, each in zip(nodes, given)]
        else:
            answers = answers.copy()
            pairs = enumerate(zip(nodes, before, given, known))
            for i in [i for i, (node, old, each, other) in pairs if node is not old or each != other]:
                answers[i] = ask(question, nodes[i], given=given[i])
        self._each[question] = nodes, list(given), answers
        return answers

    def ask_again(self, question: Callable[..., Any], *values: Any) -> Any:
        """``question(*values)``, worked out where the values aren't equal to those of the last time: for what goes through a
        whole scene, of which an edit hardly ever changes more than places. Neither values nor answer may be changed."""
        last = self._last.get(question)
        if last is None or last[0] != values:
            last = self._last[question] = values, question(*values)
        return last[1]

    def _keep(self, key: tuple, nodes: tuple, answer: Any) -> Any:
        self._known[key] = nodes, answer  # the nodes, so that their ids stay their own
        if self._asked is not None:
            self._asked[key] = nodes, answer
        return answer

    def end_round(self) -> None:
        """When there are twice as many answers as a round needs, note in the next one which it asks for, and forget the others
        at its end: they are about nodes that are gone."""
        if self._asked is not None:
            self._known, self._asked = self._asked, None
            self._most = 2 * len(self._known)
        elif len(self._known) > self._most:
            self._asked = {}
