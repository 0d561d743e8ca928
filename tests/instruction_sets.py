"""The instruction sets that accelerators have kernels for and that this machine has: each must give the same bits.

    for isa in available(data):
        with Scene(data, isa=isa) as scene: ...
"""

from __future__ import annotations

from plsys.runtime import PlsysRuntimeError, Scene

SETS = ("scalar", "avx2", "avx512")


def available(data: bytes) -> list[str]:
    """Those that a scene can be opened with here."""
    found = []
    for isa in SETS:
        try:
            Scene(data, isa=isa).close()
        except PlsysRuntimeError:
            continue
        found.append(isa)
    assert "scalar" in found
    return found
