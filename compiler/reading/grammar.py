"""The compiled grammar: UTF-8 bytes → tree-sitter tree.

``libgrammar.so`` is ``grammar/src/parser.c`` compiled, and stands beside the compiler's Python files. It is
loaded at the first parse, so that importing this module costs nothing.

Example::

    tree = syntax_tree(b"camera { location <0, 1, 2> }")
    tree.root_node.children[0].type      # 'block'
"""

from __future__ import annotations

import ctypes
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from .diagnostics import PlsysError

if TYPE_CHECKING:
    from tree_sitter import Language, Parser, Tree

LIBRARY = Path(__file__).resolve().parent.parent / "libgrammar.so"


@cache
def language() -> Language:
    """The grammar as tree-sitter's Language. Raises PlsysError when the library isn't built."""
    from tree_sitter import Language

    try:
        library = ctypes.CDLL(str(LIBRARY))
    except OSError as error:
        raise PlsysError(
            f"the compiled grammar can't be loaded ({error}); 'make dev' builds it", str(LIBRARY)
        ) from None
    library.tree_sitter_plsys.restype = ctypes.c_void_p
    new_capsule = ctypes.pythonapi.PyCapsule_New
    new_capsule.restype = ctypes.py_object
    new_capsule.argtypes = (ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p)
    return Language(new_capsule(library.tree_sitter_plsys(), b"tree_sitter.Language", None))


@cache
def _parser() -> Parser:
    from tree_sitter import Parser

    return Parser(language())


def syntax_tree(data: bytes, old: Tree | None = None) -> Tree:
    """The syntax tree of ``data``, the same whether ``old`` is given or not. ``old``, the tree of an earlier text with
    ``Tree.edit`` applied for every change since, lets the parser read again only what changed."""
    parser = _parser()
    if old is not None:
        tree = parser.parse(data, old)
        if not tree.root_node.has_error:
            return tree
        # How tree-sitter gets over an error depends on what it could reuse: what is said must not.
    return parser.parse(data)
