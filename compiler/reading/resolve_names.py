"""The names of a scene: every definition of all its files in one namespace.

syntax.File → :class:`Names`: includes followed, names that clash reported, parameters (the names that something
assigns) found. What a name's value is, the other resolve modules work out.

Example::

    names = Names(diagnostics, Source.read)
    names.gather(file)
    names.find(name, ("calculation", "transformation"), "an operator").kind
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Callable, Hashable, Iterable, Iterator, Sequence, TypeVar

from . import syntax, vocabulary
from .diagnostics import Diagnostics, Note, nearest
from .meanings import Meaning, Meanings, Record
from .model import Definition
from .problems import Problem, synonym, truth, unsupported
from .source import Source, Span

T = TypeVar("T")

ARTICLES = {
    "selection": "a Selection",
    "calculation": "a Calculation",
    "transformation": "a Transformation",
    "texture": "a texture",
    "pigment": "a pigment",
    "finish": "a finish",
    "color_map": "a color_map",
    "object": "a declared object",
    "value": "a constant",
    "input": "a Parameter (an input of the scene)",
    "parameter": "a parameter that a Calculation assigns",
    "keyword": "a reserved word",
    "modifier": "a modifier",
    "block": "a scene block",
    "operation": "an operation",
    "constant": "a constant",
    "function": "a function",
    "primitive": "a primitive",
    "colour": "a colour",
}


@dataclass
class Entry:
    """A name of the namespace. ``node`` is its definition's syntax tree; ``value`` is what a resolve module has
    made of it, while ``busy`` says that it is being made (so that a cycle is found)."""

    definition: Definition
    node: object
    value: object = None
    busy: bool = False
    failed: bool = False

    @property
    def kind(self) -> str:
        return self.definition.kind

    def once(self, make: Callable[[], object], span: Span, through_itself: str):
        """``value``, made when first asked for. Raises Problem: of its own where it is asked for while it is made, and
        one reported already where that failed before."""
        if self.busy:
            raise Problem("wrong-value", span, through_itself)
        if self.failed:
            raise Problem
        if self.value is None:
            self.busy = True
            try:
                self.value = make()
            except Problem:
                self.failed = True
                raise
            finally:
                self.busy = False
        return self.value


@dataclass
class Names:
    """The namespace. ``blocks`` are the scene blocks of all files in order, ``files`` the files read. ``meanings`` are those
    of definitions that were resolved before; to take one over, it is asked whether a Selection still ``leads_to`` another,
    unless the scene ``has_same_edges`` as before."""

    diagnostics: Diagnostics
    loader: Callable[[Path], Source]
    entries: dict[str, Entry] = field(default_factory=dict)
    blocks: list[syntax.Block] = field(default_factory=list)
    files: list[Path] = field(default_factory=list)
    meanings: Meanings | None = None
    leads_to: Callable[[str, str], bool] = field(default=lambda name, other: False)
    has_same_edges: Callable[[], bool] = field(default=lambda: False)
    record: Record = field(default_factory=Record)
    _open: list[tuple[Path, Span]] = field(default_factory=list)

    # --- gathering

    def gather(self, file: syntax.File) -> None:
        """Add all definitions of ``file`` and of what it includes; assigned names come last, so that a
        definition of the same name is what the message calls the first."""
        definitions = list(self._expand(file))
        for node in definitions:
            if isinstance(node, syntax.Block):
                self.blocks.append(node)
            else:
                self._define(node)
        for node in definitions:
            if isinstance(node, syntax.Selection) and self.meanings is not None:
                names: Iterable[syntax.Name] = self.meanings.once(node, "assigned", lambda: tuple(assigned_names(node)))
            else:
                names = assigned_names(node) if isinstance(node, syntax.Calculation | syntax.Selection) else ()
            for name in names:
                self._assign(name)

    def _expand(self, file: syntax.File) -> Iterator[syntax.Definition]:
        path = file.span.source.path
        if path is not None:
            self.files.append(path)
        self._open.append((_identity(path), file.span))
        for node in file.definitions:
            if isinstance(node, syntax.Include):
                included = self._include(node)
                if included is not None:
                    yield from self._expand(included)
            else:
                yield node
        self._open.pop()

    def _include(self, node: syntax.Include) -> syntax.File | None:
        """The file that ``node`` names, parsed; None when it has been read already or can't be."""
        from .parse import parse

        written, span = node.path.value, node.path.span
        path = self.path_of(node, [other for other, _ in self._open])
        if path is None:
            return None
        if any(_identity(path) == _identity(other) for other in self.files):
            return None
        try:
            source = self.loader(path)
        except OSError as error:
            reason = error.strerror or str(error)
            message = f"can't read '{written}': {reason}"
            self.diagnostics.add(
                "include", span, message, f"looked for {path}, relative to the file that includes it"
            )
            return None
        file, found = parse(source)
        self.diagnostics.items += found.items
        return file

    def path_of(self, node: syntax.Include, chain: Sequence[Path]) -> Path | None:
        """The file that ``node`` includes; None, with a message, for one that can't be. ``chain`` are the files
        that lead here, resolved, the scene's first."""
        written, span = node.path.value, node.path.span
        if written.lower().endswith(".inc"):
            stem = Path(written).stem.lower()
            stock = vocabulary.STOCK_INCLUDES
            known = stem in stock["names"]
            message = f"'{written}' is {'one of POV-Ray' + chr(39) + 's stock files' if known else 'a POV-Ray file'}, which plsys doesn't read"
            self.diagnostics.add(
                "include", span, message, str(stock["colors" if stem == "colors" else "default"])
            )
            return None
        base = span.source.path
        path = (base.parent if base is not None else Path()) / written
        if _identity(path) in chain:
            names = " → ".join([*(other.name for other in chain), path.name])
            self.diagnostics.add("include", span, f"'{written}' includes itself", f"the chain is {names}")
            return None
        return path

    def _define(self, node: syntax.Definition) -> None:
        name: syntax.Name = node.name
        if not name.name:
            return
        if taken := vocabulary.kind_of(name.name):
            hint = "choose another name; the vocabulary's can't be given new meanings"
            self.diagnostics.add(
                "duplicate-name", name.span, f"'{name.name}' is {ARTICLES[taken]} of plsys", hint
            )
            return
        if (first := self.entries.get(name.name)) is not None:
            note = Note(first.definition.span, f"'{name.name}' is first defined here")
            hint = "names of all kinds share one namespace"
            self.diagnostics.add(
                "duplicate-name", name.span, f"'{name.name}' is defined twice", hint, (note,)
            )
            return
        self.entries[name.name] = Entry(Definition(name.name, kind_of_definition(node), name.span), node)

    def _assign(self, name: syntax.Name) -> None:
        if not name.name:
            return
        entry = self.entries.get(name.name)
        if entry is not None and entry.kind == "parameter":
            entry.definition.assignments.append(name.span)
            return
        taken = vocabulary.kind_of(name.name)
        if taken or entry is not None:
            what = f"{ARTICLES[taken]} of plsys" if taken else ARTICLES[entry.kind]
            notes = () if taken else (Note(entry.definition.span, f"'{name.name}' is defined here"),)
            message = f"'{name.name}' is {what} and can't be assigned"
            hint = "choose another name for the parameter"
            if entry is not None and entry.kind in ("value", "input"):
                hint = f"to count with it, assign it to a parameter first: k = {name.name}"
            self.diagnostics.add("wrong-kind", name.span, message, hint, notes)
            return
        definition = Definition(name.name, "parameter", name.span, assignments=[name.span])
        self.entries[name.name] = Entry(definition, name)

    def reporting(self, read: Callable[[], T], fallback: T) -> T:
        """What ``read`` gives; where it raises a Problem, that is reported and ``fallback`` stands in."""
        try:
            return read()
        except Problem as problem:
            problem.report(self.diagnostics)
            return fallback

    # --- what was resolved before

    def known(self, node: syntax.Node, make: Callable[[], T], *given: Hashable) -> T:
        """What ``make`` makes of ``node`` and what is ``given``, or what it made before if that still holds."""
        if self.meanings is None:
            return make()
        meaning = self.meanings.recall(node, *given)
        if meaning is not None and (not meaning.reached or self._still_holds(meaning)):
            for name, span in meaning.references:
                self.entries[name].definition.references.append(span)
            return meaning.value
        outer, self.record, before = self.record, Record(), len(self.diagnostics.items)
        try:
            value = make()
        finally:
            record, self.record = self.record, outer
            outer.is_lasting &= record.is_lasting
        if record.is_lasting and len(self.diagnostics.items) == before:
            self.meanings.keep(node, Meaning(value, tuple(record.references), tuple(record.reached)), *given)
        return value

    def _still_holds(self, meaning: Meaning) -> bool:
        return self.has_same_edges() or all(
            self.leads_to(name, other) is answer for name, other, answer in meaning.reached
        )

    def refer(self, entry: Entry, span: Span) -> None:
        """Note that ``entry`` is used at ``span``."""
        entry.definition.references.append(span)
        self.record.references.append((entry.definition.name, span))

    # --- looking up

    def find(self, name: syntax.Name, kinds: tuple[str, ...], wanted: str) -> Entry:
        """The entry of ``name``, which must be of one of ``kinds``; ``wanted`` says that in words. Records the
        reference. Raises Problem."""
        if not name.name:
            raise Problem
        entry = self.entries.get(name.name)
        if entry is None:
            raise self.unknown(name, kinds, wanted)
        self.refer(entry, name.span)
        if entry.kind not in kinds:
            note = Note(entry.definition.span, f"'{name.name}' is defined here")
            message = f"'{name.name}' is {ARTICLES[entry.kind]}, not {wanted}"
            raise Problem("wrong-kind", name.span, message, self.nearest(name.name, kinds), (note,))
        return entry

    def unknown(self, name: syntax.Name, kinds: tuple[str, ...], wanted: str, hint: str = "") -> Problem:
        """What to say of a name that no definition of the scene has; ``hint`` where one is known."""
        if taken := vocabulary.kind_of(name.name):
            message = f"'{name.name}' is {ARTICLES[taken]}, not {wanted}"
            hint = (
                "perhaps a ';' is missing before it"
                if taken == "operation"
                else self.nearest(name.name, kinds)
            )
            return Problem("wrong-kind", name.span, message, hint)
        if name.name in vocabulary.UNSUPPORTED:
            return unsupported(name)
        if (found := truth(name, wanted)) is not None and "constant" in kinds:
            return found
        hint = hint or synonym(name.name, kinds) or self.nearest(name.name, kinds) or self.nearest(name.name, None)
        return Problem(
            "unknown-name", name.span, f"unknown name '{name.name}': {wanted} is needed here", hint
        )

    def nearest(self, name: str, kinds: tuple[str, ...] | None) -> str:
        """A hint that names what of ``kinds`` is most like ``name``; of the scene's names of any kind for None."""
        if kinds is None:
            return nearest(name, self.entries)
        names = {other for other, entry in self.entries.items() if entry.kind in kinds and other != name}
        return nearest(name, names.union(*(vocabulary_names(kind) for kind in kinds)) - {name})


