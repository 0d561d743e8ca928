"""The formatter: a tree-sitter tree without errors → the white space that its text should have.

    tree ─tokens.py▶ tokens with their roles ─layout.py▶ edits of the gaps between them (spacing.py: inside of a line)

Only white space between tokens changes, and never such that two tokens would be read as other ones, so a formatted text
means what it meant. The style in short: line breaks are the author's; four columns a level; one blank in a row and one
space between tokens, or more where the author aligns columns.

Example: ``format_tree(b"Calculation C{n=1;}", tree)`` inserts four spaces: ``Calculation C { n = 1; }``.
"""

from .layout import Edit, apply, format_tree

__all__ = ["Edit", "apply", "format_tree"]
