"""What code does to a scope: values, parameters, matrices, textures, draws; and what it says if it can't."""

import math

import native
import pytest
from assembly import IDENTITY, NONE, Assembly, one_of_everything
from plsys.compiler import elementary
from plsys.compiler.bytecode.layout_rows import OPCODES

SCENE_ERROR = 2  # pl_error_code
KEY = 0x0123456789ABCDEF


class Answer:
    """The probe's lines by their first word."""

    def __init__(self, text: str) -> None:
        lines = dict(line.split(" ", 1) if " " in line else (line, "") for line in text.splitlines())
        for name in ("values", "matrix", "texture", "parameters"):
            setattr(self, name, [float(word) for word in lines[name].split()])
        self.key, self.draws, self.child = int(lines["key"]), int(lines["draws"]), int(lines["child"])


def ask(tmp_path, a: Assembly, node: int = 1, **parameters):
    file = tmp_path / "scene.plsb"
    file.write_bytes(a.bytes())
    assignments = [f"{name}={value!r}" for name, value in parameters.items()]
    return native.probe("run", file, node, KEY, *assignments)


def answer(tmp_path, a: Assembly, node: int = 1, **parameters) -> Answer:
    done = ask(tmp_path, a, node, **parameters)
    assert done.returncode == 0, done.stdout + done.stderr
    return Answer(done.stdout)


def reason(tmp_path, a: Assembly, node: int = 1, **parameters) -> str:
    done = ask(tmp_path, a, node, **parameters)
    assert done.returncode == 2, done.stdout + done.stderr
    assert done.stdout.startswith(f"error {SCENE_ERROR} ")
    return done.stdout.split(" ", 2)[2].strip()


def node(kind: str, text: str, parameters=("n", "m"), place=(3, 5, 3, 9), **fields) -> Assembly:
    """An object above one node with this code."""
    a = Assembly(list(parameters), file="a.plsys")
    a.node("object", name="", ordinal=0, child=1)
    fields = {"name": "Op", "child": 2, "code": a.code(text), **fields}
    if kind == "branch":
        fields |= {"test": fields["code"], "then": 2, "otherwise": 3}
    if kind == "texture":
        fields["texture"] = a.record("texture", ((0, 1, 1, 1, 0, 0),))
    a.node(kind, place, **fields)
    a.node("empty")
    a.node("empty")
    return a


def calculate(text: str, **fields) -> Assembly:
    return node("calculate", text, **fields)


# --- values ---


@pytest.mark.parametrize("name", sorted(elementary.PURE))
def test_pure_opcodes_have_the_library_s_bits(tmp_path, name):
    arguments = (0.625, 0.25, 0.75)[: OPCODES[name].pops]
    code = "; ".join(f"const {value}" for value in arguments)
    result = answer(tmp_path, calculate(f"{code}; {name}; store n; end"))
    assert result.parameters[0] == elementary.apply(name, *arguments)


def test_assignments_see_those_before_them(tmp_path):
    a = calculate("load n; const 1; subtract; store n; load n; const 2; multiply; store m; end")
    assert answer(tmp_path, a, n=5).parameters == [4, 8]


@pytest.mark.parametrize(("n", "expected"), [(0.0, 7.0), (3.0, 2.0), (-1.0, 2.0)])
def test_jumps_choose_what_is_evaluated(tmp_path, n, expected):
    a = calculate("load n; jump_if_zero 4; const 2; jump 2; const 7; store m; end")
    assert answer(tmp_path, a, n=n).parameters[1] == expected


@pytest.mark.parametrize(("n", "child"), [(1.0, 2), (-0.5, 2), (0.0, 3), (-0.0, 3)])
def test_branches_take_zero_as_false(tmp_path, n, child):
    assert answer(tmp_path, node("branch", "load n; end"), n=n).child == child


def test_a_primitive_s_code_leaves_its_arguments(tmp_path):
    assert answer(tmp_path, node("primitive", "load n; end", shape="cone"), n=0.3).values == [0.3]


def test_textures_are_set_by_value(tmp_path):
    a = node("texture", "load n; texture_set 22; const 0.5; texture_set 32; end", draws=0)
    texture = answer(tmp_path, a, n=0.9).texture
    assert texture[22] == 0.9 and texture[32] == 0.5


# --- matrices ---

