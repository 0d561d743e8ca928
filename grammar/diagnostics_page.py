"""DIAGNOSTICS.md: every code with its meaning, a scene that has the message, and the scene mended.

compiler/reading/codes.py + tests/cases/diagnostics/*.txt → the page's text. Neither is imported as part of the compiler, so
that nothing needs to be built for it.

Example: ``page()`` has a chapter ``## unused (warning)``.
"""

from __future__ import annotations

import re
import runpy
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FIXTURES = ROOT / "tests/cases/diagnostics"

HEAD = """\
<!-- Generated from compiler/reading/codes.py and tests/cases/diagnostics by generate.py; not edited. -->

# Messages

What `plsys check` and the language server say, by code. Each has a scene that is answered by the message, and the scene as
it should be. An **error** stops compilation; a **warning** is most likely a mistake; an **info** is worth knowing.

A comment silences warnings and infos on its own line, or, where it stands alone, on the next line:

```
// plsys-ignore: singular, unused
Transformation T_stem { matrix 0 0 0  0 0 0  0 0 0.16  0 0 0; }
```
"""


def page() -> str:
    codes = runpy.run_path(str(ROOT / "compiler/reading/codes.py"))["CODES"]
    lines = [HEAD]
    lines += [f"- [{code}](#{code}-{row.severity}): {row.summary}" for code, row in codes.items()]
    for code, row in codes.items():
        lines += ["", f"## {code} ({row.severity})", "", row.summary]
        path = FIXTURES / f"{code}.txt"
        if path.exists():
            lines += _example(path)
    return "\n".join(lines) + "\n"


def _example(path: Path) -> list[str]:
    parts = re.split(r"^==== (.*)\n", path.read_text(encoding="utf-8", errors="replace"), flags=re.MULTILINE)[1:]
    sections = dict(zip(parts[::2], parts[1::2]))
    lines = ["", *_code(sections["wrong"]), "", *_code(sections["messages"]), "", "Mended:", "", *_code(sections["right"])]
    fixes = [name.removeprefix("fix ") for name in sections if name.startswith("fix ")]
    if fixes:
        lines += ["", f"Quick fix: {'; '.join(fixes)}."]
    return lines


def _code(text: str) -> list[str]:
    return ["```", *text.rstrip("\n").split("\n"), "```"]
