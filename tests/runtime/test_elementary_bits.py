"""The elementary functions have the same bits for every optimisation level and instruction set."""

import ctypes
import platform
import subprocess
from pathlib import Path

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


def library(flags: tuple[str, ...], folder: Path) -> ctypes.CDLL:
    path = folder / "elementary.so"
    command = ["cc", "-std=gnu11", "-ffp-contract=off", "-fPIC", "-shared", *flags, f"-I{native.RUNTIME}"]
    command += [
        f"-I{native.RUNTIME / 'include'}",
        "-o",
        str(path),
        str(native.RUNTIME / "elementary.c"),
        "-lm",
    ]
    subprocess.run(command, check=True, capture_output=True)
    return ctypes.CDLL(str(path))


@pytest.mark.parametrize("flags", FLAGS, ids=" ".join)
def test_same_bits(flags, tmp_path):
    function = library(flags, tmp_path).pl_elementary_array
    function.argtypes = (ctypes.c_int, ctypes.c_size_t, *(ctypes.c_void_p,) * 4)
    for name in sorted(elementary.PURE):
        inputs = arguments(OPCODES[name].pops)
        out = np.empty_like(inputs[0])
        pointers = [a.ctypes.data for a in inputs] + [None] * (3 - len(inputs))
        function(OPCODES[name].id, out.size, *pointers, out.ctypes.data)
        expected = elementary.apply_array(name, *inputs)
        same = (out.view(np.uint64) == expected.view(np.uint64)) | (np.isnan(out) & np.isnan(expected))
        assert same.all(), name


def test_sine_and_cosine_together_have_the_bits_of_each_alone(tmp_path):
    """Which are computed without the instructions that the two together use where there are any."""
    both = library(("-O2",), tmp_path).pl_sin_cos
    angles = np.concatenate([arguments(1)[0], np.arange(-720.0, 721.0, 7.5), [0.0, -0.0, 1e-300]])
    sine, cosine = ctypes.c_double(), ctypes.c_double()
    found = []
    for angle in angles:
        both(ctypes.c_double(angle), ctypes.byref(sine), ctypes.byref(cosine))
        found.append((sine.value, cosine.value))
    for name, column in zip(("sin", "cos"), np.array(found).T):
        np.testing.assert_array_equal(column.view(np.uint64), getattr(elementary, name)(angles).view(np.uint64))
