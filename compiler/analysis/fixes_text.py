"""Quick fixes of how a scene is written: what is missing, too much, or a habit from another language.

Each takes the spot of the message, the match of the row's pattern, and the message; it gives a title and edits, or None.
"""

from __future__ import annotations

import re

from ..reading import syntax, vocabulary
from .actions import Spot, TextEdit, rules
from .document import Message

Found = tuple[str, list[TextEdit]] | None

_CLOSER = {"{": "}", "(": ")", "[": "]", "<": ">"}


def insert(text: str, title: str = ""):
    """A fix that puts ``text`` at the start of the spot."""

    def fix(spot: Spot, match: re.Match, message: Message) -> Found:
        return title or f"Add '{text.strip()}'", [spot.edit(spot.start, spot.start, text)]

    return fix


def replace(text: str):
    """A fix that puts ``text`` (with groups of the match) in the place of the spot."""

    def fix(spot: Spot, match: re.Match, message: Message) -> Found:
        new = match.expand(text)
        return f"Replace by '{new}'", [spot.replace(new)]

    return fix


def remove(spot: Spot, match: re.Match, message: Message) -> Found:
    if spot.start == spot.end:
        return None
    return f"Remove '{short(spot.text)}'", [spot.cut(spot.start, spot.end)]


def write_hint(spot: Spot, match: re.Match, message: Message) -> Found:
    """Replace the spot by what the hint says to write."""
    written = re.search(r"\bwrite (.+)$", message.diagnostic.hint)
    if written is None or "…" in written[1]:
        return None
    return f"Write '{short(written[1])}'", [spot.replace(written[1])]


def suggestion(spot: Spot, match: re.Match, message: Message) -> Found:
    """ "did you mean 'Tree'?": replace the last word of the spot that isn't it."""
    if spot.start == spot.end or "\n" in spot.text:
        return None
    joined = spot.signed_name()
    return f"Replace by '{match[1]}'", [joined if joined is not None and joined.text == match[1] else spot.replace(match[1])]


def in_brackets(spot: Spot, match: re.Match, message: Message) -> Found:
    return "Put it in brackets", [spot.edit(spot.start, spot.start, "("), spot.edit(spot.end, spot.end, ")")]


def close(spot: Spot, match: re.Match, message: Message) -> Found:
    """Put the closer of a bracket where what it holds ends."""
    opener = spot.text
    if close_inline(spot, match, message) is not None:
        return None
    node, base = spot.document.node_at(spot.start)
    if opener == "{":
        block = spot.document.text.block_at(spot.start)[0]
        code = block.data[: _code_end(block.data)]
        end = base + len(code)
        on_own_line = "\n" in spot.slice(spot.start, end)
        return "Add '}'", [spot.edit(end, end, "\n}" if on_own_line else " }")]
    parent = node.parent
    if opener not in _CLOSER or parent is None or parent.type in ("ERROR", "source_file"):
        return None
    end = base + parent.end_byte
    return f"Add '{_CLOSER[opener]}'", [spot.edit(end, end, _CLOSER[opener])]


def close_string(spot: Spot, match: re.Match, message: Message) -> Found:
    return "Add '\"'", [spot.edit(spot.end, spot.end, '"')]


def close_comment(spot: Spot, match: re.Match, message: Message) -> Found:
    text = spot.document.text
    end = text.line_start(text.line_of(spot.start)) + len(text.line_bytes(text.line_of(spot.start)))
    return "Add '*/' at the line's end", [spot.edit(end, end, " */")]


def without_braces(spot: Spot, match: re.Match, message: Message) -> Found:
    node, base = spot.document.node_at(spot.start)
    parent = node.parent
    if parent is None or parent.children[-1].type != "}":
        return None
    closer = parent.children[-1]
    return "Remove the braces", [
        spot.cut(spot.start, spot.end),
        spot.cut(base + closer.start_byte, base + closer.end_byte),
    ]


def angle_brackets(spot: Spot, match: re.Match, message: Message) -> Found:
    node, base = spot.document.node_at(spot.start)
    closer = node.parent.children[-1]
    if closer.type != ")":
        return None
    return "Write it as a vector <…>", [
        spot.replace("<"),
        spot.edit(base + closer.start_byte, base + closer.end_byte, ">"),
    ]


def touching_product(spot: Spot, match: re.Match, message: Message) -> Found:
    return f"Write {match[1]}*{match[2]}", [spot.replace(f"{match[1]}*{match[2]}")]


def touching_values(spot: Spot, match: re.Match, message: Message) -> Found:
    return f"Write {match[1]} {match[2]}", [spot.replace(f"{match[1]} {match[2]}")]


def without_call_brackets(spot: Spot, match: re.Match, message: Message) -> Found:
    name, _, arguments = spot.text.partition("(")
    written = f"{name} {arguments.rstrip().removesuffix(')')}".rstrip()
    return f"Write '{short(written)}'", [spot.replace(written)]


def closed_up_call(spot: Spot, match: re.Match, message: Message) -> Found:
    return "Remove the space", [spot.replace(re.sub(r"\s", "", spot.text))]


def separate(mark: str):
    """A fix that puts ``mark`` behind what stands before the spot."""

    def fix(spot: Spot, match: re.Match, message: Message) -> Found:
        before = spot.slice(spot.base, spot.start)
        end = spot.start - len(before[len(before.rstrip()) :].encode())
        return (f"Add '{mark}'", [spot.edit(end, end, mark)]) if end < spot.start else None

    return fix


