"""Scene blocks, as POV-Ray 3.7 means them: cameras, lights, shapes, modifiers, textures."""

from __future__ import annotations

import pytest
from model_text import codes, good, objects, texture
from plsys.compiler.reading import affine
from plsys.compiler.reading.model import Paint, Prefixed, Primitive, Transform


def body(text: str) -> str:
    """The only object of a text."""
    (shown,) = objects(text)
    return shown.split(" ", 1)[1]


def paint(text: str) -> str:
    """The texture of a sphere with these modifiers."""
    operand = good(f"sphere {{ 0, 1 {text} }}").objects[0].body
    while not isinstance(operand.operator, Paint):
        operand = operand.operand
    return texture(operand.operator.texture)


def unit_image(text: str, *points: tuple) -> list[tuple]:
    """Where the map of a shape's block takes points of the unit shape."""
    operand = good(text).objects[0].body
    matrix = affine.IDENTITY
    while isinstance(operand, Prefixed):
        assert isinstance(operand.operator, Transform)
        matrix = affine.compose(matrix, affine.of_steps(operand.operator.steps))
        operand = operand.operand
    assert isinstance(operand, Primitive)
    return [
        tuple(round(value, 12) + 0.0 for value in affine.transform_point(matrix, point)) for point in points
    ]


def record(text: str, kind: str) -> dict:
    model = good(text)
    return dict(
        {"camera": model.camera, "settings": model.settings, "light": model.lights and model.lights[0]}[
            kind
        ].values
    )


# --- shapes


def test_sphere_and_box():
    assert body("sphere { <1, 2, 3>, 4 }") == "[trans 1 2 3; scale_uniform 4] sphere"
    assert body("sphere { 0, 1 }") == "sphere"
    assert body("box { <1, 5, 0>, <0, 2, 1> }") == "[trans 0 2 0; scale 1 3 1] box"


def test_cylinder_stands_between_its_points():
    text = "cylinder { <1, 2, 3>, <1, 5, 7>, 2 }"
    assert unit_image(text, (0, 0, 0), (0, 0, 1)) == [(1, 2, 3), (1, 5, 7)]
    rim = unit_image(text, (1, 0, 0))[0]
    assert affine.length(affine.difference(rim, (1, 2, 3))) == pytest.approx(2)
    assert sum(a * b for a, b in zip(affine.difference(rim, (1, 2, 3)), (0, 3, 4))) == pytest.approx(0)


def test_an_upright_cylinder_has_an_exact_matrix():
    assert body("cylinder { 0, 2*z, 3 }") == "[matrix 3 0 0 0 3 0 0 0 2 0 0 0] cylinder"


@pytest.mark.parametrize(("block", "thick", "thin"), [
    ("cone { 0, 2, <0, 0, 4>, 1 }", (0, 0, 0), (0, 0, 4)), ("cone { 0, 1, <0, 0, 4>, 2 }", (0, 0, 4), (0, 0, 0)),
])  # fmt: skip
def test_cone_with_its_thick_end_first(block, thick, thin):
    assert unit_image(block, (0, 0, 0), (0, 0, 1)) == [thick, thin]
    assert body(block).endswith("cone(0.5)")


def test_cone_of_equal_radii_is_a_cylinder():
    assert body("cone { 0, 2, 4*z, 2 }").endswith("cylinder")


def test_plane_torus_triangle_disc():
    assert unit_image("plane { <0, 0, -2>, 3 }", (0, 0, 0), (0, 0, 1)) == [(0, 0, -3), (0, 0, -4)]
    assert body("torus { 2, 0.5 }") == "[rotx 90; scale_uniform 2] torus(0.25)"
    assert unit_image("triangle { <1, 1, 1>, <2, 1, 1>, <1, 1, 3> }", (0, 0, 0), (1, 0, 0), (0, 1, 0)) == [
        (1, 1, 1), (2, 1, 1), (1, 1, 3),
    ]  # fmt: skip
    centre, above = unit_image("disc { <1, 0, 0>, <0, 5, 0>, 2 }", (0, 0, 0), (0, 0, 1))
    assert centre == (1, 0, 0) and above[1] > 0


def test_mesh_of_triangles():
    mesh = good("""mesh { triangle { 0, x, y } smooth_triangle { x, z, x + y, <0, 1, 1>, y, z } }""").meshes[
        0
    ]
    assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]
    assert mesh.triangles.tolist() == [[0, 1, 2], [1, 3, 2]]
    assert mesh.normals[mesh.normal_triangles[0]].tolist() == [[0, 0, 1]] * 3
    assert mesh.normals[mesh.normal_triangles[1]].tolist() == [[0, 0, 1], [0, 1, 1], [0, 0, 1]]


