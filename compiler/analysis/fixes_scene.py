"""Quick fixes of what a scene means: unused and unreachable things, recursions, values, the order of properties.

Each takes the spot of the message, the match of the row's pattern, and the message; it gives a title and edits, or None.
"""

from __future__ import annotations

import re
from math import pi

from ..reading import syntax, vocabulary
from .actions import Spot, TextEdit, fresh_name, terms
from .bounding import bounded
from .document import Message

Found = tuple[str, list[TextEdit]] | None

_CAMERA = "camera { location <0, -10, 3> sky <0, 0, 1> right <-4/3, 0, 0> look_at <0, 0, 1> angle 45 }\n"
_LIGHT = "light_source { <20, -30, 40> color rgb 1 }\n"
_OTHER_WAY = {"++": "--", "--": "++", "+=": "-=", "-=": "+="}


# --- definitions


def remove_definition(spot: Spot, match: re.Match, message: Message) -> Found:
    node = spot.definition
    if node is None:
        return None
    head = node.path if isinstance(node, syntax.Include) else node.name
    if not node.span.start <= spot.start - spot.base <= head.span.end:
        return None
    what = "this #include" if isinstance(node, syntax.Include) else f"'{node.name.name}'"
    return f"Remove {what}", [spot.cut(spot.base + node.span.start, spot.base + node.span.end)]


def rename_definition(spot: Spot, match: re.Match, message: Message) -> Found:
    """Give a definition whose name plsys has already another one, with the rules in it."""
    node = spot.definition
    if node is None or isinstance(node, syntax.Include | syntax.Block):
        return None
    old, new = node.name.name, fresh_name(spot.scene, f"my_{node.name.name}")
    own = [
        name
        for name in spot.facts.names
        if node.span.start <= name.start < node.span.end and name.name == old
    ]
    edits = [
        spot.edit(spot.base + name.start, spot.base + name.end, new) for name in own if name.role != "read"
    ]
    return f"Rename it to '{new}'", edits


def remove_rule(spot: Spot, match: re.Match, message: Message) -> Found:
    return "Remove this rule", [spot.cut(spot.start, spot.end)]


def place_symbol(spot: Spot, match: re.Match, message: Message) -> Found:
    end = spot.after_definition()
    return f"Place it: object {{ {match[1]} }}", [spot.edit(end, end, f"\nobject {{ {match[1]} }}")]


def define(kind: str, body: str):
    """A fix that defines an unknown name behind the definition that uses it."""

    def fix(spot: Spot, match: re.Match, message: Message) -> Found:
        name = spot.text
        role = _role(spot)
        if not re.fullmatch(r"[A-Za-z_]\w*", name) or role is None or kind not in role:
            return None
        at = spot.after_definition()
        text = f"#declare {name} = 1;" if kind == "value" else f"{kind} {name} {{ {body.format(name)} }}"
        what = "value" if kind == "value" else kind
        return f"Define the {what} '{name}'", [spot.edit(at, at, f"\n{text}")]

    return fix


def _role(spot: Spot) -> tuple[str, ...] | None:
    """What an unknown name may be, by where it stands."""
    node, _ = spot.document.node_at(spot.start)
    parent = node.parent
    is_call = False
    while parent is not None and parent.type == "call":
        is_call = is_call or node == parent.children[0]
        node, parent = parent, parent.parent
    if parent is None or parent.type == "operation" and node == parent.children[0]:
        return None
    if parent.type == "term":
        is_operand = node.end_byte == parent.children[-1].end_byte
        return ("Selection",) if is_operand else ("Transformation", "Calculation")
    if parent.type == "block_body":
        block = parent.parent.child_by_field_name("name")
        word = block.text.decode() if block is not None else ""
        return ("Selection",) if word == "object" else None
    return (
        ("value",)
        if not is_call
        and parent.type in ("binary", "unary", "operation", "assignment", "vector", "parenthesized")
        else None
    )


def operand_sum(spot: Spot, match: re.Match, message: Message) -> Found:
    if operand_last(spot, match, message) is not None:
        return None
    return "Join with '+'", [spot.edit(spot.end, spot.end, " +")]