SIN30 = 0.5
COS30 = elementary.cos(30.0)
STEPS = {
    "trans": ((1, 2, 3), (1, 0, 0, 1, 0, 1, 0, 2, 0, 0, 1, 3)),
    "rotx": ((30,), (1, 0, 0, 0, 0, COS30, -SIN30, 0, 0, SIN30, COS30, 0)),
    "roty": ((30,), (COS30, 0, SIN30, 0, 0, 1, 0, 0, -SIN30, 0, COS30, 0)),
    "rotz": ((30,), (COS30, -SIN30, 0, 0, SIN30, COS30, 0, 0, 0, 0, 1, 0)),
    "scale": ((2, 3, 4), (2, 0, 0, 0, 0, 3, 0, 0, 0, 0, 4, 0)),
    "scale_uniform": ((2,), (2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0)),
    "shear": ((1, 2, 3, 4, 5, 6), (1, 1, 2, 0, 3, 1, 4, 0, 5, 6, 1, 0)),
    "matrix": (tuple(range(1, 13)), (1, 4, 7, 10, 2, 5, 8, 11, 3, 6, 9, 12)),
}


def transformation(*steps: tuple[str, tuple]) -> Assembly:
    code = "; ".join("; ".join(f"const {value}" for value in values) + f"; {name}" for name, values in steps)
    return node("transform_code", code + "; end")


@pytest.mark.parametrize("name", STEPS)
def test_each_step(tmp_path, name):
    arguments, matrix = STEPS[name]
    assert answer(tmp_path, transformation((name, arguments))).matrix == list(matrix)


@pytest.mark.parametrize("name", STEPS)
def test_steps_multiply_on_the_right(tmp_path, name):
    arguments, step = STEPS[name]
    first = STEPS["matrix"][1]
    result = answer(tmp_path, transformation(("matrix", STEPS["matrix"][0]), (name, arguments))).matrix
    for r in range(3):
        for c in range(4):
            exact = sum(first[4 * r + k] * step[4 * k + c] for k in range(3)) + (
                first[4 * r + 3] if c == 3 else 0
            )
            assert result[4 * r + c] == pytest.approx(exact, rel=1e-15)


def test_right_angles_are_permutations(tmp_path):
    assert answer(tmp_path, transformation(("roty", (90,)))).matrix == [0, 0, 1, 0, 0, 1, 0, 0, -1, 0, 0, 0]


@pytest.mark.parametrize(
    ("axis", "same"), [((5, 0, 0), "rotx"), ((0, 1e-200, 0), "roty"), ((0, 0, 1e200), "rotz")]
)
def test_rot_about_an_axis_of_any_length(tmp_path, axis, same):
    result = answer(tmp_path, transformation(("rot", (30, *axis)))).matrix
    assert result == pytest.approx(list(STEPS[same][1]), abs=1e-16)


def test_rot_about_the_diagonal_turns_the_axes_round(tmp_path):
    result = answer(tmp_path, transformation(("rot", (120, 1, 1, 1)))).matrix
    assert result == pytest.approx([0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0], abs=1e-15)


def test_without_code_the_matrix_is_the_identity(tmp_path):
    a = node("transform_code", "end", code=NONE)
    assert answer(tmp_path, a).matrix == list(IDENTITY)


# --- random numbers ---


def test_draws_count_by_stream(tmp_path):
    a = calculate(
        "const 3; rand; store a; const 0; rand; store b; const 3; rand; store c; end",
        parameters=("a", "b", "c"),
    )
    result = answer(tmp_path, a)
    three, zero = elementary.bits(3.0), elementary.bits(0.0)
    assert result.parameters == [elementary.rand(KEY, *draw) for draw in ((three, 0), (zero, 0), (three, 1))]
    assert result.draws == 3 and result.key == KEY


def test_minus_zero_is_zero_s_stream(tmp_path):
    a = calculate("const 0; negate; rand; store n; const 0; rand; store m; end")
    stream = elementary.bits(0.0)
    assert answer(tmp_path, a).parameters == [
        elementary.rand(KEY, stream, 0),
        elementary.rand(KEY, stream, 1),
    ]


def test_hash_depends_on_seed_and_arguments_only(tmp_path):
    a = calculate("load n; const 2; hash 2; store m; end")
    a.record("settings", seed=7)
    result = answer(tmp_path, a, n=1.5)
    assert result.parameters[1] == elementary.hash(elementary.seed_key(7), 1.5, 2.0) and result.draws == 0


def test_variants_share_keys(tmp_path):
    a = calculate("const 4; variants Oak; end")
    a.record("settings", seed=7)
    named = elementary.mix(elementary.seed_key(7), elementary.name_hash("Oak"))
    assert answer(tmp_path, a).key == elementary.mix(named, KEY % 4)


