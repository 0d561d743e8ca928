"""The queries in the words of each editor: queries/*.scm → queries/neovim, queries/helix, queries/emacs.

Editors agree on tree-sitter's query language and not on what captures are called. queries/*.scm use tree-sitter's own names
for highlights and Neovim's for the rest; here stands where the others differ. Emacs has no lists in predicates: they become
regular expressions.

Example: Helix has ``@constant.numeric`` where tree-sitter has ``@number``.
"""

from __future__ import annotations

import re
from pathlib import Path

QUERIES = Path(__file__).resolve().parent / "queries"
HEAD = "; Generated from ../{name} by ../../generate.py; not edited.\n\n"

NEOVIM = {
    "function.definition": "function",
    "property.builtin": "property",
}
HELIX = {
    "number": "constant.numeric",
    "keyword.conditional": "keyword.control.conditional",
    "type.definition": "type",
    "function.definition": "function",
    "function.call": "function",
    "property": "variable.other.member",
    "property.builtin": "variable.other.member",
    "indent.begin": "indent",
    "indent.branch": "outdent",
}
EMACS = {
    "comment": "font-lock-comment-face",
    "string": "font-lock-string-face",
    "number": "font-lock-number-face",
    "variable": "font-lock-variable-use-face",
    "variable.parameter": "font-lock-variable-name-face",
    "keyword": "font-lock-keyword-face",
    "keyword.conditional": "font-lock-keyword-face",
    "keyword.directive": "font-lock-preprocessor-face",
    "type": "font-lock-type-face",
    "type.definition": "font-lock-type-face",
    "type.builtin": "font-lock-builtin-face",
    "function.definition": "font-lock-function-name-face",
    "function.call": "font-lock-function-call-face",
    "function.builtin": "font-lock-builtin-face",
    "constant": "font-lock-constant-face",
    "constant.builtin": "font-lock-constant-face",
    "property": "font-lock-property-name-face",
    "property.builtin": "font-lock-property-name-face",
    "operator": "font-lock-operator-face",
    "punctuation.bracket": "font-lock-bracket-face",
    "punctuation.delimiter": "font-lock-delimiter-face",
}
# Patterns that an editor's vocabulary has no word for.
DROPPED = {"helix": ("indent.end", "indent.ignore")}

# Where what is special stands after what is general, editors have to be told.
NOTES = {
    (
        "emacs",
        "highlights",
    ): "; For treesit-font-lock-rules with :override t: the last pattern that fits a name counts.\n\n"
}

EDITORS = {
    "neovim": (NEOVIM, ("highlights", "folds", "indents", "locals")),
    "helix": (HELIX, ("highlights", "indents", "locals")),
    "emacs": (EMACS, ("highlights",)),
}

_CAPTURE = re.compile(r"@([a-z][\w.]*)")


def outputs(current: dict[str, str]) -> dict[Path, str]:
    """Every editor's query files with their texts. ``current`` has the texts of queries that aren't written yet."""
    found = {}
    for editor, (names, files) in EDITORS.items():
        for file in files:
            path = QUERIES / f"{file}.scm"
            text = current.get(path.name) or path.read_text(encoding="utf-8")
            text = translated(text, names, DROPPED.get(editor, ()))
            text = for_emacs(text) if editor == "emacs" else text
            note = NOTES.get((editor, file), "")
            found[QUERIES / editor / f"{file}.scm"] = HEAD.format(name=path.name) + note + text
    return found


def translated(text: str, names: dict[str, str], dropped: tuple[str, ...]) -> str:
    """``text`` with captures renamed, and without the lines of those that are dropped."""
    lines = [line for line in text.splitlines() if not any(line.endswith(f"@{name}") for name in dropped)]
    return _CAPTURE.sub(lambda match: f"@{names.get(match[1], match[1])}", "\n".join(lines)) + "\n"


def for_emacs(text: str) -> str:
    """Emacs' predicates: a regular expression first, then the capture."""

    def expression(match: re.Match[str]) -> str:
        words = r"\\|".join(re.findall(r'"([^"]*)"', match[2]))
        return rf'(#match "^\\(?:{words}\\)$" {match[1]})'

    text = re.sub(r'\(#eq\? (@[\w.-]+) ("[^"]*")\)', r"(#equal \1 \2)", text)
    return re.sub(r"\(#any-of\? (@[\w.-]+)\s+((?:\"[^\"]*\"\s*)+)\)", expression, text)