def operand_last(spot: Spot, match: re.Match, message: Message) -> Found:
    """Move an operand behind the operators that follow it."""
    at = spot.start - spot.base
    for term in terms(spot.definition):
        if not any(item.span.start == at for item in term.items[:-1]):
            continue
        rest = term.items[[item.span.start for item in term.items].index(at) + 1 :]
        if all(isinstance(item, syntax.Inline) or _is_operator_name(spot, item) for item in rest):
            end = spot.base + rest[-1].span.end
            operators = spot.slice(spot.base + rest[0].span.start, end)
            return f"Write {spot.text} last", [spot.edit(spot.start, end, f"{operators} {spot.text}")]
    return None


def _is_operator_name(spot: Spot, item: object) -> bool:
    entry = spot.scene.entries.get(item.name) if isinstance(item, syntax.Name) else None
    return entry is not None and entry.kind in ("calculation", "transformation", "texture")


def own_target(spot: Spot, match: re.Match, message: Message) -> Found:
    return f"Write {match[1]}", [spot.replace(match[1])]


def joined_name(spot: Spot, match: re.Match, message: Message) -> Found:
    edit = spot.signed_name()
    return (f"Write '{edit.text}'", [edit]) if edit is not None and edit.text in spot.scene.entries else None


def declare_time(spot: Spot, match: re.Match, message: Message) -> Found:
    """An input of the scene in the place of POV-Ray's clock."""
    entry = spot.scene.entries.get("time")
    if entry is not None and entry.kind == "input":
        return "Write 'time'", [spot.replace("time")]
    name, at = fresh_name(spot.scene, "time"), spot.after_definition()
    declared = spot.edit(at, at, f'\nParameter {name} = 0 [0 to 1] "Time";')
    return f"Declare the Parameter '{name}'", [spot.replace(name), declared]


# --- the scene as a whole


def at_start(text: str, title: str):
    def fix(spot: Spot, match: re.Match, message: Message) -> Found:
        first = next(iter(spot.document.text.data[:3:3]), 0)
        start = 3 if first and spot.document.text.data.startswith(b"\xef\xbb\xbf") else 0
        return title, [spot.edit(start, start, text)]

    return fix


def place_first(spot: Spot, match: re.Match, message: Message) -> Found:
    written = re.search(r"object \{ (\w+) \}", message.diagnostic.hint)
    if written is None or spot.scene.meaning(written[1]) is None:
        return None
    end = len(spot.document.text)
    lead = "" if spot.slice(max(0, end - 1), end) in ("", "\n") else "\n"
    return f"Place it: {written[0]}", [spot.edit(end, end, f"{lead}{written[0]}\n")]


# --- recursion


def bound(spot: Spot, match: re.Match, message: Message) -> Found:
    node = spot.definition
    if not isinstance(node, syntax.Selection):
        return None
    return f"Bound the recursion of '{node.name.name}' with a counter", bounded(spot, node)


def count_down(spot: Spot, match: re.Match, message: Message) -> Found:
    counter = re.search(r"\[ (--\w+)", message.diagnostic.hint)
    if (
        counter is None
        or not isinstance(spot.definition, syntax.Selection)
        or spot.slice(spot.start, spot.end) == ""
    ):
        return None
    return f"Change it on the way: [ {counter[1]} ]", [
        spot.edit(spot.start, spot.start, f"[ {counter[1]} ] ")
    ]


def count_the_other_way(spot: Spot, match: re.Match, message: Message) -> Found:
    """Turn the one statement round that moves the counter."""
    counter = re.search(r"'(\w+)' only", message.diagnostic.message)
    edits = []
    for place in spot.scene.uses(counter[1]) if counter else ():
        node, base = place.document.node_at(place.start)
        operator = node.parent.child_by_field_name("operator") if node.parent is not None else None
        if place.role == "write" and operator is not None and operator.type in _OTHER_WAY:
            start, end = base + operator.start_byte, base + operator.end_byte
            edits.append(TextEdit(place.document, start, end, _OTHER_WAY[operator.type]))
    return ("Count the other way", edits) if len(edits) == 1 else None


