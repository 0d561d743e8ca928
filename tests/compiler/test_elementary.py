"""The elementary functions against 200-bit arithmetic, their exact values and special cases; the random
functions against the published test vectors and a second implementation in plain Python."""

import doctest
import math
import random
import struct
import subprocess
import sys
import tomllib
from pathlib import Path

import mpmath
import numpy as np
import pytest
from plsys.compiler import elementary

ROOT = Path(__file__).resolve().parents[2]
RANDOM = tomllib.loads((ROOT / "runtime" / "bytecode.toml").read_text())["random"]
LARGEST_ERROR = 0.501
"""In units in the last place; as runtime/elementary.h states it."""

mp = mpmath.mp.clone()
mp.prec = 200
POINTS = 9000  # a function; eleven of them make 1e5


def ulp_of(exact) -> object:
    """The distance of doubles around an exact number."""
    _, exponent = mp.frexp(exact)
    return mp.ldexp(1, max(exponent - 53, -1074))


def error_of(result: float, exact) -> float:
    """|result - exact| in units in the last place. Overflow begins half an ulp above the largest double."""
    if math.isinf(result):
        return 0.0 if abs(exact) >= mp.ldexp(mp.mpf(2) - mp.ldexp(1, -53), 1023) else math.inf
    return float(abs(mp.mpf(result) - exact) / ulp_of(exact))


def degrees(function):
    """sin, cos, tan of degrees; math.fmod is exact."""
    return lambda a: function(mp.mpf(math.fmod(a, 360)) * mp.pi / 180)


def anywhere(chosen: random.Random) -> float:
    """Doubles of every size, both signs."""
    return math.ldexp(chosen.choice((-1, 1)) * (1 + chosen.random()), chosen.randint(-1074, 1023))


def near(value: float, chosen: random.Random) -> float:
    """A few ulps from a value that matters."""
    for _ in range(chosen.randint(0, 3)):
        value = math.nextafter(value, chosen.choice((-math.inf, math.inf)))
    return value


def angle(chosen: random.Random) -> float:
    return chosen.choice(
        (
            lambda: chosen.uniform(-360, 360),
            lambda: chosen.uniform(-1e6, 1e6),
            lambda: near(chosen.randint(-40, 40) * 45.0, chosen),
            lambda: near(chosen.randint(-100, 100) * 15.0, chosen),
            lambda: near(chosen.randint(-90, 90) / 2.0, chosen),
            lambda: anywhere(chosen),
        )
    )()


def sine(chosen: random.Random) -> float:
    small = math.ldexp(1 + chosen.random(), chosen.randint(-1074, -1))
    return chosen.choice(
        (chosen.uniform(-1, 1), small, 1 - small, -1 + small, near(0.5, chosen), near(0.7, chosen))
    )


def exponent(chosen: random.Random) -> float:
    return chosen.choice(
        (chosen.uniform(-746, 710), chosen.uniform(-1, 1), chosen.uniform(-745.2, -707), anywhere(chosen))
    )


def positive(chosen: random.Random) -> float:
    return chosen.choice(
        (abs(anywhere(chosen)), near(1.0, chosen), chosen.uniform(0.5, 2), chosen.uniform(1, 1e6))
    )


def power(chosen: random.Random) -> tuple[float, float]:
    base = positive(chosen)
    size = chosen.uniform(-750, 720)
    by_result = size / math.log(base) if base != 1 else size  # any result in range, denormal ones too
    return base, chosen.choice((by_result, by_result, chosen.uniform(-5, 5), float(chosen.randint(-20, 20))))


def point(chosen: random.Random) -> tuple[float, float]:
    return chosen.choice(
        (
            lambda: (chosen.uniform(-1, 1), chosen.uniform(-1, 1)),
            lambda: (anywhere(chosen), anywhere(chosen)),
            lambda: (near(chosen.randint(-16, 16) / 16, chosen), chosen.choice((-1.0, 1.0))),
            lambda: (chosen.choice((-1.0, 1.0)), near(chosen.randint(1, 16) / 16, chosen)),
        )
    )()


def to_degrees(x):
    return x * 180 / mp.pi