def test_objects_symbols_and_terms_make_keys(tmp_path):
    a = one_of_everything()
    tree = elementary.name_hash("Tree")
    started = answer(tmp_path, a, 1, n=1, angle=2)
    assert started.key == elementary.mix(elementary.mix(elementary.seed_key(7), tree), 0)
    assert all(map(math.isnan, started.parameters))
    assert answer(tmp_path, a, 6).key == elementary.mix(KEY, tree)
    assert answer(tmp_path, a, 10).key == elementary.term_key(KEY, 1)


def choice(*weights: str) -> Assembly:
    a = Assembly(["n"], file="a.plsys")
    a.node("object", name="", ordinal=0, child=1)
    cases = tuple((a.code(weight + "; end"), 2 + i) for i, weight in enumerate(weights))
    a.node("choose", (3, 5, 3, 9), cases=cases)
    for _ in weights:
        a.node("empty")
    return a


def test_choices_follow_the_weights(tmp_path):
    draw = elementary.rand(KEY, elementary.CHOICE_STREAM, 0)
    result = answer(tmp_path, choice("const 1", "const 0", "load n", "const 1"), n=3.0)
    expected = next(2 + i for i, s in enumerate((1, 1, 4, 5)) if s > draw * 5)
    assert result.child == expected and result.draws == 1
    assert answer(tmp_path, choice("const 0", "const 2", "const 0")).child == 3


def test_weights_that_draw_draw_once(tmp_path):
    result = answer(tmp_path, choice("const 1; rand", "const 1; rand"))
    first, second = (elementary.rand(KEY, elementary.bits(1.0), i) for i in (0, 1))
    draw = elementary.rand(KEY, elementary.CHOICE_STREAM, 0)
    assert result.child == (2 if first > draw * (first + second) else 3)
    assert result.draws == 3


# --- errors ---

VALUES = "(n = 0, m = 2.5)"
ERRORS = {
    "unset": (calculate("load n; store m; end"), "Op: the parameter n is read before it has a value"),
    "infinity": (
        calculate("const 1; load n; divide; store m; end"),
        f"the parameter m would become infinity {VALUES}",
    ),
    "minus-infinity": (calculate("load n; log; store m; end"), "the parameter m would become -infinity"),
    "nan": (calculate("load n; load n; divide; store m; end"), f"the parameter m would become NaN {VALUES}"),
    "stream": (calculate("load n; log; rand; store m; end"), "argument 1 of rand is -infinity"),
    "hash": (calculate("load m; load n; load n; divide; hash 2; store m; end"), "argument 2 of hash is NaN"),
    "variants-0": (
        calculate("load n; variants A; end"),
        "variants needs a whole number from 1 to 4294967296, not 0",
    ),
    "variants-part": (calculate("load m; variants A; end"), "not 2.5"),
    "zero-axis": (node("transform_code", "load m; load n; load n; load n; rot; end"), "rot needs an axis"),
    "angle": (node("transform_code", "load n; load n; divide; roty; end"), "argument 1 of roty is NaN"),
    "matrix": (
        node("transform_code", "const 1e200; scale_uniform; const 1e200; scale_uniform; end"),
        "the transformation's matrix isn't finite",
    ),
    "scale": (node("transform_code", "load n; load n; divide; scale_uniform; end"), "argument 1 of scale is NaN"),
    "guard": (node("branch", "load n; load n; divide; end"), "the condition is NaN"),
    "argument": (node("primitive", "load n; log; end", shape="cone"), "argument 1 of cone is -infinity"),
    "colour": (
        node("texture", "load n; log; texture_set 32; end", draws=0),
        "the texture's red would become -infinity",
    ),
    "finish": (
        node("texture", "load n; log; texture_set 22; end", draws=0),
        "the texture's diffuse would become",
    ),
    "negative-weight": (choice("const 1", "load n; const 1; subtract"), "a weight is -1"),
    "no-weight": (choice("load n", "load n"), "the weights' sum is 0"),
}


@pytest.mark.parametrize("case", ERRORS)
def test_errors_name_place_operator_and_values(tmp_path, case):
    a, expected = ERRORS[case]
    values = {} if case == "unset" else {"n": 0.0, "m": 2.5}
    text = reason(tmp_path, a, **values)
    assert text.startswith("a.plsys:3:5: ") and expected in text
