"""The elementary functions have the same bits for every optimisation level and instruction set."""

import ctypes
import platform
import subprocess

import native
import numpy as np
import pytest
from plsys.compiler import elementary
from plsys.compiler.bytecode.layout_rows import OPCODES

FLAGS = [("-O0",), ("-O1",), ("-O3",), ("-O3", "-funroll-loops"), ("-O3", "-march=native")]
if platform.machine() != "x86_64":
    FLAGS = FLAGS[:-1]


def arguments(count: int) -> list[np.ndarray]:
    chosen = np.random.default_rng(5)
    sizes = [
        chosen.uniform(-3, 3, 4000),
        chosen.uniform(-1000, 1000, 4000),
        np.exp(chosen.uniform(-700, 700, 4000)),
    ]
    return [chosen.permutation(np.concatenate(sizes)) for _ in range(count)]


@pytest.mark.parametrize("flags", FLAGS, ids=" ".join)
def test_same_bits(flags, tmp_path):
    library = tmp_path / "elementary.so"
    command = ["cc", "-std=gnu11", "-ffp-contract=off", "-fPIC", "-shared", *flags, f"-I{native.RUNTIME}"]
    command += [
        f"-I{native.RUNTIME / 'include'}",
        "-o",
        str(library),
        str(native.RUNTIME / "elementary.c"),
        "-lm",
    ]
    subprocess.run(command, check=True, capture_output=True)
    function = ctypes.CDLL(str(library)).pl_elementary_array
    function.argtypes = (ctypes.c_int, ctypes.c_size_t, *(ctypes.c_void_p,) * 4)
    for name in sorted(elementary.PURE):
        inputs = arguments(OPCODES[name].pops)
        out = np.empty_like(inputs[0])
        pointers = [a.ctypes.data for a in inputs] + [None] * (3 - len(inputs))
        function(OPCODES[name].id, out.size, *pointers, out.ctypes.data)
        expected = elementary.apply_array(name, *inputs)
        same = (out.view(np.uint64) == expected.view(np.uint64)) | (np.isnan(out) & np.isnan(expected))
        assert same.all(), name