def write_comparison(spot: Spot, match: re.Match, message: Message) -> Found:
    written = re.search(r"write (\w+ [<>]=? \S+)$", message.diagnostic.hint)
    return (f"Write {written[1]}", [spot.replace(written[1])]) if written else None


def assign_at_entry(spot: Spot, match: re.Match, message: Message) -> Found:
    """Give the parameter a value in the entry action of the Selection that the message speaks of."""
    name, owner = match[1], match[2]
    meaning = spot.scene.meaning(owner)
    if meaning is None or not isinstance(meaning.node, syntax.Selection):
        return None
    return f"Assign '{name}' in the entry action of '{owner}'", [
        entry_edit(spot, meaning.node, f"{name} = 0")
    ]


def entry_edit(spot: Spot, node: syntax.Selection, statements: str) -> TextEdit:
    """The edit that puts ``statements`` first into the entry action of a Selection of the scene."""
    place = spot.scene.place(node.span)
    assert place is not None
    document, base = place.document, place.start - node.span.start
    if node.entry is not None:
        at = base + node.entry.span.start
        return TextEdit(document, at, at, f"[ {statements} ] ")
    at = base + node.productions[0].span.start
    before = document.text.slice(document.text.line_start(document.text.line_of(at)), at)
    gap = "\n" + before.decode() if not before.strip() else " "
    return TextEdit(document, at, at, f"[ {statements} ] {node.name.name};{gap}")


# --- values


def without_bytes(spot: Spot, match: re.Match, message: Message) -> Found:
    vector = re.search(r"<[^<>]*>", spot.text)
    if vector is None:
        return None
    written = re.sub(r"(?<![\w.])(\d+(?:\.0*)?)(?![\w.])", r"\1/255", vector[0])
    start = spot.start + len(spot.text[: vector.start()].encode())
    return "Divide by 255", [spot.edit(start, start + len(vector[0].encode()), written)]


def to_degrees(spot: Spot, match: re.Match, message: Message) -> Found:
    text = spot.text
    if re.fullmatch(r"-?\d+(\.\d+)?", text):
        written = f"{float(text) * 180 / pi:.4g}"
    elif re.fullmatch(r"pi(\s*/\s*\d+)?", text):
        written = text.replace("pi", "180")
    else:
        written = f"({text})*180/pi"
    return f"Write it in degrees: {written}", [spot.replace(written)]


def within(spot: Spot, match: re.Match, message: Message) -> Found:
    sides = re.fullmatch(r"(.+?)\s*([!=])=\s*(.+)", spot.text, re.DOTALL)
    if sides is None:
        return None
    left = sides[1] if re.fullmatch(r"[\w.+*/() -]+", sides[1]) else f"({sides[1]})"
    right = sides[3] if re.fullmatch(r"[\w.]+(?:\([\w., ]*\))?", sides[3]) else f"({sides[3]})"
    written = f"abs({left} - {right}) {'<' if sides[2] == '=' else '>='} 0.001"
    return "Compare with a tolerance", [spot.replace(written)]


def without_zeros(spot: Spot, match: re.Match, message: Message) -> Found:
    if not spot.text.startswith("scale"):
        return None  # a matrix has zeros that are right
    written = re.sub(r"(?<![\w.])0(?:\.0+)?(?![\w.])", "1", spot.text)
    return ("Leave that axis at 1", [spot.replace(written)]) if written != spot.text else None


def gamma_one(spot: Spot, match: re.Match, message: Message) -> Found:
    return "Write 1.0", [spot.replace("1.0")]


# --- properties


def property_first(spot: Spot, match: re.Match, message: Message) -> Found:
    """Move a property of a camera before look_at."""
    node = spot.definition
    part = _property(spot)
    if part is None or not isinstance(node, syntax.Block):
        return None
    look_at = next((i for i in node.items if isinstance(i, syntax.Name) and i.name == "look_at"), None)
    if look_at is None:
        return None
    at = spot.base + look_at.span.start
    return f"Move '{spot.text}' before look_at", [spot.edit(at, at, f"{spot.slice(*part)} "), spot.cut(*part)]


