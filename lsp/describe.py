"""What a name means, in Markdown: for hover, and for the documentation of completions.

A scene and a name → text. Costs the definitions that it shows, not the file.

Example: of ``T_left`` its definition, *moves by (0, 0, 1.99), turns by 60° about y and shrinks to 0.8*, its matrix and
determinant, and how POV-Ray would write it.
"""

from __future__ import annotations

from plsys.compiler.analysis import (
    GuardInsight,
    Meaning,
    Motion,
    Scene,
    SymbolInsight,
    ValueInsight,
    constant_of,
    insights_of,
    motion_of,
    stretching_of,
    syntax,
    vocabulary,
)

from . import palette, prose

# A definition longer than this is cut.
MAX_LINES = 12
MAX_PLACES = 4
AXES = {(1, 0, 0): "x", (0, 1, 0): "y", (0, 0, 1): "z"}
POVRAY = {"trans": "translate <{}>", "scale": "scale <{}>", "matrix": "matrix <{}>"}


def describe(scene: Scene, name: str) -> str | None:
    """Markdown about a name of the scene or the vocabulary; None if it means nothing."""
    meaning = scene.meaning(name)
    if meaning is None:
        return None
    if meaning.row is not None:
        return prose.documentation(meaning.row)
    if meaning.kind == "colour":
        return colour(name)
    parts = [prose.code(source(meaning))]
    match meaning.node:
        case syntax.Selection():
            parts.append(symbol(scene, name))
        case syntax.Calculation():
            parts.append(calculation(scene, meaning.node))
        case syntax.Transformation():
            parts.append(transformation(scene, meaning.node))
        case syntax.Declare():
            parts.append(constant(scene, meaning.node))
        case syntax.ParameterDeclaration():
            parts.append(declared_input(meaning.node))
        case _:
            if meaning.kind == "parameter":
                parts.append(parameter(scene, meaning))
    return "\n\n".join(part for part in parts if part)


def source(meaning: Meaning) -> str:
    """The definition as written; of a parameter, where it is assigned."""
    if meaning.node is None:
        statements = []
        for place in meaning.definitions[:MAX_PLACES]:
            line = place.document.text.line_bytes(place.document.text.line_of(place.start))
            statements.append(line.decode(errors="replace").strip())
        if len(meaning.definitions) > MAX_PLACES:
            statements.append(f"// and {len(meaning.definitions) - MAX_PLACES} more")
        return "\n".join(dict.fromkeys(statements))
    lines = meaning.node.span.text.splitlines()
    if len(lines) > MAX_LINES:
        lines = [*lines[:MAX_LINES], "    …"]
    return "\n".join(lines)


def symbol(scene: Scene, name: str) -> str:
    """The forecast, and the guards' runs."""
    found = next((each for each in insights_of(scene, name) if isinstance(each, SymbolInsight)), None)
    if found is None:
        return ""
    text = f"**{prose.forecast(found)}**"
    if not found.alike:
        text += "\n\nIts instances differ; the numbers are of the largest."
    return text


def calculation(scene: Scene, node: syntax.Calculation) -> str:
    """What it assigns, with first and last values."""
    lines = []
    known = {(s, e): found for s, e, found in scene.insights.get(node.span.source, ())}
    for statement in node.statements:
        if isinstance(statement, syntax.Assignment):
            found = known.get((statement.span.start, statement.span.end))
            values = f": {prose.values(found)}" if isinstance(found, ValueInsight) and prose.values(found) else ""
            lines.append(f"- assigns `{statement.target.name}`{values}")
        elif statement.name.name == "variants":
            lines.append("- makes the operand one of so many variants")
    return "\n".join(lines)


def constant(scene: Scene, node: syntax.Declare) -> str:
    """The number or the colour that a declared name stands for."""
    if len(node.items) == 1 and not isinstance(node.items[0], syntax.Block | syntax.Number):
        value = constant_of(scene, node.items[0])
        return f"= {prose.number(value)}" if value is not None else ""
    found = [parts for _, _, parts, _ in palette.colours_in(scene, node.items) if parts is not None]
    return swatch(found[0]) if len(found) == 1 else ""


def declared_input(node: syntax.ParameterDeclaration) -> str:
    parts = [node.text.value] if node.text is not None else []
    if node.low is not None and node.high is not None:
        parts.append(f"from {node.low.span.text} to {node.high.span.text}")
    if node.value is not None:
        parts.append(f"default {node.value.span.text}, set with `-D {node.name.name}=…`")
    return " · ".join(parts)


def parameter(scene: Scene, meaning: Meaning) -> str:
    """Between which values it is, and where it is assigned."""
    count = len(meaning.definitions)
    values = prose.parameter(insights_of(scene, meaning.name))
    return f"{values}; assigned in {count} place{'s' if count != 1 else ''}"


# --- transformations


