"""The inside of a Selection: entry action, guards and rules.

The grammar gives them flat, as they stand in the text; this module binds each ``else`` to the nearest ``if``
and puts right what it can of missing semicolons and arrows.

Example: ``if (n > 0) A -> x A; else A -> x;`` is guard, rule, guard, rule, and becomes
``If(n > 0, Rule(A, …), Rule(A, …))``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from . import syntax, vocabulary
from .mistakes import RULE
from .parse_terms import RightSides
from .parse_values import MAX_DEPTH, Reading, TooDeep, call, expression, is_stray, name
from .source import Span

if TYPE_CHECKING:
    from collections.abc import Callable

    from tree_sitter import Node


class _Piece(NamedTuple):
    """One thing in a Selection's body. ``kind`` is if (its test), else, rule, or entry (its Union)."""

    kind: str
    span: Span
    value: object


def selection_body(
    reading: Reading, nodes: list[Node], own_name: str, block: Callable[[Node, int], syntax.Block]
) -> tuple[syntax.Term | None, list[syntax.Production]]:
    """Entry action and productions among ``nodes``, children of a ``selection_body``. ``block`` reads a scene
    block inside a rule."""
    return _Body(reading, own_name, block).read(nodes)


class _Body(RightSides):
    def __init__(self, reading: Reading, own_name: str, block: Callable) -> None:
        super().__init__(reading, block)
        self.own_name = own_name

    def read(self, nodes: list[Node]) -> tuple[syntax.Term | None, list[syntax.Production]]:
        pieces = self.pieces(nodes)
        entry = None
        if pieces and pieces[0].kind == "entry":
            entry = self.entry_action(pieces[0].value)
            if entry is not None:
                pieces = pieces[1:]
        pieces = [self.rule_without_arrow(piece) if piece.kind == "entry" else piece for piece in pieces]
        pieces = [piece for piece in pieces if piece is not None]
        productions: list[syntax.Production] = []
        i = 0
        while i < len(pieces):
            production, i = self.production(pieces, i, 0)
            if production is not None:
                productions.append(production)
        return entry, productions

    # --- guards

    def pieces(self, nodes: list[Node], depth: int = 0) -> list[_Piece]:
        """The body's guards, rules and entries in a flat list."""
        if depth > MAX_DEPTH:
            raise TooDeep(self.reading.span(nodes[0]))
        found: list[_Piece] = []
        for node in nodes:
            if node.type == "guard":
                found += self.guard(node)
            elif node.type == "rule":
                found += self.rules(node)
            elif node.type == "entry":
                found += self.entries(node)
            elif node.type == "braced":
                found += self.braced(node, depth)
            elif is_stray(node):
                self.reading.complain(node, f"this '{self.reading.text(node)}' ends nothing", "remove it")
        return found

    def guard(self, node: Node) -> list[_Piece]:
        word, span = node.children[0].type, self.reading.span(node)
        if word == "else":
            return [_Piece("else", span, None)]
        pieces = []
        if word in ("elseif", "elif"):
            self.reading.complain(node.children[0], f"'{word}' is written as two words", "write else if")
            pieces.append(_Piece("else", span, None))
        condition = node.child_by_field_name("condition")
        if condition is not None and condition.type != "parenthesized" and not condition.has_error:
            text = self.reading.text(condition)
            short = text if len(text) <= 30 and "\n" not in text else "…"
            self.reading.complain(condition, "a condition stands in brackets", f"write if ({short})")
        test = expression(self.reading, condition)
        if test is None:
            test = syntax.Number(span, 1.0, "1")
        return [*pieces, _Piece("if", span, test)]

    def braced(self, node: Node, depth: int) -> list[_Piece]:
        opener = node.children[0]
        self.reading.complain(
            opener,
            "braces don't surround rules",
            "remove them: after if (…) and else stands exactly one rule",
        )
        return self.pieces(node.children, depth + 1)

    def production(self, pieces: list[_Piece], i: int, depth: int) -> tuple[syntax.Production | None, int]:
        """The production that starts at ``pieces[i]``, and where the next one starts."""
        piece = pieces[i]
        if depth > MAX_DEPTH:
            raise TooDeep(piece.span)
        if piece.kind == "rule":
            return piece.value, i + 1
        if piece.kind == "else":
            self.reading.complain(
                piece.span, "this 'else' belongs to no 'if'", "an else follows the rule of an if"
            )
            return None, i + 1
        links = []  # of `if … else if … else if …`, which is no nesting: as long as one likes
        otherwise = None
        while True:
            then, i = self.guarded(pieces, i + 1, piece, depth)
            links.append((piece, then))
            if i == len(pieces) or pieces[i].kind != "else":
                break
            if i + 1 == len(pieces) or pieces[i + 1].kind != "if":
                otherwise, i = self.guarded(pieces, i + 1, pieces[i], depth)
                break
            i += 1
            piece = pieces[i]
        for piece, then in reversed(links):
            if then is not None:
                span = self.reading.between(piece.span.start, (otherwise or then).span.end)
                otherwise = syntax.If(span, piece.value, then, otherwise)
        return otherwise, i

    def guarded(
        self, pieces: list[_Piece], i: int, guard: _Piece, depth: int
    ) -> tuple[syntax.Production | None, int]:
        """The production after a guard; complains when there is none."""
        if i < len(pieces) and pieces[i].kind != "else":
            return self.production(pieces, i, depth + 1)
        self.reading.complain(
            self.reading.after(guard.span.end),
            f"a rule is missing after this '{guard.kind}'",
            RULE,
            "missing",
        )
        while guard.kind == "else" and i < len(pieces) and pieces[i].kind == "else":
            i += 1
        return None, i

    # --- rules

    def entries(self, node: Node) -> list[_Piece]:
        """An entry action, or a rule without an arrow; with rules that follow it when its ';' is missing."""
        union = self.union(node.children[0], 0)
        late = [child for child in node.children if child.type == "late_rule"]
        if not late:
            self.reading.need_semicolon(node, "this line")
        union, pieces = self.late_rules(union, late, node, "this line")
        return [_Piece("entry", self.reading.span(node), union), *pieces] if union else pieces

    def rules(self, node: Node) -> list[_Piece]:
        target_node = node.child_by_field_name("target")
        target = self.target(target_node)
        late = [child for child in node.children if child.type == "late_rule"]
        if not late:
            self.reading.need_semicolon(node, "this rule")
        self.arrow(node)
        alternatives = self.alternatives(node, late)
        span = self.reading.span(node)
        if late:
            span = Span(self.reading.source, node.start_byte, late[0].start_byte)
        alternatives, pieces = self.split_late(alternatives, late, node, "this rule")
        return [_Piece("rule", span, syntax.Rule(span, target, alternatives)), *pieces]

    def target(self, node: Node) -> syntax.Name | syntax.Call:
        return call(self.reading, node) if node.type == "call" else name(self.reading, node)

    def arrow(self, node: Node) -> None:
        arrow = node.child_by_field_name("arrow")
        if arrow is not None and not arrow.is_missing and self.reading.text(arrow) != "->":
            self.reading.complain(
                arrow, f"'{self.reading.text(arrow)}' stands where a rule has '->'", "write ->"
            )

    def split_late(
        self, alternatives: tuple[syntax.Alternative, ...], late: list[Node], node: Node, what: str
    ) -> tuple[tuple[syntax.Alternative, ...], list[_Piece]]:
        if not late:
            return alternatives, []
        last = alternatives[-1]
        body, pieces = self.late_rules(last.body, late, node, what)
        return (*alternatives[:-1], replace(last, body=body)), pieces

    def late_rules(
        self, union: syntax.Union | None, late: list[Node], node: Node, what: str
    ) -> tuple[syntax.Union | None, list[_Piece]]:
        """``A -> x B -> y;`` lacks a ';': B, read as an operand of A's rule, is the next rule's name.

        Returns ``union`` without that name, and the rules that start with it."""
        pieces: list[_Piece] = []
        for i, rule in enumerate(late):
            target, union_left, end = self.take_last(union)
            if target is None:
                arrow = rule.children[0]
                if not any(d.span.start == arrow.start_byte for d in self.reading.diagnostics.items):
                    self.reading.complain(
                        arrow, "nothing stands before this arrow that a rule could be for", RULE
                    )
                return union, pieces
            if i == 0:
                first = union_left
                self.complain_before(rule, target, end, node, what)
            else:
                pieces[-1] = self.with_last_body(pieces[-1], union_left)
                self.complain_before(rule, target, end, late[i - 1], "this rule")
            self.arrow(rule)
            alternatives = self.alternatives(rule, late[i + 1 :])
            span = target.span.to(self.reading.span(rule))
            pieces.append(_Piece("rule", span, syntax.Rule(span, target, alternatives)))
            union = alternatives[-1].body
        if late:
            if node.children[-1].type != ";":
                self.reading.missing_semicolon(node.end_byte, "this rule")
            union = first
        return union, pieces

    def complain_before(
        self, rule: Node, target: syntax.Node, end: int | None, before: Node, what: str
    ) -> None:
        if (
            end is None
        ):  # nothing stands before the name but an arrow: an empty rule without ';', or two arrows
            arrow = before.child_by_field_name("arrow")
            end = arrow.end_byte if arrow is not None else before.start_byte
        if end > target.span.start or (before.type == "entry" and end == before.start_byte):
            return
        self.reading.missing_semicolon(end, what)

    @staticmethod
    def with_last_body(piece: _Piece, body: syntax.Union | None) -> _Piece:
        rule = piece.value
        last = replace(rule.alternatives[-1], body=body)
        return piece._replace(value=replace(rule, alternatives=(*rule.alternatives[:-1], last)))

    @staticmethod
    def take_last(
        union: syntax.Union | None,
    ) -> tuple[syntax.Name | syntax.Call | None, syntax.Union | None, int | None]:
        """The last item of ``union`` if it can be a rule's name, the union without it, and its end."""
        if union is None:
            return None, None, None
        *terms, term = union.terms
        *items, item = term.items
        if not isinstance(item, syntax.Name | syntax.Call):
            return None, union, None
        if items:
            terms.append(replace(term, items=tuple(items), span=items[0].span.to(items[-1].span)))
        if not terms:
            return item, None, None
        left = replace(union, terms=tuple(terms), span=terms[0].span.to(terms[-1].span))
        return item, left, left.span.end

    # --- entries

    def is_own(self, item: object) -> bool:
        """Whether an item of a term is the Selection's own name."""
        return isinstance(item, syntax.Name) and item.name == self.own_name

    def entry_action(self, union: syntax.Union) -> syntax.Term | None:
        """The entry action, if ``union`` looks like one: ``C_initialize Tree``."""
        items = union.terms[0].items
        first, last = items[0], items[-1]
        if len(union.terms) > 1 or self.is_own(first):
            return None
        if isinstance(last, syntax.Name) and last.name == self.own_name:
            return union.terms[0]
        if isinstance(last, syntax.Name) and last.name in vocabulary.PRIMITIVES:
            return None  # a rule without its name
        if len(items) <= 2 and all(isinstance(item, syntax.Name | syntax.Inline) for item in items):
            written = " ".join(item.name for item in items[:1] if isinstance(item, syntax.Name)) or "[…]"
            self.reading.complain(
                union.span,
                f"an entry action ends with its Selection's name, {self.own_name}",
                f"write {written} {self.own_name};",
            )
            return syntax.Term(union.span, (*items[:1], syntax.Name(last.span, self.own_name)))
        return None

    def rule_without_arrow(self, piece: _Piece) -> _Piece | None:
        """What the text means by a line that is no rule and no entry action in the first place."""
        union = piece.value
        items = union.terms[0].items
        first, last = items[0], items[-1]
        is_entry = (
            len(union.terms) == 1
            and len(items) > 1
            and isinstance(last, syntax.Name)
            and last.name == self.own_name
        )
        if is_entry and not self.is_own(first):
            self.reading.complain(
                union.span,
                "an entry action is the first line of its Selection",
                "join several into one: C_a C_b Name;",
            )
            return None
        if isinstance(last, syntax.Name) and last.name in vocabulary.PRIMITIVES and not self.is_own(first):
            start = self.reading.after(union.span.start)
            message = "the name of its Selection stands before what a rule produces"
            mend = f"{self.own_name} -> "
            self.reading.complain(start, message, f"write {mend}…;", "missing", mend=mend)
            rule = syntax.Rule(
                piece.span, syntax.Name(start, self.own_name), (syntax.Alternative(union.span, None, union),)
            )
            return piece._replace(kind="rule", value=rule)
        if not isinstance(first, syntax.Name | syntax.Call):
            self.reading.complain(union.span, "this is no rule", RULE)
            return None
        self.reading.complain(
            self.reading.after(first.span.end), "missing '->' after the rule's name", RULE, "missing"
        )
        rest = items[1:]
        terms = union.terms[1:]
        if rest:
            terms = (syntax.Term(rest[0].span.to(last.span), rest), *terms)
        body = syntax.Union(terms[0].span.to(terms[-1].span), terms) if terms else None
        alternative = syntax.Alternative(body.span if body else first.span, None, body)
        return piece._replace(kind="rule", value=syntax.Rule(piece.span, first, (alternative,)))
