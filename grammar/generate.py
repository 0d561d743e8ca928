"""Writes what follows from vocabulary.toml and other tables: the compiler's rows, references, editors' queries.

vocabulary.toml → ../compiler/reading/vocabulary_rows.py · REFERENCE.md · the lists in queries/highlights.scm
codes and their fixtures → DIAGNOSTICS.md (diagnostics_page.py)
queries/*.scm → queries/neovim, queries/helix, queries/emacs (editor_queries.py)

    python grammar/generate.py            write them
    python grammar/generate.py --check    compare: exit code 1 and the names of stale files
"""

from __future__ import annotations

import pprint
import re
import sys
import tomllib
from pathlib import Path

import diagnostics_page
import editor_queries

HERE = Path(__file__).resolve().parent
BEGIN, END = "; generated from vocabulary.toml: begin", "; generated from vocabulary.toml: end"

# Kinds of rows in the reference's order, with their headings.
CHAPTERS = (
    ("keyword", "Reserved words"),
    ("directive", "Other definitions"),
    ("primitive", "Primitives"),
    ("operation", "Operations"),
    ("function", "Functions"),
    ("constant", "Constants"),
    ("axis", "Axes"),
    ("block", "Scene blocks"),
    ("modifier", "Modifiers"),
    ("colourword", "Words of colours"),
)
ROW_KINDS = tuple(kind for kind, _ in CHAPTERS)

# Which names a highlighter shows as what (tree-sitter's capture names).
HIGHLIGHTS = (
    ("@constant.builtin", ("constant",)),
    ("@function.builtin", ("function", "operation")),
    ("@type.builtin", ("primitive", "block")),
    ("@property.builtin", ("property", "modifier", "colourword")),
)
# Properties mean something in blocks only: elsewhere a parameter may be called `angle`, and `scale` is an operation.
IN_BLOCKS = "[(block_body (name) {}) (map_entry (name) {}) (declare value: (name) {})]"


def load(path: Path = HERE / "vocabulary.toml") -> dict:
    """The table as TOML gives it. Raises tomllib.TOMLDecodeError and OSError."""
    return tomllib.loads(path.read_text(encoding="utf-8"))


def flat_rows(table: dict) -> dict[str, dict]:
    """Every row by its key: 'primitive.sphere', 'property.camera.angle'."""
    rows = {f"{kind}.{name}": row for kind in ROW_KINDS for name, row in table.get(kind, {}).items()}
    for block, properties in table["property"].items():
        rows |= {f"property.{block}.{name}": row for name, row in properties.items()}
    return rows


def python_rows(table: dict) -> str:
    """compiler/reading/vocabulary_rows.py: literals only, so that it imports in no time."""

    def literal(value) -> str:
        return pprint.pformat(value, width=110, sort_dicts=False)

    colours = {name: [float(part) for part in parts] for name, parts in table["colour"].items()}
    unsupported = {name: group["hint"] for group in table["unsupported"] for name in group["names"]}
    return "\n".join((
        '"""The vocabulary\'s rows; generated from grammar/vocabulary.toml by grammar/generate.py, not edited."""',
        "",
        f"ROWS: dict[str, dict] = {literal(flat_rows(table))}",
        "",
        f"COLOURS: dict[str, list[float]] = {literal(colours)}",
        "",
        f"UNSUPPORTED: dict[str, str] = {literal(unsupported)}",
        "",
        f"UNSUPPORTED_DIRECTIVES: dict[str, str] = {literal(table['unsupported_directives'])}",
        "",
        f"SYNONYMS: dict[str, str] = {literal(table['synonyms'])}",
        "",
        f"STOCK_INCLUDES: dict[str, object] = {literal(table['stock_includes'])}",
        "",
    ))  # fmt: skip


