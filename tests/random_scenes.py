"""Random scenes for hypothesis: source texts that end, stay small, and use every construct of the language.

`scenes()` is a strategy of texts. Every symbol counts `n` down along its recursion, so that each derivation ends; the
depth and the number of recursive terms are bounded so that a scene has at most a few thousand primitives.
"""

from __future__ import annotations

from hypothesis import strategies as st

PRIMITIVES = ["sphere", "cylinder", "box", "cone(0.5)", "cone(0)", "cone(1.5)", "torus(0.3)", "triangle", "square", "disc"]
COMPARISONS = ["<", "<=", ">", ">=", "==", "!="]

numbers = st.sampled_from(["0.3", "0.5", "0.8", "1", "1.25", "2"])
angles = st.sampled_from(["0", "15", "30", "45.5", "90", "-60", "137.5", "180"])


@st.composite
def values(draw, depth: int = 2) -> str:
    """An expression that is finite and between about 0.1 and 10."""
    if depth == 0:
        return draw(st.sampled_from(["p", "q", "unit", "rand(0)*0.5 + 0.5", "rand(1) + 0.25", "hash(n, 3) + 0.2", "0.7", "1.1"]))
    a, b = draw(values(depth - 1)), draw(values(depth - 1))
    form = draw(
        st.sampled_from(
            [
                "{a}",
                "clamp({a} + {b}, 0.2, 2)",
                "max({a}, 0.3)",
                "min({a}, {b})",
                "mix({a}, {b}, 0.25)",
                "clamp({a}/{b}, 0.1, 3)",
                "(n > 1 ? {a} : {b})",
                "(n == 2 || p > q ? {a} : {b})",
                "(n > 0 && !(p < q) ? {a} : {b})",
                "0.5 + abs(sin(30*{a}))",
                "0.6 + cos({b}*20)*0.3",
                "sqrt({a}*{a} + 0.1)",
                "exp(-{a}/5)",
                "0.4 + fraction*{a}",
                "pow({a} + 0.5, 0.5)",
                "floor({a}) + 0.5",
                "0.5 + (n % 2)*0.3",
                "log({a} + 2)",
            ]
        )
    )
    return form.format(a=a, b=b)


@st.composite
def step(draw) -> str:
    form = draw(
        st.sampled_from(
            [
                "trans {v} 0 {w}",
                "trans 0, -{n}, {v}",
                "rotx {a}",
                "roty {a}*{v}",
                "rotz {a}",
                "rot {a} 1 {n} 0.5",
                "scale {n}",
                "scale 0.9 {n} 0.8",
                "scale {v} 0.7 0.7",
                "scale 1 1 -1",
                "shear 0 0.3 0 0 0.1 0",
                "matrix 0.8 0 0  0.2 0.9 0  0 0 1  0.5 0 1",
            ]
        )
    )
    return form.format(v=draw(values(1)), w=draw(values(1)), n=draw(numbers), a=draw(angles))


@st.composite
def assignment(draw) -> str:
    target = draw(st.sampled_from(["p", "q"]))
    operator = draw(st.sampled_from(["=", "+=", "-=", "*=", "/="]))
    if operator == "=":
        return f"{target} = {draw(values(1))}"
    return f"{target} {operator} {draw(numbers)}"


@st.composite
def operators(draw, transformations: list[str], textures: list[str]) -> str:
    parts = []
    for _ in range(draw(st.integers(0, 2))):
        kind = draw(st.integers(0, 4))
        if kind == 0:
            parts.append(draw(st.sampled_from(transformations)))
        elif kind == 1:
            parts.append(f"[ {draw(step())} ]")
        elif kind == 2:
            parts.append(f"[ {draw(assignment())}; p = clamp(abs(p), 0.2, 3); q = clamp(abs(q), 0.2, 3); {draw(step())} ]")
        elif kind == 3:
            parts.append(draw(st.sampled_from(["C_change", "C_more"])))
        else:
            parts.append(draw(st.sampled_from(textures)))
    return " ".join(parts)


