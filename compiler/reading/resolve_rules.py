"""Selections: rules → productions.

Example: ``if (n > 1) A -> box; A -> 3: disc | 1: ;`` is
``Branch(n > 1, Produce(0, box), Choose((3, Produce(1, disc)), (1, Produce(2, Empty))))``.
"""

from __future__ import annotations

from . import syntax
from .diagnostics import Note
from .evaluate import NotFinite, fold
from .model import (
    Apply,
    Branch,
    Choose,
    Constant,
    Empty,
    Expression,
    Operand,
    Produce,
    Production,
    Read,
    Symbol,
)
from .resolve_expressions import RULES, Expressions
from .resolve_names import Names
from .resolve_terms import Terms

# Far above what people write; a chain of nested ifs without else doubles with each.
MAX_CASES = 10_000


class Rules:
    def __init__(self, names: Names, expressions: Expressions, terms: Terms) -> None:
        self.names, self.expressions, self.terms = names, expressions, terms
        self.begin()

    def begin(self) -> None:
        """Start with the rules of another scene."""
        self.rules = 0
        self._firsts: dict[str, int] = {}  # the numbers of the Selections' first rules
        self._counted: dict[int, tuple[int, Production]] = {}

    # --- Selections

    def selection(self, node: syntax.Selection) -> Symbol:
        """The symbol that ``node`` defines. Problems are reported, and what has one becomes Empty."""
        first = self._firsts[node.name.name] = self.rules
        firsts = [self._numbered(production) for production in node.productions]
        return self.names.known(node, lambda: self._selection(node, firsts), first)

    def renewed(self, node: syntax.Selection) -> Symbol:
        """As ``selection``, of one that has as many rules as the Selection of this name had."""
        self.rules = self._firsts[node.name.name]
        self._counted.clear()
        return self.selection(node)

    def _selection(self, node: syntax.Selection, firsts: list[int]) -> Symbol:
        rest: Production = Empty(node.span)
        last = len(node.productions) - 1
        for i in range(last, -1, -1):
            production = node.productions[i]
            if i < last and _always_applies(production):
                after = node.productions[i + 1]
                note = Note(production.span, "this rule always applies")
                message = "this rule can't be reached: the one before it always applies"
                self.names.diagnostics.add(
                    "unreachable-rule", after.span, message, "give the first an `if`", (note,)
                )
            rest = self._production(production, node, rest, firsts[i])
            if self._cases(rest) > MAX_CASES:
                message = f"the rules of '{node.name.name}' make more than {MAX_CASES:,} cases"
                hint = "an inner if without an else goes on with all that follows: give it an else"
                self.names.diagnostics.add("limit", node.name.span, message, hint)
                rest = Empty(node.span)
                break
        return Symbol(node.name.name, rest, node.span, node.name.span)

    def _cases(self, production: Production) -> int:
        """How many leaves the tree of guards has, its shared parts counted wherever they stand."""
        if not isinstance(production, Branch):
            return 1
        if id(production) not in self._counted:
            count = self._cases(production.then) + self._cases(production.otherwise)
            self._counted[id(production)] = (count, production)  # kept, so that its id stays its own
        return self._counted[id(production)][0]

    def _numbered(self, production: syntax.Production) -> int:
        """The number of the first of the production's rules; the others follow in text order."""
        first = self.rules
        self.rules += rule_count(production)
        return first

    def _production(
        self, node: syntax.Production, owner: syntax.Selection, rest: Production, number: int
    ) -> Production:
        """``rest`` is what applies when no guard of ``node`` does; ``number`` is its first rule's."""
        if isinstance(node, syntax.Rule):
            return self._rule(node, owner, number)
        test = self._test(node.test)
        then = self._production(node.then, owner, rest, number)
        otherwise = rest
        if node.otherwise is not None:
            otherwise = self._production(node.otherwise, owner, rest, number + rule_count(node.then))
        return Branch(test, then, otherwise, node.span)

    def _test(self, node: syntax.Expression) -> Expression:
        return self.names.reporting(lambda: self.expressions.number(node, RULES), Constant(1.0, node.span))

    def _rule(self, node: syntax.Rule, owner: syntax.Selection, number: int) -> Production:
        self._check_target(node, owner)
        produced = []
        for i, alternative in enumerate(node.alternatives):
            body: Operand = Empty(alternative.span)
            if alternative.body is not None:
                body = self.terms.union(alternative.body, owner.name.name)
            produced.append(Produce(number + i, body, alternative.span))
        weights = [alternative.weight for alternative in node.alternatives]
        if weights == [None]:
            return produced[0]
        if None in weights:
            at = node.alternatives[weights.index(None)].span
            self.names.diagnostics.add(
                "wrong-arguments", at, "this alternative has no weight", "write 1: before it"
            )
            return produced[0]
        numbers = [self._weight(weight) for weight in weights if weight is not None]
        if all(isinstance(number, Constant) and number.value == 0 for number in numbers):
            self.names.diagnostics.add(
                "weights", node.span, "all weights of this rule are 0", "give one a weight above 0"
            )
            return produced[0]
        return Choose(tuple(zip(numbers, produced)), node.span)

    def _weight(self, node: syntax.Expression):
        weight = self.names.reporting(lambda: self.expressions.number(node, RULES), Constant(1.0, node.span))
        try:
            folded = fold(weight) if _closed(weight) else weight
        except NotFinite:
            return weight  # the check reports it
        if isinstance(folded, Constant) and folded.value < 0:
            self.names.diagnostics.add(
                "weights", node.span, f"a weight can't be negative, this is {folded.value:g}"
            )
            return Constant(1.0, node.span)
        return folded

    def _check_target(self, node: syntax.Rule, owner: syntax.Selection) -> None:
        target = node.target.name if isinstance(node.target, syntax.Call) else node.target
        if target.name and target.name != owner.name.name:
            message = f"this rule is of '{target.name}' but stands in the Selection '{owner.name.name}'"
            hint = f"write {owner.name.name} -> …, or move it"
            self.names.diagnostics.add("wrong-kind", target.span, message, hint)
            return
        if isinstance(node.target, syntax.Call):
            given = [each.name for each in node.target.arguments if isinstance(each, syntax.Name)]
            wanted = [each.name for each in owner.parameters]
            if given != wanted or len(given) != len(node.target.arguments):
                hint = f"write {owner.name.name} -> … ; the parameters stand in the Selection's head"
                self.names.diagnostics.add(
                    "wrong-arguments", node.target.span, "a rule's left side takes no arguments", hint
                )


def _always_applies(production: syntax.Production | None) -> bool:
    if isinstance(production, syntax.If):
        return _always_applies(production.then) and _always_applies(production.otherwise)
    return production is not None


def rule_count(production: syntax.Production | None) -> int:
    """How many right-hand sides a production has, in all its branches."""
    if isinstance(production, syntax.If):
        return rule_count(production.then) + rule_count(production.otherwise)
    return len(production.alternatives) if production is not None else 0


def _closed(expression) -> bool:
    if isinstance(expression, Apply):
        return expression.operation not in ("rand", "hash") and all(map(_closed, expression.arguments))
    return not isinstance(expression, Read)