def remove_property(spot: Spot, match: re.Match, message: Message) -> Found:
    if isinstance(spot.definition, syntax.Selection):
        return None  # what stands in a rule is no property
    part = _property(spot)
    node = spot.document.node_at(spot.start)[0]
    if part is not None and node.parent is not None and node.parent.type not in ("block", "block_body"):
        return None  # a value, without which something else is missing
    return (f"Remove '{spot.slice(spot.start, spot.end)}'", [spot.cut(*part)]) if part else None


def _property(spot: Spot) -> tuple[int, int] | None:
    """Where the property or block at the spot starts and ends, with its values."""
    node, base = spot.document.node_at(spot.start)
    while (
        node is not None and node.parent is not None and node.parent.type not in ("block_body", "source_file")
    ):
        node = node.parent
    if node is None or node.parent is None:
        return None
    start, end = base + node.start_byte, base + node.end_byte
    following = node.next_named_sibling
    while node.type == "name" and following is not None and not _starts_property(following):
        end = base + following.end_byte
        following = following.next_named_sibling
    return start, end


def _starts_property(node) -> bool:
    if node.type == "block":
        return True
    words = (*(name for block in vocabulary.PROPERTIES.values() for name in block), *vocabulary.MODIFIERS)
    return node.type == "name" and node.text.decode() in words or node.type == "comment"


SCENE_FIXES = {
    "unknown-name": (
        (r"^unknown name", joined_name),
        (r"^unknown|is (?:not|un)known|nothing defines", define("Selection", "{0} -> ;")),
        (r"^unknown|is (?:not|un)known|nothing defines", define("Transformation", "trans 0 0 1;")),
        (r"^unknown|is (?:not|un)known|nothing defines", define("Calculation", "n = 1;")),
        (r"^unknown|is (?:not|un)known|nothing defines", define("value", "")),
    ),
    "duplicate-name": (
        (r"is defined twice|a second \w+ block", remove_definition),
        (r"of plsys$", rename_definition),
    ),
    "wrong-kind": (
        (r"an operand: nothing can follow it", operand_last),
        (r"an operand: nothing can follow it|a group in brackets is an operand", operand_sum),
        (r"stands in the Selection '(\w+)'", own_target),
    ),
    "wrong-order": ((r"after look_at", property_first),),
    "unsupported": (
        (r"assumed_gamma must be", gamma_one),
        (r"^POV-Ray's 'clock'", declare_time),
        (r"^POV-Ray's '", remove_property),
    ),
    "include": ((r"stock|colors|\.inc", remove_definition),),
    "unreachable-rule": ((r"", remove_rule),),
    "unused": ((r"that nothing (?:uses|reads)", remove_definition),),
    "unreachable": (
        (r"leads to the Selection '(\w+)'", place_symbol),
        (r"leads to the Selection '(\w+)'", remove_definition),
    ),
    "no-camera": ((r"", at_start(_CAMERA, "Add a camera")),),
    "no-light": ((r"", at_start(_LIGHT, "Add a light")),),
    "no-object": ((r"", place_first),),
    "endless": ((r"", bound),),
    "unproven": ((r"", bound),),
    "diverging": ((r"", bound),),
    "slow-contraction": ((r"", bound),),
    "random-loop": ((r"", bound),),
    "identity-cycle": ((r"", bound),),
    "steps-over": ((r"", write_comparison),),
    "counter": (
        (r"which this recursion of", count_down),
        (r"never ends the recursion", count_the_other_way),
    ),
    "unassigned": ((r"'(\w+)' is read on the way through '(\w+)'", assign_at_entry),),
    "maybe-unassigned": ((r"'(\w+)' may be read on the way through '(\w+)'", assign_at_entry),),
    "colour-range": ((r"", without_bytes),),
    "radians": ((r"", to_degrees),),
    "float-equality": ((r"", within),),
    "degenerate": ((r"a scale of 0", without_zeros),),
    "singular": ((r"scale|flattens", without_zeros),),
}
