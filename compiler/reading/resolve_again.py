"""A scene resolved again after an edit within definitions: what they say is exchanged in the model, the rest stays.

Resolver that has run, files with the definitions to be resolved anew → whether that was all. What others see of a
scene has to be as before: the same names of the same kinds, as many rules, the same ways from Selection to Selection, and
nothing to report. Then nothing else of the model can be different, and the time doesn't depend on its size.

Example: of ``Transformation T { scale 2; }`` that is ``scale 3`` now, one operator is made, and with it the Selections
that use T; a Calculation that has become a Transformation isn't resolved here.
"""

from __future__ import annotations

from typing import Collection, Iterable, Mapping

from . import syntax
from .resolve import Resolver
from .resolve_names import assigned_names, kind_of_definition
from .resolve_rules import rule_count
from .source import Source

# Definitions that lead to nothing but what entries, symbols and references hold.
KINDS = frozenset(("selection", "calculation", "transformation", "texture"))


def resolve_again(
    resolver: Resolver, files: Iterable[syntax.File], gone: Collection[Source], names: Iterable[str], order: Mapping[Source, int]
) -> bool:
    """Bring ``resolver.model`` up to date with ``files``, each all of a source, in the text's order. ``gone`` are the sources that
    they replace, ``names`` all that stand there; ``order`` numbers the sources of the scene. The meanings of ``gone`` were
    forgotten before. False, with nothing changed, where the whole scene has to be resolved. Messages are added to
    the resolver's diagnostics: where there are errors, it can't be used again."""
    nodes = [node for file in files for node in file.definitions]
    if not all(_fits(resolver, node) for node in nodes):
        return False
    entries = resolver.names.entries
    for name in names:
        if (entry := entries.get(name)) is not None:
            references = entry.definition.references
            references[:] = [span for span in references if span.source not in gone]
    _exchange(resolver, nodes)
    _assign(resolver, nodes, gone, order)
    for node in nodes:
        if isinstance(node, syntax.Selection):
            resolver.model.symbols[node.name.name] = resolver.rules.renewed(node)
    for node in nodes:
        resolver.names.reporting(lambda: resolver.force(entries[node.name.name]), None)
    return True


def _fits(resolver: Resolver, node: syntax.Definition) -> bool:
    """Whether ``node`` can take the place of what has defined its name."""
    if isinstance(node, syntax.Block | syntax.Include):
        return False
    entry = resolver.names.entries.get(node.name.name)
    if entry is None or entry.kind not in KINDS or entry.kind != kind_of_definition(node):
        return False
    before: syntax.Definition = entry.node  # type: ignore[assignment]
    if _assigned(node) != _assigned(before):
        return False
    if resolver.model.meshes and (_may_have_meshes(node) or _may_have_meshes(before)):
        return False  # files may have changed, and meshes are numbered
    if not isinstance(node, syntax.Selection):
        return True
    is_as_long = sum(map(rule_count, node.productions)) == sum(map(rule_count, before.productions))
    return is_as_long and resolver.terms.edges()[node.name.name] == resolver.terms.ends_of(node)


def _may_have_meshes(node: syntax.Definition) -> bool:
    return "mesh" in node.span.text


def _assigned(node: syntax.Definition) -> list[str]:
    """The parameters that ``node`` assigns, in the order in which they appear."""
    return list(dict.fromkeys(name.name for name in assigned_names(node)))


def _exchange(resolver: Resolver, nodes: Iterable[syntax.Definition]) -> None:
    for node in nodes:
        entry = resolver.names.entries[node.name.name]
        entry.node, entry.value, entry.failed = node, None, False
        entry.definition.span = node.name.span
        if isinstance(node, syntax.Selection):
            resolver.terms.forget(node.name.name)


def _assign(resolver: Resolver, nodes: Iterable[syntax.Definition], gone: Collection[Source], order: Mapping[Source, int]) -> None:
    """Let what ``nodes`` assign take the places of assignments in sources that are gone."""
    assigned: dict[str, list[syntax.Name]] = {}
    for node in nodes:
        for name in assigned_names(node):
            assigned.setdefault(name.name, []).append(name)
    for text, several in assigned.items():
        entry = resolver.names.entries[text]
        spans = [span for span in entry.definition.assignments if span.source not in gone]
        spans = sorted([*spans, *(name.span for name in several)], key=lambda span: (order[span.source], span.start))
        entry.definition.assignments[:] = spans
        entry.definition.span = spans[0]
        entry.node = next((name for name in several if name.span is spans[0]), entry.node)