FUNCTIONS = {
    "sin": (angle, degrees(mp.sin)),
    "cos": (angle, degrees(mp.cos)),
    "tan": (angle, degrees(mp.tan)),
    "asin": (sine, lambda a: to_degrees(mp.asin(a))),
    "acos": (sine, lambda a: to_degrees(mp.acos(a))),
    "atan2": (point, lambda y, x: to_degrees(mp.atan2(mp.mpf(y), mp.mpf(x)))),
    "exp": (exponent, lambda a: mp.exp(a)),
    "log": (positive, lambda a: mp.log(a)),
    "pow": (power, lambda a, b: mp.power(mp.mpf(a), mp.mpf(b))),
    "sqrt": (positive, lambda a: mp.sqrt(a)),
    "mix": (lambda chosen: (0.0, chosen.uniform(-9, 9), chosen.random()), lambda a, b, t: mp.mpf(b) * t),
}


def is_tested_elsewhere(name: str, a: float, *_) -> bool:
    """Exact results, which mpmath's rounded pi misses, and limits."""
    if name in ("sin", "cos", "tan"):
        return math.fmod(a, 90) == 0
    return (name == "atan2" and a == 0) or (name == "exp" and abs(a) > 1000)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_error_stays_below_what_the_header_states(name):
    draw, exact_function = FUNCTIONS[name]
    chosen = random.Random(name)
    worst, where = 0.0, None
    for _ in range(POINTS):
        arguments = draw(chosen)
        arguments = arguments if isinstance(arguments, tuple) else (arguments,)
        if is_tested_elsewhere(name, *arguments):
            continue
        result = elementary.apply(name, *arguments)
        if (error := error_of(result, exact_function(*arguments))) > worst:
            worst, where = error, (arguments, result)
    assert worst <= LARGEST_ERROR, f"{name}{where[0]} = {where[1]!r} is wrong by {worst} ulp"


@pytest.mark.parametrize("turn", range(-8, 9))
def test_right_angles_are_exact(turn):
    angle_deg = 90.0 * turn
    sines, cosines = (0, 1, 0, -1), (1, 0, -1, 0)
    assert elementary.sin(angle_deg) == sines[turn % 4]
    assert elementary.cos(angle_deg) == cosines[turn % 4]
    if turn % 2 == 0:
        assert elementary.tan(angle_deg) == 0
    else:
        assert elementary.tan(angle_deg) == math.copysign(math.inf, sines[turn % 4])


def test_familiar_angles_are_exact():
    assert elementary.sin(30.0) == 0.5 and elementary.sin(150.0) == 0.5 and elementary.sin(-30.0) == -0.5
    assert elementary.cos(60.0) == 0.5 and elementary.cos(120.0) == -0.5 and elementary.cos(-60.0) == 0.5
    assert [elementary.tan(a) for a in (45.0, -45.0, 135.0, 225.0)] == [1, -1, -1, 1]
    assert elementary.asin(0.5) == 30 and elementary.acos(0.5) == 60 and elementary.acos(-0.5) == 120
    assert elementary.asin(1.0) == 90 and elementary.acos(-1.0) == 180 and elementary.acos(0.0) == 90
    assert [elementary.atan2(y, x) for y, x in ((1, 1), (1, -1), (-1, -1), (-1, 1))] == [45, 135, -135, -45]
    assert elementary.sin(1e22) == elementary.sin(math.fmod(1e22, 360))


def test_symmetries_hold_bit_for_bit():
    chosen = random.Random(1)
    for _ in range(2000):
        a = angle(chosen)
        assert elementary.sin(-a) == -elementary.sin(a)
        assert elementary.cos(-a) == elementary.cos(a)
        assert elementary.tan(-a) == -elementary.tan(a)


def test_powers_of_whole_numbers_are_exact():
    for base, exponent_ in ((2, 10), (10, 22), (3, 33), (-2, 9), (-5, 3), (7, 18), (0.5, 30)):
        assert elementary.pow(base, exponent_) == base**exponent_
    assert elementary.pow(2.0, -1074.0) == 5e-324


