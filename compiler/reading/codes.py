"""The registry of diagnostic codes: one row a code, used by every part that reports, documents or tests one."""

from __future__ import annotations

from typing import NamedTuple


class Code(NamedTuple):
    severity: str  # error | warning | info
    summary: str  # what it means, one sentence


CODES: dict[str, Code] = {
    # syntax
    "syntax": Code("error", "The text doesn't follow the grammar here."),
    "unclosed": Code("error", "A bracket, string or comment is never closed."),
    "missing": Code("error", "Something required, such as ';' or '->', is missing."),
    "assignment-in-condition": Code("error", "'=' stands where '==' compares."),
    "encoding": Code("error", "The file isn't UTF-8 text."),
    # names
    "unknown-name": Code("error", "A name that nothing defines."),
    "duplicate-name": Code("error", "A name that is defined twice, or that the vocabulary already has."),
    "wrong-kind": Code("error", "A name of one kind stands where another kind is needed."),
    "wrong-arguments": Code("error", "Too few, too many or unfit arguments."),
    "wrong-value": Code("error", "A value of the wrong type or out of its range."),
    # scene blocks
    "unsupported": Code("error", "A POV-Ray feature that plsys doesn't have."),
    "wrong-order": Code("error", "An order of items that would change the picture in POV-Ray."),
    "include": Code("error", "An include file that is missing, can't be read, or includes itself."),
    # what the semantic checks find
    "not-finite": Code("error", "A division by zero, or another expression without a finite value."),
    "unreachable-rule": Code("error", "A rule that stands after one that always applies."),
    "degenerate": Code("error", "A shape or transformation without extent."),
    "file": Code("error", "A mesh file that is missing or can't be read."),
    "weights": Code("error", "Weights that are negative or all zero."),
    "unassigned": Code("error", "A parameter that is read before anything assigns it."),
    "maybe-unassigned": Code("warning", "A parameter that is read before it is assigned on some path."),
    "endless": Code("error", "A recursion that can't end."),
    "counter": Code("warning", "A recursion whose guard reads nothing that the recursion changes."),
    "identity-cycle": Code("error", "A recursion that changes nothing on its way."),
    "steps-over": Code("warning", "A counter that steps over the one value that its guard waits for."),
    "unproven": Code("info", "A recursion of which no proof was found that it ends."),
    "diverging": Code("warning", "A recursion without a bound that makes things larger with every round."),
    "slow-contraction": Code(
        "info", "A recursion without a bound that makes things hardly smaller with every round."
    ),
    "no-rule": Code("warning", "A Selection of which no rule can apply."),
    "constant-guard": Code("warning", "A guard that is always true or always false."),
    "singular": Code(
        "warning", "A constant transformation that flattens what it acts on; its subtree is dropped."
    ),
    "unused": Code("warning", "A definition that nothing uses."),
    "unreachable": Code("warning", "A Selection that no object leads to."),
    "random-loop": Code("info", "A recursion that ends with some probability only."),
    "float-equality": Code("info", "An exact comparison of numbers that may be rounded."),
    "no-camera": Code("info", "A scene without a camera can't be rendered."),
    "no-object": Code("info", "A scene without an object has nothing to show."),
    "no-light": Code("info", "A scene without a light shows ambient light only."),
    "camera-inside": Code("warning", "A camera inside of a shape in which no light is."),
    "colour-range": Code("info", "A colour whose components look like 0 to 255 instead of 0 to 1."),
    "radians": Code("info", "An angle that looks like radians; angles are degrees."),
    # what the derivation meets, and limits
    "limit": Code("error", "A limit of the bytecode: values at a time, or draws in one application."),
    "depth-limit": Code(
        "error", "A path of the derivation that enters more symbols than the forecast follows."
    ),
    "state-limit": Code("info", "More states than the forecast counts."),
    "expansion": Code("info", "A scene that has too many primitives to be written out for another program."),
    # comments to the compiler
    "ignore": Code("warning", "A `plsys-ignore` comment that names no warning or info."),
}
