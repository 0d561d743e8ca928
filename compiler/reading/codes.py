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
}