INF, NAN = math.inf, math.nan
POW_CASES = [  # C17, F.10.4.4
    ((NAN, 0.0), 1.0),
    ((1.0, NAN), 1.0),
    ((-1.0, INF), 1.0),
    ((-1.0, -INF), 1.0),
    ((0.0, -3.0), INF),
    ((-0.0, -3.0), -INF),
    ((-0.0, -2.0), INF),
    ((0.0, -INF), INF),
    ((-0.0, 3.0), -0.0),
    ((-0.0, 2.0), 0.0),
    ((0.5, -INF), INF),
    ((2.0, -INF), 0.0),
    ((0.5, INF), 0.0),
    ((2.0, INF), INF),
    ((-INF, -3.0), -0.0),
    ((-INF, -2.0), 0.0),
    ((-INF, 3.0), -INF),
    ((-INF, 2.0), INF),
    ((INF, -1.0), 0.0),
    ((INF, 1.0), INF),
    ((-8.0, 1 / 3), NAN),
    ((NAN, 2.0), NAN),
    ((2.0, NAN), NAN),
    ((-3.0, 2.0**53), INF),
    ((-2.0, 1025.0), -INF),
    ((-2.0, -1075.0), -0.0),
]
CASES = [
    *((("pow", *arguments), result) for arguments, result in POW_CASES),
    (("exp", INF), INF),
    (("exp", -INF), 0.0),
    (("exp", NAN), NAN),
    (("exp", 710.0), INF),
    (("exp", -746.0), 0.0),
    (("exp", 0.0), 1.0),
    (("log", 0.0), -INF),
    (("log", -1.0), NAN),
    (("log", INF), INF),
    (("log", 1.0), 0.0),
    (("sin", INF), NAN),
    (("sin", -0.0), -0.0),
    (("cos", NAN), NAN),
    (("tan", -INF), NAN),
    (("asin", 1.5), NAN),
    (("acos", -1.5), NAN),
    (("atan2", 0.0, -1.0), 180.0),
    (("atan2", -0.0, -1.0), -180.0),
    (("atan2", -0.0, 1.0), -0.0),
    (("atan2", 1.0, 0.0), 90.0),
    (("atan2", INF, INF), 45.0),
    (("atan2", -INF, -INF), -135.0),
    (("atan2", 1.0, -INF), 180.0),
    (("atan2", NAN, 1.0), NAN),
    (("modulo", 7.5, 2.0), 1.5),
    (("modulo", -7.5, 2.0), -1.5),
    (("modulo", 1e308, 3.0), math.fmod(1e308, 3.0)),
    (("modulo", 1.0, 0.0), NAN),
    (("divide", 1.0, 0.0), INF),
    (("round", 2.5), 3.0),
    (("round", -2.5), -3.0),
    (("round", 0.49999999999999994), 0.0),
    (("round", -0.2), -0.0),
    (("round", 4503599627370497.0), 4503599627370497.0),
    (("floor", -0.5), -1.0),
    (("ceil", -0.5), -0.0),
    (("sign", -3.0), -1.0),
    (("sign", -0.0), 0.0),
    (("abs", -3.0), 3.0),
    (("clamp", 5.0, 0.0, 1.0), 1.0),
    (("clamp", -5.0, 0.0, 1.0), 0.0),
    (("mix", 2.0, 4.0, 0.25), 2.5),
    (("min", 1.0, 2.0), 1.0),
    (("max", 1.0, 2.0), 2.0),
    (("add", 0.1, 0.2), 0.1 + 0.2),
    (("subtract", 1.0, 3.0), -2.0),
    (("multiply", 3.0, 0.5), 1.5),
    (("negate", 3.0), -3.0),
    (("not", 0.0), 1.0),
    (("not", 2.0), 0.0),
    (("bool", -2.0), 1.0),
    (("less", 1.0, 2.0), 1.0),
    (("less_equal", 2.0, 2.0), 1.0),
    (("greater", 1.0, 2.0), 0.0),
    (("greater_equal", 1.0, 2.0), 0.0),
    (("equal", 1.0, 1.0), 1.0),
    (("not_equal", 1.0, 1.0), 0.0),
]


@pytest.mark.parametrize(
    ("call", "expected"), CASES, ids=lambda value: str(value) if isinstance(value, tuple) else ""
)
def test_single_values(call, expected):
    result = elementary.apply(*call)
    if math.isnan(expected):
        assert math.isnan(result)
    else:
        assert struct.pack("<d", result) == struct.pack("<d", expected), result


def test_every_pure_opcode_is_tried_somewhere():
    tried = {call[0] for call, _ in CASES} | set(FUNCTIONS)
    assert elementary.PURE - tried == set()


def test_arrays_have_the_bits_of_single_numbers_and_broadcast():
    a = np.linspace(-5, 5, 7)
    b = np.array([[0.5], [2.0]])
    result = elementary.apply_array("atan2", a, b)
    assert result.shape == (2, 7) and result.dtype == np.float64
    assert result.tolist() == [[elementary.atan2(float(y), float(x)) for y in a] for x in b[:, 0]]
    assert elementary.sin(a[::-2]).tolist() == [elementary.sin(float(v)) for v in a[::-2]]


def test_wrong_calls_are_errors():
    with pytest.raises(KeyError):
        elementary.apply("rand", 1.0)
    with pytest.raises(TypeError, match="pow takes 2 arguments, not 1"):
        elementary.apply("pow", 1.0)
    with pytest.raises(TypeError, match="1 to 16"):
        elementary.hash(1)