def describe(key: str, row: dict, level: str) -> list[str]:
    """One row of the reference."""
    lines = [f"{level} `{row['signature']}`", "", row["doc"], ""]
    facts = [f"{name}: {row[name]}" for name in ("type", "unit", "range") if row.get(name)]
    if "default" in row:
        default = row["default"]
        shown = f"<{', '.join(f'{x:.6g}' for x in default)}>" if isinstance(default, list) else default
        shown = f"{shown:.6g}" if isinstance(shown, float) else shown
        facts.append(f"default: {shown}")
    if row.get("povray"):
        facts.append(f"POV-Ray: `{row['povray']}`")
    if facts:
        lines += [" · ".join(facts), ""]
    if row["example"]:
        lines += ["```", row["example"], "```", ""]
    return lines


def reference(table: dict) -> str:
    """REFERENCE.md: the rules of the language (reference_rules.md), then every row."""
    lines = ["<!-- Generated from vocabulary.toml and reference_rules.md by generate.py; not edited. -->", ""]
    lines += [(HERE / "reference_rules.md").read_text(encoding="utf-8").rstrip(), "", "# Vocabulary", ""]
    for kind, title in CHAPTERS:
        lines += [f"## {title}", ""]
        for name, row in table[kind].items():
            lines += describe(f"{kind}.{name}", row, "###")
            if kind == "block":
                for name_, property_ in table["property"].get(name, {}).items():
                    lines += describe(f"property.{name}.{name_}", property_, "####")
    lines += ["## Colour names", "", "Those of POV-Ray's colors.inc:", ""]
    for name, value in table["colour"].items():
        lines.append(f"- {name} `<{', '.join(f'{x:g}' for x in value)}>`")
    lines += ["", "## What POV-Ray has and plsys doesn't", ""]
    lines.append("Each of these names is an error that says so, never ignored.")
    lines.append("")
    for group in table["unsupported"]:
        lines.append(f"- {' '.join(f'`{name}`' for name in group['names'])}: {group['hint']}.")
    by_hint: dict[str, list[str]] = {}
    for name, hint in table["unsupported_directives"].items():
        by_hint.setdefault(hint, []).append(f"`#{name}`")
    lines += [f"- {' '.join(names)}: {hint}." for hint, names in by_hint.items()]
    stock = table["stock_includes"]
    lines.append(f"- `colors.inc`: {stock['colors']}. Other stock include files: {stock['default']}.")
    return "\n".join(lines) + "\n"


def highlights(table: dict, current: str) -> str:
    """``current``, the text of highlights.scm, with the lists between the markers renewed."""
    lines = [BEGIN]
    for capture, kinds in HIGHLIGHTS:
        groups = [
            group
            for kind in kinds
            for group in (table[kind].values() if kind == "property" else (table[kind],))
        ]
        names = dict.fromkeys(name for group in groups for name in group)
        place = "(name) {}" if "property" not in kinds else IN_BLOCKS
        lines += [
            f"({place.replace('{}', capture)}",
            f"  (#any-of? {capture}",
            *(f'    "{name}"' for name in names),
            "  ))",
        ]
    lines += ["((name) @constant.builtin", "  (#any-of? @constant.builtin"]
    lines += [*(f'    "{name}"' for name in table["colour"]), "  ))", END]
    return re.sub(f"{re.escape(BEGIN)}.*?{re.escape(END)}", lambda _: "\n".join(lines), current, flags=re.S)


def outputs() -> dict[Path, str]:
    """Every generated file with the text that it should have."""
    table = load()
    files = {
        HERE.parent / "compiler/reading/vocabulary_rows.py": python_rows(table),
        HERE / "REFERENCE.md": reference(table),
        HERE / "DIAGNOSTICS.md": diagnostics_page.page(),
    }
    queries = HERE / "queries/highlights.scm"
    if queries.exists():
        files[queries] = highlights(table, queries.read_text(encoding="utf-8"))
    return files | editor_queries.outputs(
        {path.name: text for path, text in files.items() if path == queries}
    )


def main(arguments: list[str]) -> int:
    stale = []
    for path, text in outputs().items():
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            stale.append(path)
            if "--check" not in arguments:
                path.parent.mkdir(exist_ok=True)
                path.write_text(text, encoding="utf-8")
    if "--check" in arguments and stale:
        print("stale, run `python grammar/generate.py`:", *(p.relative_to(HERE.parent) for p in stale))
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
