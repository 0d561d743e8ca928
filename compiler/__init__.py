"""The compiler: a scene's text → bytecode.

``compile`` is the whole way; ``plsys.compiler.pipeline.build`` gives what lies between (model, graph, diagnostics).
Importing this package costs next to nothing: the work is imported when it is done.

Example::

    import plsys.compiler
    bytecode = plsys.compiler.compile("scenes/tree.plsys", parameters={"order": 12})
"""

from __future__ import annotations

TYPE_CHECKING = (
    False  # type checkers take it for True; importing typing would cost more than all of this package
)
if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

__all__ = ["PlsysError", "SceneError", "compile"]


def compile(
    path_or_text: str | Path,
    parameters: Mapping[str, float] | None = None,
    seed: float | None = None,
    *,
    name: str = "<text>",
    sourcemap: bool = True,
) -> bytes:
    """The bytecode of a scene: a file's path, or its text (a str with a line break or a brace in it).

    ``parameters`` sets the scene's ``Parameter`` inputs by name; ``seed`` replaces the seed of its global_settings;
    ``name`` is what messages call a text; without ``sourcemap`` the bytecode is smaller, but the runtime's messages
    have no places. Raises SceneError, with every diagnostic, for a scene with errors, and PlsysError for a file that
    can't be read or a scene that exceeds the bytecode's limits."""
    from .pipeline import build
    from .reading.source import Source

    is_text = isinstance(path_or_text, str) and any(c in path_or_text for c in "\n{")
    scene = Source.from_text(path_or_text, name) if is_text else path_or_text
    return build(scene, parameters, seed).encode(sourcemap)


def __getattr__(attribute: str) -> object:
    if attribute in ("PlsysError", "SceneError"):
        from .reading import diagnostics

        return getattr(diagnostics, attribute)
    raise AttributeError(f"module {__name__!r} has no attribute {attribute!r}")