def test_scalar_use_does_not_import_numpy():
    code = "from plsys.compiler import elementary as e, sys; e.sin(1.0); e.rand(1, 2, 3); e.hash(1, 2.0)"
    code = f"import sys; {code.replace(', sys', '')}; print('numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout == "False\n", done.stderr


def test_documentation_examples():
    assert doctest.testmod(elementary).failed == 0


# --- random numbers: plain Python beside the library ---


def finalize(z):
    mask = 2**64 - 1
    z = (z ^ (z >> 30)) * RANDOM["finalize_1"] & mask
    z = (z ^ (z >> 27)) * RANDOM["finalize_2"] & mask
    return z ^ (z >> 31)


def plain_mix(k, x):
    mask = 2**64 - 1
    return finalize(
        finalize(x + RANDOM["mix_add_x"] & mask) ^ (k * RANDOM["mix_mul_k"] + RANDOM["mix_add_k"] & mask)
    )


def plain_name_hash(name):
    h = 0xCBF29CE484222325
    for byte in name.encode():
        h = (h ^ byte) * 0x100000001B3 % 2**64
    return h


def plain_bits(a):
    return struct.unpack("<Q", struct.pack("<d", a + 0.0))[0]


def plain_unit(x):
    return (x >> 11) * 2.0**-53


def plain_seed_key(seed):
    return plain_mix(plain_name_hash("plsys"), plain_bits(seed))


def plain_rand(key, stream, ordinal):
    return plain_unit(plain_mix(plain_mix(key, plain_bits(stream)), ordinal))


def plain_hash(seed, *arguments):
    h = plain_mix(plain_seed_key(seed), plain_name_hash("hash"))
    for a in arguments:
        h = plain_mix(h, plain_bits(a))
    return plain_unit(h)


PLAIN = {
    "mix": plain_mix,
    "name_hash": plain_name_hash,
    "bits": plain_bits,
    "seed_key": plain_seed_key,
    "rand": plain_rand,
    "hash": plain_hash,
}
LIBRARY = {
    "mix": elementary.mix,
    "name_hash": elementary.name_hash,
    "bits": elementary.bits,
    "seed_key": elementary.seed_key,
    "rand": lambda key, stream, ordinal: elementary.rand(key, elementary.bits(stream), ordinal),
    "hash": lambda seed, *arguments: elementary.hash(elementary.seed_key(seed), *arguments),
}


def number(text):
    """Vectors write keys as hexadecimal text, because TOML's integers are signed."""
    return int(text, 16) if isinstance(text, str) and text.startswith("0x") else text


@pytest.mark.parametrize("vector", RANDOM["vector"], ids=lambda v: f"{v['function']}{v['arguments']}")
def test_vectors(vector):
    arguments = [number(a) for a in vector["arguments"]]
    assert PLAIN[vector["function"]](*arguments) == number(vector["result"])
    assert LIBRARY[vector["function"]](*arguments) == number(vector["result"])


def test_arrays_of_keys_have_the_bits_of_single_ones():
    keys = np.array([0, 1, 2**64 - 1, 0x0123456789ABCDEF], dtype=np.uint64)
    values = np.array([0.0, -0.0, 1.5, -1e300])
    assert elementary.mix(keys, keys[::-1]).tolist() == [
        plain_mix(int(k), int(x)) for k, x in zip(keys, keys[::-1])
    ]
    assert elementary.bits(values).tolist() == [plain_bits(v) for v in values]
    assert elementary.unit(keys).tolist() == [plain_unit(int(k)) for k in keys]
    assert elementary.rand(keys, 5, 2).tolist() == [elementary.rand(int(k), 5, 2) for k in keys]
    assert elementary.hash(9, values, 2.0).tolist() == [elementary.hash(9, v, 2.0) for v in values]
    assert elementary.term_key(keys, np.arange(4)).tolist() == [
        elementary.term_key(int(k), i) for i, k in enumerate(keys)
    ]


def test_draws_are_uniform_and_streams_independent():
    n = 100_000
    keys = np.full(n, elementary.seed_key(3), dtype=np.uint64)
    first, second = (elementary.rand(keys, elementary.bits(k), np.arange(n)) for k in (0.0, 1.0))
    assert first.min() >= 0 and first.max() < 1
    assert abs(first.mean() - 0.5) < 4 * math.sqrt(1 / 12 / n)
    assert abs(np.corrcoef(first, second)[0, 1]) < 4 / math.sqrt(n)
    assert abs(np.corrcoef(first[1:], first[:-1])[0, 1]) < 4 / math.sqrt(n)
