"""The corpus has every kind of node, every field of each, and every token of the grammar."""

from __future__ import annotations

import json

from test_corpus import ALL, GRAMMAR

from plsys.compiler.reading.grammar import syntax_tree


def seen() -> tuple[set[str], set[tuple[str, str]], set[str]]:
    """The named nodes, (node, field) pairs and tokens in the trees of the corpus."""
    nodes, fields, tokens = set(), set(), set()
    for case in ALL:
        waiting = [syntax_tree(case.text.encode()).root_node]
        while waiting:
            node = waiting.pop()
            (nodes if node.is_named else tokens).add(node.type)
            for i, child in enumerate(node.children):
                if (field := node.field_name_for_child(i)) is not None:
                    fields.add((node.type, field))
                waiting.append(child)
    return nodes, fields, tokens


KINDS = json.loads((GRAMMAR / "src/node-types.json").read_text())
NODES, FIELDS, TOKENS = seen()


def test_every_node_is_in_the_corpus():
    assert sorted({kind["type"] for kind in KINDS if kind["named"] and "subtypes" not in kind} - NODES) == []


def test_every_field_is_in_the_corpus():
    wanted = {(kind["type"], field) for kind in KINDS for field in kind.get("fields", ())}
    assert sorted(wanted - FIELDS) == []


def test_every_token_is_in_the_corpus():
    assert sorted({kind["type"] for kind in KINDS if not kind["named"]} - TOKENS) == []


def test_every_visible_rule_makes_nodes():
    rules = json.loads((GRAMMAR / "src/grammar.json").read_text())["rules"]
    aliased = {"spaced_call", "braced_statements"} | {name for name in rules if name.startswith(("component_", "item_"))}
    assert {name for name in rules if not name.startswith("_")} - aliased <= NODES