@pytest.mark.parametrize("block", [
    "sphere { 0, 0 }", "sphere { 0, -1 }", "box { 0, <1, 0, 1> }", "cylinder { 0, 0, 1 }", "cone { 0, 0, x, 0 }",
    "cone { 0, -1, x, 2 }", "plane { 0, 1 }", "torus { 1, 0 }", "triangle { 0, x, 2*x }", "disc { 0, 0, 1 }",
    "sphere { 0, 1 scale 0 }", "sphere { 0, 1 scale <1, 0, 1> }", "smooth_triangle { 0, 0, x, z, y, z }",
    "sphere { 0, 1 matrix <1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 0, 0> }", "camera { location z look_at z }",
    "camera { right 0 }", "camera { location 5*y look_at 0 }", "light_source { 0, 1 spotlight point_at 0 }",
])  # fmt: skip
def test_degenerate_things_are_errors(block):
    assert codes(block) == ["degenerate"]


# --- modifiers


def test_later_modifiers_are_outer():
    assert body("sphere { 0, 1 translate x rotate <10, 20, 30> scale <1, 2, 3> no_shadow }") == (
        "no_shadow [scale 1 2 3] [rotz 30; roty 20; rotx 10] [trans 1 0 0] sphere"
    )


def test_a_texture_stands_where_it_is_written():
    assert body("sphere { 0, 1 pigment { Red } translate x }") == "[trans 1 0 0] (0,1,0,0,0,0) sphere"
    assert body("sphere { 0, 1 translate x pigment { Red } }") == "(0,1,0,0,0,0) [trans 1 0 0] sphere"


def test_a_finish_joins_the_pigment_where_that_stands():
    assert (
        body("sphere { 0, 1 pigment { Red } translate x finish { phong 1 } }")
        == "[trans 1 0 0] (phong 1 | 0,1,0,0,0,0) sphere"
    )
    assert (
        body("sphere { 0, 1 finish { phong 1 } translate x pigment { Red } }")
        == "(phong 1 | 0,1,0,0,0,0) [trans 1 0 0] sphere"
    )


def test_a_unions_texture_is_round_those_inside():
    assert body("union { sphere { 0, 1 pigment { Red } } sphere { x, 1 } pigment { Blue } }") == (
        "(0,0,0,1,0,0) ((0,1,0,0,0,0) sphere + [trans 1 0 0] sphere)"
    )


def test_declared_objects_are_copied():
    text = "#declare S = sphere { 0, 1 pigment { Red } } object { S translate x } object { S finish { phong 1 } }"
    assert objects(text) == ["#0 [trans 1 0 0] (0,1,0,0,0,0) sphere", "#1 (phong 1 | 0,1,0,0,0,0) sphere"]


def test_layered_textures_are_an_error():
    text = "#declare T = texture { pigment { Red } } #declare S = sphere { 0, 1 texture { T } } object { S texture { T } }"
    assert codes(text) == ["unsupported"]


# --- textures


@pytest.mark.parametrize(("written", "entry"), [
    ("color rgb <1, 0.5, 0>", "0,1,0.5,0,0,0"), ("rgb 1", "0,1,1,1,0,0"), ("rgbf <1, 0, 0, 0.5>", "0,1,0,0,0.5,0"),
    ("rgbt <1, 0, 0, 0.5>", "0,1,0,0,0,0.5"), ("rgbft <1, 0, 0, 0.2, 0.3>", "0,1,0,0,0.2,0.3"),
    ("colour Red transmit 0.25", "0,1,0,0,0,0.25"), ("color Red filter 0.5", "0,1,0,0,0.5,0"),
    ("color red 0.5 blue 1", "0,0.5,0,1,0,0"), ("color <1, 0, 0>", "0,1,0,0,0,0"), ("rgb <1, 2, 3>*0.5", "0,0.5,1,1.5,0,0"),
    ("White*0.5", "0,0.5,0.5,0.5,0,0"), ("color 0.5", "0,0.5,0.5,0.5,0.5,0.5"), ("Clear", "0,1,1,1,1,0"),
])  # fmt: skip
def test_colours(written, entry):
    assert paint(f"pigment {{ {written} }}") == entry


def test_patterns():
    assert paint("pigment { checker color Red, color Blue }") == "pattern 1 | 0,1,0,0,0,0 0,0,0,1,0,0"
    assert paint("pigment { checker }") == "pattern 1 | 0,0,0,1,0,0 0,0,1,0,0,0"
    assert paint("pigment { gradient z color_map { [0.2 Red] [1 Blue] } }") == (
        "pattern 2 | direction 0 0 1 | 0.2,1,0,0,0,0 1,0,0,1,0,0"
    )
    assert paint("pigment { gradient x }") == "pattern 2 | direction 1 0 0 | 0,0,0,0,0,0 1,1,1,1,0,0"


