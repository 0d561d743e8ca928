"""Snippets: what a completion puts in, with places to fill.

Rows of the vocabulary → snippets in the protocol's syntax. The values come from the rows' examples, so that a snippet
compiles as it stands.

Example: the row of ``trans``, whose example is ``trans 0 0 1.99``, gives ``trans ${1:0} ${2:0} ${3:1.99};``.
"""

from __future__ import annotations

import re

from plsys.compiler.analysis import vocabulary

Row = vocabulary.Row

_NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:/\d+)?(?![\w.])")
# A block with more numbers than this is put in as it is.
MAX_PLACES = 16

# Definitions by the word that they begin with.
DEFINITIONS = {
    "Selection": "Selection ${1:Name}\n{\n    ${1:Name} -> ${0:sphere};\n}",
    "Calculation": "Calculation ${1:C_name} { ${2:n} = ${0:1}; }",
    "Transformation": "Transformation ${1:T_name} { ${0:trans 0 0 1;} }",
    "Texture": "Texture ${1:Name} { pigment { color rgb <${2:0.5}, ${3:0.5}, ${4:0.5}> } finish { diffuse ${0:0.7} } }",
    "Parameter": 'Parameter ${1:name} = ${2:1} [${3:0} to ${4:10}] "${0:What it means}";',
    "#declare": "#declare ${1:Name} = $0;",
    "#include": '#include "$0"',
}

# Several definitions at once, by a name for the list: what they are, and the snippet.
WHOLE = {
    "recursion": (
        "a symbol that counts down",
        "Selection ${1:Plant}\n{\n    C_begin$1 $1;\n"
        "    if (${2:n} > 0) $1 -> ${3:cylinder} + [ --${2:n}; trans 0 0 1; scale 0.8 ] $1;\n"
        "    else       $1 -> ${0:sphere};\n}\nCalculation C_begin$1 { ${2:n} = ${4:10}; }",
    ),
    "scene": (
        "camera, light, ground and an object; z is up",
        "global_settings { assumed_gamma 1.0 }\nbackground { color rgb <0.78, 0.88, 1.0> }\n"
        "camera { location <0, -14, 5> sky <0, 0, 1> right <-4/3, 0, 0> look_at <0, 0, 3> angle 45 }\n"
        "light_source { <20, -30, 40> color rgb 1 }\n"
        "plane { <0, 0, 1>, 0 texture { pigment { color rgb <0.5, 0.6, 0.4> } } }\n"
        "object { ${1:Plant} }\n\nSelection $1 { $1 -> ${0:sphere}; }",
    ),
    "alternatives": ("a symbol with weighted rules", "Selection ${1:Name} { $1 -> ${2:3}: ${3:sphere} | ${4:1}: ${0:box}; }"),
}

COLOURS = {
    "color": "color rgb <${1:1}, ${2:1}, ${3:1}>",
    "rgb": "rgb <${1:1}, ${2:1}, ${3:1}>",
    "rgbt": "rgbt <${1:1}, ${2:1}, ${3:1}, ${4:0.5}>",
    "rgbf": "rgbf <${1:1}, ${2:1}, ${3:1}, ${4:0.5}>",
    "rgbft": "rgbft <${1:1}, ${2:1}, ${3:1}, ${4:0.3}, ${5:0.3}>",
}


def call(row: Row) -> str:
    """``clamp(${1:x}, ${2:low}, ${3:high})``; of many arguments the least."""
    inside = row.signature.partition("(")[2].rpartition(")")[0]
    names = [each.strip() for each in inside.split(",") if each.strip() not in ("", "...")]
    names = names[: max(1, row.arity[0])]
    return f"{row.name}({', '.join(_place(i, each) for i, each in enumerate(names, 1))})"


def operation(row: Row, semicolon: bool) -> str:
    """``trans ${1:0} ${2:0} ${3:1.99};``"""
    match = re.search(rf"\b{row.name}\s+([^;}}]+)", row.example)
    values = match[1].split() if match else []
    places = " ".join(_place(i, each) for i, each in enumerate(values, 1))
    return f"{row.name} {places}{';' if semicolon else ''}$0"


def property_(row: Row) -> str:
    """``angle ${1:45}``, ``location <${1:0}, ${2:0}, ${3:-5}>``, ``pigment { $0 }``."""
    if row.type == "flag":
        return ""
    if row.type == "block":
        return f"{row.name} {{ $0 }}"
    if row.type == "colour" and "color" in row.name:
        return f"{row.name} rgb <${{1:1}}, ${{2:1}}, ${{3:1}}>"
    match = re.search(rf"\b{row.name}\s+((?:rgb\s*)?(?:<[^<>]*>|[\d.]+))", row.example)
    return f"{row.name} {numbered(match[1])}" if match else f"{row.name} $0"


def block(row: Row) -> str:
    """The block of the row's example with its numbers as places to fill."""
    if row.name in ("object",):
        return "object { ${1:Name} $0 }"
    if row.name in ("texture", "pigment", "finish", "union", "mesh", "color_map"):
        return f"{row.name} {{ $0 }}"
    text = _balanced(row.example, row.name)
    return numbered(text) if text else f"{row.name} {{ $0 }}"


def numbered(text: str) -> str:
    """``<${1:0}, ${2:1}>``: numbers become places."""
    text = text.replace("$", "\\$")
    if len(_NUMBER.findall(text)) > MAX_PLACES:
        return text
    count = iter(range(1, MAX_PLACES + 1))
    return _NUMBER.sub(lambda match: _place(next(count), match[0]), text)


def _place(number: int, text: str) -> str:
    escaped = text.replace("}", "\\}")
    return f"${{{number}:{escaped}}}"


def _balanced(text: str, name: str) -> str:
    """``name { … }`` in ``text``, up to the brace that closes it."""
    match = re.search(rf"\b{name}\s*\{{", text)
    if match is None:
        return ""
    depth = 0
    for i in range(match.end() - 1, len(text)):
        depth += (text[i] == "{") - (text[i] == "}")
        if depth == 0:
            return text[match.start() : i + 1]
    return ""