def transformation(scene: Scene, node: syntax.Transformation) -> str:
    motion = motion_of(scene, node.statements)
    parts = []
    if motion is not None:
        sentence = what_it_does(motion)
        if not motion.is_constant:
            sentence = f"At its first level it {sentence}"
        parts.append(sentence[0].upper() + sentence[1:] + ".")
        parts.append(matrix(motion))
    elif (known := stretching_of(scene, node.statements)) is not None:
        parts.append(f"{measures(known.determinant, known.low, known.high)}, whatever the other values are")
    reverse = povray(node.statements)
    if reverse:
        parts.append(f"The last line acts first. POV-Ray's modifiers run the other way round: `{reverse}`")
    return "\n\n".join(parts)


def what_it_does(motion: Motion) -> str:
    """``shrinks to 0.8, turns by 60° about y and moves by (0, 0, 1.99)``"""
    parts = []
    low, high = motion.stretch
    scaling = motion.scaling
    if motion.determinant == 0:
        parts.append("flattens what it acts on, which is dropped")
    elif motion.turn is not None:
        if abs(high - 1) > 1e-9:
            parts.append(f"{'shrinks' if high < 1 else 'grows'} to {prose.number(high)}")
        angle, axis = motion.turn
        if angle > 1e-9:
            parts.append(f"turns by {about(angle, axis)}")
    elif scaling is not None:
        parts.append(f"scales x, y and z by {', '.join(map(prose.number, scaling[:2]))} and {prose.number(scaling[2])}")
    else:
        if motion.determinant < 0:
            parts.append("mirrors")
        if high - low > 1e-9:
            parts.append(f"changes lengths by factors from {prose.number(low)} to {prose.number(high)}")
        elif abs(high - 1) > 1e-9:
            parts.append(f"{'shrinks' if high < 1 else 'grows'} to {prose.number(high)}")
    if any(abs(each) > 1e-12 for each in motion.translation):
        parts.append(f"moves by ({', '.join(map(prose.number, motion.translation))})")
    if not parts:
        return "changes nothing"
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


def about(angle: float, axis: tuple[float, float, float]) -> str:
    """``60° about y``; about -y it is -60° about y."""
    rounded = tuple(round(each, 9) + 0.0 for each in axis)
    for sign in (1, -1):
        name = AXES.get(tuple(sign * each + 0.0 for each in rounded))
        if name:
            return f"{prose.number(sign * angle)}° about {name}"
    return f"{prose.number(angle)}° about ({', '.join(map(prose.number, axis))})"


def matrix(motion: Motion) -> str:
    rows = [[prose.number(round(motion.matrix[4 * r + c], 12)) for c in range(4)] for r in range(3)]
    widths = [max(len(row[c]) for row in rows) for c in range(4)]
    lines = ["  ".join(cell.rjust(width) for cell, width in zip(row, widths)) for row in rows]
    table = "\n".join(lines)
    return f"```text\n{table}\n```\n\n{measures(motion.determinant, *motion.stretch)}"


def measures(determinant: float, low: float, high: float) -> str:
    """``determinant 0.512 · lengths ×0.8: contracts``"""
    if high < 1 - 1e-9:
        verdict = "contracts"
    elif low > 1 - 1e-9 and high < 1 + 1e-9:
        verdict = "keeps lengths"
    else:
        verdict = "doesn't contract everything"
    lengths = f"lengths ×{prose.number(high)}" if high - low < 1e-9 else f"lengths ×{prose.number(low)} to ×{prose.number(high)}"
    return f"determinant {prose.number(determinant)} · {lengths}: {verdict}"


def povray(statements: tuple[syntax.Statement, ...]) -> str:
    """The same as POV-Ray's modifiers, in their order."""
    found = []
    for statement in statements:
        if not isinstance(statement, syntax.Operation):
            continue
        arguments = [each.span.text for each in statement.arguments]
        match statement.name.name:
            case "rotx" | "roty" | "rotz" as name if len(arguments) == 1:
                vector = [arguments[0] if axis == name[3] else "0" for axis in "xyz"]
                found.append(f"rotate <{', '.join(vector)}>")
            case "scale" if len(arguments) == 1:
                found.append(f"scale {arguments[0]}")
            case "trans" | "scale" | "matrix" as name:
                found.append(POVRAY[name].format(", ".join(arguments)))
            case _:
                return ""
    return " ".join(reversed(found))


# --- colours


def colour(name: str) -> str:
    parts = vocabulary.COLOURS[name]
    numbers = ", ".join(map(prose.number, parts))
    form = "rgb" if len(parts) == 3 else "rgbft"
    return f"{swatch(parts)} {prose.code(f'{name} = {form} <{numbers}>')}"


def swatch(parts: list[float] | tuple[float, ...]) -> str:
    """An image of a colour of linear light, as Markdown."""
    code = "".join(f"{round(255 * prose.encoded(each)):02x}" for each in parts[:3])
    picture = f"<svg xmlns='http://www.w3.org/2000/svg' width='32' height='16'><rect width='32' height='16' fill='#{code}'/></svg>"
    escaped = picture.replace("#", "%23").replace("<", "%3C").replace(">", "%3E").replace(" ", "%20")
    return f"![#{code}](data:image/svg+xml;utf8,{escaped})"


def guard(found: GuardInsight) -> str:
    return f"**{prose.runs(found)}** on the longest path, {prose.times(found.total)} in the whole scene"