def test_pattern_transformations_compose_outwards():
    shown = paint("texture { pigment { checker scale 2 translate x } scale <1, 2, 1> translate <0, 0, 3> }")
    assert "matrix 2 0 0 1 0 4 0 0 0 0 2 3" in shown


def test_textures_start_from_declared_ones():
    text = """#declare P = pigment { Red } #declare F = finish { ambient 0.3 diffuse 0.5 }
        #declare T = texture { pigment { P } finish { F phong 0.5 } }
        sphere { 0, 1 texture { T finish { diffuse 1 } } }"""
    assert body(text) == "(ambient 0.3 0.3 0.3 | diffuse 1 | phong 0.5 | 0,1,0,0,0,0) sphere"


def test_every_finish():
    shown = paint("""finish { ambient rgb <0.1, 0.2, 0.3> emission 0.1 diffuse 0.7 brilliance 2 phong 0.3 phong_size 60
        specular 0.4 roughness 0.01 reflection { 0.25 } }""")
    for value in (
        "ambient 0.1 0.2 0.3",
        "emission 0.1 0.1 0.1",
        "brilliance 2",
        "roughness 0.01",
        "reflection 0.25 0.25 0.25",
    ):
        assert value in shown
    assert shown.endswith("0,0,0,0,0,0")  # without a pigment: black


# --- camera, lights, settings


def test_camera():
    values = record(
        "camera { location <0, -14, 5> sky z right <-4/3, 0, 0> look_at <0, 0, 5> angle 45 }", "camera"
    )
    assert values == {
        "location": (0, -14, 5), "sky": (0, 0, 1), "right": (-4 / 3, 0, 0), "look_at": (0, 0, 5), "has_look_at": (1,),
        "angle": (45,),
    }  # fmt: skip


@pytest.mark.parametrize("late", ["location 0", "sky z", "direction y", "right x", "up z"])
def test_camera_order(late):
    assert codes(f"camera {{ location -5*z look_at x {late} }}") == ["wrong-order"]


@pytest.mark.parametrize("angle", ["0", "180", "-20", "200"])
def test_camera_angle_out_of_range(angle):
    assert codes(f"camera {{ location -5*z look_at 0 angle {angle} }}") == ["wrong-value"]


def test_lights():
    assert record("light_source { <1, 2, 3>, White }", "light") == {"location": (1, 2, 3), "color": (1, 1, 1)}
    values = record(
        "light_source { y*3 color rgb 0.5 spotlight point_at x radius 5 falloff 10 tightness 2 translate z }",
        "light",
    )
    assert values["location"] == (0, 3, 1) and values["point_at"] == (1, 0, 1)
    assert values["spotlight"] == (1,)
    both = record("light_source { y*3 color rgb 0.5 spotlight point_at x shadowless }", "light")
    assert both["shadowless"] == (1,) and "spotlight" not in both  # as in POV-Ray, the last of the two counts
    assert record("light_source { 5*y, rgb 1 parallel fade_distance 3 fade_power 2 }", "light")[
        "fade_power"
    ] == (2,)


def test_settings():
    values = record(
        "global_settings { assumed_gamma 1 max_trace_level 3 adc_bailout 0.1 ambient_light rgb 2 seed 9 } background { Red }",
        "settings",
    )
    assert values == {
        "max_trace_level": (3,),
        "adc_bailout": (0.1,),
        "ambient_light": (2, 2, 2),
        "seed": (9,),
        "background": (1, 0, 0),
    }
    assert record("global_settings { seed 9 } sphere { 0, 1 }", "settings") == {"seed": (9,)}


def test_names_in_blocks():
    text = (
        "Parameter h = 3; #declare V = <1, 2, 3>; #declare C = rgb V/4; sphere { V*2 + h*z, h pigment { C } }"
    )
    assert body(text) == "(0,0.25,0.5,0.75,0,0) [trans 2 4 9; scale_uniform 3] sphere"


def test_a_parameter_has_no_value_in_a_block():
    assert codes("Calculation C { a = 1; } Selection A { A -> C cone(a); } object { A } sphere { 0, a }") == [
        "wrong-kind"
    ]
    assert codes(
        "Texture L { pigment { rgb a } } Selection A { A -> [ a = 1 ] L disc; } object { A texture { L } }"
    ) == ["wrong-kind"]
