"""Words for people: numbers, what the vocabulary says about a name, and what the forecast found.

Rows of the vocabulary and insights → short texts or Markdown. Features share this and nothing else.

Example::

    count(2049, "cylinder")             # '2,049 cylinders'
    forecast(insight)                   # '2,049 cylinders · depth 13 · ×0.8–1 per level'
"""

from __future__ import annotations

import math
from typing import Iterable

from plsys.compiler.analysis import GuardInsight, Insight, SymbolInsight, ValueInsight, vocabulary

Row = vocabulary.Row
PLURALS = {"box": "boxes", "torus": "tori", "mesh": "meshes"}
MANY = 10**12
KINDS_SHOWN = 3
ANGLES = frozenset(("rotx", "roty", "rotz"))

# What people call the kinds of a scene's names.
KINDS = {
    "selection": "Selection",
    "calculation": "Calculation",
    "transformation": "Transformation",
    "texture": "texture",
    "pigment": "pigment",
    "finish": "finish",
    "color_map": "colour map",
    "object": "object",
    "value": "constant",
    "input": "Parameter",
    "parameter": "parameter",
}


def number(value: float) -> str:
    """Four digits: ``0.2``, ``1.234e+07``, ``360``."""
    text = f"{value + 0.0:.4g}"
    return "0" if text == "-0" else text


def whole(value: int) -> str:
    """``2,049``, and ``2.1e+301`` where nobody would read the digits."""
    if abs(value) < MANY:
        return f"{value:,}"
    digits = str(value) if value.bit_length() < 10_000 else ""
    if not digits:
        return f"10^{value.bit_length() * math.log10(2):,.0f}"
    return f"{digits[0]}.{digits[1]}e+{len(digits) - 1}"


def noun(kind: str, plural: bool) -> str:
    return PLURALS.get(kind, kind + "s") if plural else kind


def count(value: int, kind: str) -> str:
    return f"{whole(value)} {noun(kind, value != 1)}"


def between(low: int | None, high: int | None) -> str:
    """``3``, ``1–3``, ``at least 1``."""
    if low is None:
        return "endless"
    if high is None:
        return f"at least {whole(low)}"
    return whole(low) if low == high else f"{whole(low)}–{whole(high)}"


def times(ends: tuple[int | None, int | None]) -> str:
    return "without end" if ends[0] is None else "once" if ends == (1, 1) else f"{between(*ends)} times"


# --- insights


def primitives(found: SymbolInsight) -> str:
    """``2,049 cylinders``, ``63 cones, 190 spheres``, ``1–3 primitives, about 2.1``."""
    low, high = found.primitives
    if low is None:
        return "primitives without end"
    kinds = list(found.kinds.items())
    if low != high:
        kind = kinds[0][0] if len(kinds) == 1 else "primitive"
        about = f", about {number(found.expected)}" if found.expected is not None else ""
        return f"{between(low, high)} {noun(kind, True)}{about}"
    if low == 0:
        return "nothing"
    if len(kinds) > KINDS_SHOWN or any(a != b for _, (a, b) in kinds):
        return count(low, "primitive")
    return ", ".join(count(a, kind) for kind, (a, _) in kinds)


def scale(found: SymbolInsight) -> str:
    """``×0.80 per level``, '' where nothing changes."""
    if found.scale is None:
        return ""
    low, high = (f"{value:.3g}" for value in found.scale)
    if low == high:
        return "" if low == "1" else f"×{_factor(found.scale[0])} per level"
    return f"×{_factor(found.scale[0])}–{_factor(found.scale[1])} per level"


def _factor(value: float) -> str:
    """Three digits, and two places at least: ``0.80``, ``0.985``."""
    short = f"{value:.3g}"
    return f"{value:.2f}" if len(short) < 4 and 0.01 <= value < 10 else short


def forecast(found: SymbolInsight) -> str:
    """``2,049 cylinders · depth 13 · ×0.80–1.00 per level``: of the largest instance of a symbol."""
    parts = [primitives(found) if found.alike else f"up to {primitives(found)}"]
    if found.depth is not None and found.depth > 1:
        parts.append(f"depth {found.depth:,}")
    if scale(found):
        parts.append(scale(found))
    if found.instances[1] != 1:
        parts.append(times(found.instances))
    return " · ".join(parts)


def runs(found: GuardInsight) -> str:
    """``runs 10×``"""
    if found.path is None:
        return "runs without end"
    exact = found.total[0] == found.total[1]
    return f"runs {'' if exact else 'up to '}{found.path:,}×"


def values(found: ValueInsight) -> str:
    """``56° → 20°``, ``18° … 32°`` where only bounds are known, '' where nothing changes. Shares are percentages."""
    unit = "°" if found.name in ANGLES and found.kind == "argument" else ""
    factor = 1.0
    if found.kind == "share":
        unit, factor = " %", 100.0
    first, last, low, high = (
        number(factor * each) + unit if math.isfinite(each) else ""
        for each in (found.first, found.last, found.low, found.high)
    )
    if low == high:
        return low if found.kind == "share" else ""
    if found.certain and first != last:
        return f"{first} → {last}"
    return f"{low} … {high}"


def parameter(found: Iterable[Insight]) -> str:
    """``parameter, from 20 to 60``: of the values that are known of it."""
    known = [each for each in found if isinstance(each, ValueInsight)]
    if not known:
        return "parameter"
    low, high = min(each.low for each in known), max(each.high for each in known)
    return f"parameter, from {number(low)} to {number(high)}" if low != high else f"parameter, always {number(low)}"


# --- the vocabulary


def documentation(row: Row) -> str:
    """Markdown: signature, meaning, facts, example."""
    parts = [code(row.signature), row.doc]
    if facts(row):
        parts.append(facts(row))
    if row.example:
        parts.append("Example:\n" + code(row.example))
    return "\n\n".join(parts)


def facts(row: Row) -> str:
    """``degrees · above 0 and below 180 · default 45 · POV-Ray: `angle` ``"""
    found = []
    if row.type and row.type not in ("block", "flag"):
        found.append(row.type)
    if row.unit:
        found.append(row.unit)
    if row.range is not None:
        found.append(str(row.range))
    if row.default is not None and row.type != "flag":
        found.append(f"default {default(row.default)}")
    if row.povray and row.povray != row.name:
        found.append(f"POV-Ray: `{row.povray}`")
    return " · ".join(found)


def default(value: object) -> str:
    if isinstance(value, list | tuple):
        return f"<{', '.join(number(each) for each in value)}>"
    return number(value) if isinstance(value, int | float) else str(value)


def code(text: str) -> str:
    return f"```plsys\n{text}\n```"


# --- colours


def encoded(value: float) -> float:
    """A component of linear light as sRGB shows it (IEC 61966-2-1), both in [0, 1]."""
    value = max(0.0, min(1.0, value))
    return 12.92 * value if value <= 0.0031308 else 1.055 * value ** (1 / 2.4) - 0.055


def decoded(value: float) -> float:
    """The inverse of :func:`encoded`."""
    value = max(0.0, min(1.0, value))
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4
