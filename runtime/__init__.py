"""plsys.runtime: rays and pictures from bytecode. It knows the bytecode only, neither the language nor its compiler.

    >>> from plsys.runtime import Scene
    >>> with Scene(Path("tree.plsb").read_bytes()) as scene:
    ...     hits = scene.intersect(origins, directions)
    ...     image = scene.render(640, 480)["color"]

Every error is a PlsysRuntimeError with a place and a reason. NumPy is imported when arrays are first needed.
"""

from .errors import PlsysRuntimeError, RuntimeArgumentError
from .scene import Batch, Hits, Scene, disassemble, quantise

__all__ = ["Batch", "Hits", "PlsysRuntimeError", "RuntimeArgumentError", "Scene", "disassemble", "quantise"]