@st.composite
def bodies(draw, symbols: list[str], transformations: list[str], textures: list[str], recursive: bool) -> str:
    terms = []
    for i in range(draw(st.integers(1, 3))):
        prefix = draw(operators(transformations, textures))
        if recursive and i < 2 and draw(st.booleans()):
            symbol = draw(st.sampled_from(symbols))
            call = f"{symbol}(n - 1, {draw(values(0))})" if symbol == "Q" else symbol
            less = "C_less" if symbol != "Q" else ""
            terms.append(f"{prefix} {less} {call}")
        elif draw(st.integers(0, 4)) == 0:
            terms.append(f"{prefix} ({draw(st.sampled_from(PRIMITIVES))} + [ trans 0 0 1.5 ] {draw(st.sampled_from(PRIMITIVES))})")
        else:
            terms.append(f"{prefix} {draw(st.sampled_from(PRIMITIVES))}")
    return " + ".join(terms)


@st.composite
def productions(draw, name: str, symbols: list[str], transformations: list[str], textures: list[str]) -> str:
    def body(recursive: bool) -> str:
        return draw(bodies(symbols, transformations, textures, recursive))

    def rule(recursive: bool) -> str:
        kind = draw(st.integers(0, 3))
        if kind == 0:
            return f"{name} -> {draw(st.integers(1, 3))}: {body(recursive)} | {draw(st.sampled_from(['1', 'w', 'rand(2)']))}: {body(recursive)};"
        if kind == 1 and not recursive:
            return f"{name} -> ;"
        return f"{name} -> {body(recursive)};"

    chain = f"if (n > 0) {rule(True)}"
    if draw(st.booleans()):
        chain = f"if (n > 2) {rule(True)} else {chain}"
    if draw(st.integers(0, 2)) == 0:
        chain = f"if (n > 1) if (rand(3) {draw(st.sampled_from(COMPARISONS))} 0.5) {rule(True)} else {rule(True)} else {chain}"
    if draw(st.integers(0, 3)):
        chain += f" else {rule(False)}"
    return chain


@st.composite
def scenes(draw) -> str:
    """A whole scene's text with camera, light, objects, symbols S and R, and the parameterised symbol Q."""
    transformations = ["T_one", "T_two"]
    textures = ["X_age", "Plain"]
    symbols = ["S", "R", "Q"]
    depth = draw(st.integers(1, 3))
    variants = draw(st.sampled_from(["", "variants 4; ", "variants 1; "]))
    lines = [
        f"global_settings {{ assumed_gamma 1.0 seed {draw(st.integers(0, 99))} }}",
        "camera { location <3, -14, 6> sky <0, 0, 1> right <-4/3, 0, 0> look_at <0, 0, 1> angle 50 }",
        "light_source { <10, -20, 30> color rgb 1 }",
        f"Parameter depth = {depth} [0 to 5];",
        "Parameter unit = 0.9 [0.1 to 2] \"a length\";",
        "#declare fraction = 1/4;",
        "#declare w = 2;",
        "#declare Plain = texture { pigment { color rgb <0.8, 0.4, 0.3> } }",
        "Texture X_age { pigment { color rgb <0.1*n, 0.5, p/10> } finish { diffuse 0.7 } }",
        "object { S texture { Plain } }",
    ]
    if draw(st.booleans()):
        lines.append("object { Q(1, 0.8) translate <4, 0, 0> rotate <0, 0, 30> }")
    if draw(st.booleans()):
        lines.append("sphere { <-3, 0, 1>, 1.5 texture { Plain } }")
        lines.append("union { box { <-6, -1, 0>, <-5, 1, 2> } cylinder { <-6, 3, 0>, <-5, 3, 1>, 0.5 } scale 1.2 }")
    lines += [
        f"Selection S {{ C_start S; {draw(productions('S', symbols, transformations, textures))} }}",
        f"Selection R {{ {draw(productions('R', symbols, transformations, textures))} }}",
        f"Selection Q(n, p) {{ C_fill Q; {draw(productions('Q', ['Q'], transformations, textures))} }}",
        f"Calculation C_start {{ n = depth; p = 0.7; q = 1.2; {variants}}}",
        "Calculation C_fill { q = 0.9; }",
        "Calculation C_less { --n; }",
        f"Calculation C_change {{ p = clamp({draw(values(1))}, 0.2, 3); }}",
        f"Calculation C_more {{ q *= {draw(numbers)}; q = clamp(q, 0.2, 3); }}",
        f"Transformation T_one {{ {draw(step())}; {draw(step())}; }}",
        f"Transformation T_two {{ {draw(step())}; }}",
    ]
    return "\n".join(lines) + "\n"