def vocabulary_names(kind: str) -> Iterable[str]:
    """The vocabulary's names of a kind that :class:`Names` is asked for."""
    return {
        "primitive": vocabulary.PRIMITIVES,
        "function": vocabulary.FUNCTIONS,
        "constant": vocabulary.CONSTANTS,
        "colour": vocabulary.COLOURS,
    }.get(kind, ())


def assigned_names(node: syntax.Definition) -> Iterator[syntax.Name]:
    """The parameters that ``node`` assigns, in text order."""
    if isinstance(node, syntax.Calculation | syntax.Inline):
        yield from (each.target for each in node.statements if isinstance(each, syntax.Assignment))
    elif isinstance(node, syntax.Selection):
        yield from node.parameters
        for term in terms_of(node):
            for item in term.items:
                if isinstance(item, syntax.Inline):
                    yield from assigned_names(item)


def terms_of(node: syntax.Selection) -> Iterator[syntax.Term]:
    """Every term of a Selection's productions and entry action, those in brackets included."""
    if node.entry is not None:
        yield node.entry
    for production in node.productions:
        yield from _production_terms(production)


def _production_terms(production: syntax.Production | None) -> Iterator[syntax.Term]:
    while isinstance(production, syntax.If):
        yield from _production_terms(production.then)
        production = production.otherwise
    if production is not None:
        for alternative in production.alternatives:
            if alternative.body is not None:
                yield from _union_terms(alternative.body)


def _union_terms(union: syntax.Union) -> Iterator[syntax.Term]:
    for term in union.terms:
        yield term
        for item in term.items:
            if isinstance(item, syntax.Group):
                yield from _union_terms(item.union)


def kind_of_definition(node: syntax.Definition) -> str:
    """The kind of what ``node``, which has a name, defines: see model.Definition."""
    if isinstance(node, syntax.Declare):
        first = node.items[0] if node.items else None
        if not isinstance(first, syntax.Block):
            return "value"
        if first.name.name == "colour_map":
            return "color_map"
        return (
            first.name.name if first.name.name in ("texture", "pigment", "finish", "color_map") else "object"
        )
    return {
        syntax.ParameterDeclaration: "input",
        syntax.Selection: "selection",
        syntax.Calculation: "calculation",
        syntax.Transformation: "transformation",
        syntax.Texture: "texture",
    }[type(node)]


def _identity(path: Path | None) -> Path:
    return path.resolve() if path is not None else Path("<text>")