def weigh_all(spot: Spot, match: re.Match, message: Message) -> Found:
    """Give the alternatives of the rule that have none the weight 1."""
    node, at = spot.definition, spot.start - spot.base
    for production in node.productions if isinstance(node, syntax.Selection) else ():
        for rule, _ in rules(production):
            bodies = [each.body for each in rule.alternatives if each.weight is None and each.body is not None]
            if any(body.span.start == at for body in bodies):
                starts = [spot.base + body.span.start for body in bodies]
                title = "Add '1:' to each alternative" if len(bodies) > 1 else "Add '1:'"
                return title, [spot.edit(start, start, "1: ") for start in starts]
    return None


def close_inline(spot: Spot, match: re.Match, message: Message) -> Found:
    """Put the ']' of an operator before the operand that it has swallowed."""
    rest = spot.slice(spot.end, spot.base + len(spot.document.text.block_at(spot.start)[0].data))
    found = re.match(r"([^\]\[{}|+]*?[\w.)])\s+([A-Za-z_]\w*)\s*(?=[;+|]|$)", rest.partition("\n")[0])
    if spot.text != "[" or found is None:
        return None
    entry = spot.scene.entries.get(found[2])
    if found[2] not in vocabulary.PRIMITIVES and (entry is None or entry.kind != "selection"):
        return None
    end = spot.end + len(found[1].encode())
    return f"Add ']' before {found[2]}", [spot.edit(end, end, " ]")]


def remove_directive(spot: Spot, match: re.Match, message: Message) -> Found:
    """Take away a directive with the rest of its line."""
    text = spot.document.text
    end = text.line_start(text.line_of(spot.start)) + len(text.line_bytes(text.line_of(spot.start)))
    line = re.match(r"[^;\r\n]*;?", spot.slice(spot.start, end))
    assert line is not None
    return f"Remove '{short(line[0].strip())}'", [spot.cut(spot.start, spot.start + len(line[0].encode()))]


def add_body(spot: Spot, match: re.Match, message: Message) -> Found:
    body = re.search(r"\{.*\}$", message.diagnostic.hint)
    if body is None:
        return None
    text = body[0].replace("Name -> …;", f"{match[1]} -> ;")
    return "Add a body", [spot.edit(spot.start, spot.start, f" {text}")]


def add_value(spot: Spot, match: re.Match, message: Message) -> Found:
    code = spot.text.rstrip().rstrip(";").rstrip("= \t")
    return "Give it the value 1", [spot.replace(f"{code} = 1;")]


def _code_end(data: bytes) -> int:
    """Where the last token ends that is no comment."""
    tokens = re.finditer(rb'//[^\r\n]*|/\*.*?(?:\*/|\Z)|"(?:[^"\\\r\n]|\\.)*"?|\S', data, re.DOTALL)
    return max((match.end() for match in tokens if match[0][:2] not in (b"//", b"/*")), default=0)


def short(text: str) -> str:
    line = text.split("\n")[0]
    return line if line == text and len(line) <= 40 else line[:37] + "…"


_WRITE = r"^.*(?:lacks a digit|(?<!\^' )is no operator|this dash|quotation mark|takes no arguments|ends with its Selection's name|left side takes)"

TEXT_FIXES = {
    "syntax": (
        (r"stands where a rule has '->'", replace("->")),
        (r"stands where a range has 'to'", replace(" to ")),
        (r"is written as two words", replace("else if")),
        (r"a condition stands in brackets", in_brackets),
        (r"braces don't surround rules|statements in a \w+ don't nest", without_braces),
        (r"a vector stands in angle brackets", angle_brackets),
        (r"the number (\S+) touches the name (\w+)", touching_product),
        (r"the number (\S+) touches the name (\w+)", touching_values),
        (r"operation's arguments stand without brackets", without_call_brackets),
        (r"a space stands between a function and its bracket", closed_up_call),
        (r"this alternative has no weight", weigh_all),
        (r"nothing stands after this '\+'|an alternative is missing after this", remove),
        (_WRITE, write_hint),
    ),
    "missing": (
        (r"^missing ';'", insert(";")),
        (r"^missing '->'", insert(" ->")),
        (r"^missing '='", insert(" =")),
        (r"^\w+ (\w+) has no body", add_body),
        (r"^(?:Parameter|#declare) \w+ has no value", add_value),
    ),
    "assignment-in-condition": ((r"", replace("==")),),
    "unclosed": (
        (r"this '\[' is never closed", close_inline),
        (r"this '[{(\[<]' is never closed", close),
        (r"this string is never closed", close_string),
        (r"this comment is never closed", close_comment),
    ),
    "encoding": ((r"NUL byte|not UTF-8", remove),),
    "wrong-arguments": ((_WRITE, write_hint),),
    "unsupported": (
        (r"^#local isn't", replace("#declare")),
        (r"^POV-Ray's 'merge'", replace("union")),
        (r"^#(?:version|undef|debug|warning|error|statistics|render) isn't", remove_directive),
    ),
}

HINT_FIXES = (
    (r"did you mean '([^']+)'", suggestion),
    (r"^remove (?:it|them)(?:$|[,;:])", remove),
    (r"or remove the '\+'", remove),
    (r"^a (?:vector|call) looks like .* comma between two values", separate(",")),
    (r"^perhaps a ';' is missing before it", separate(";")),
)
