"""Shadow and reflected rays start at the surface, at any size and place: no surface shadows itself, however grazing the light,
and nothing shines through (numerics: origins off the surface by their own rounding error, not by an epsilon of the world)."""

from __future__ import annotations

import numpy as np
import pytest

from plsys.compiler import compile
from plsys.runtime import Scene

SIZE = (120, 90)
WHITE = "texture { pigment { color rgb 1 } finish { ambient 0 diffuse 1 } }"
MIRROR = "texture { pigment { color rgb 1 } finish { ambient 0 diffuse 0.5 reflection 0.5 } }"

# A tree with spheres on a box: many shadows, of many levels of transformations.
PLANT = """
Selection Top { Top -> T_put T_ground box + T_put [ n = 5 ] Tree; }
Selection Tree
{
    if (n > 0) Tree -> T_stem cylinder + T_left C_down Tree + T_right C_down Tree;
    else       Tree -> T_berry sphere;
}
Calculation    C_down   { --n; }
Transformation T_stem   { scale 0.15 0.15 1; }
Transformation T_berry  { scale 0.25 0.25 0.25; }
Transformation T_ground { trans -4 -4 -0.3; scale 8 8 0.3; }
Transformation T_left   { trans 0 0 1; scale 0.75 0.75 0.75; rotz 70; roty 35; }
Transformation T_right  { trans 0 0 1; scale 0.75 0.75 0.75; rotz 50; roty -30; }
"""

# A ball and a post over a floor, n levels below the root.
DEEP = """
Selection Top {{ Top -> [ n = {levels} ] Chain; }}
Selection Chain {{ if (n > 0) Chain -> T_step C_down Chain; else Chain -> T_floor box + T_ball sphere + T_post cylinder; }}
Calculation    C_down  {{ --n; }}
Transformation T_step  {{ trans 1 0 0; scale {scale!r} {scale!r} {scale!r}; }}
Transformation T_floor {{ trans -2 -2 -0.2; scale 4 4 0.2; }}
Transformation T_ball  {{ trans 0 0 0.6; scale 0.5 0.5 0.5; }}
Transformation T_post  {{ trans 1 0.5 0; scale 0.1 0.1 1; }}
"""


def vector(point) -> str:
    return "<" + ", ".join(f"{float(x):.17g}" for x in point) + ">"


def stage(scale: float, origin, eye, target, light, angle: float) -> str:
    """Camera and light, given in units of `scale` around `origin`."""
    eye, target, light = (vector(scale * np.array(p, float) + origin) for p in (eye, target, light))
    return (
        f"camera {{ location {eye} sky <0, 0, 1> right <-4/3, 0, 0> look_at {target} angle {angle} }}\n"
        f"light_source {{ {light} color rgb 1 }}\n"
    )


def picture(text: str) -> tuple[np.ndarray, np.ndarray]:
    """(light, primitive) of each pixel."""
    with Scene(compile(text)) as scene:
        image = scene.render(*SIZE, channels=("color", "primitive"))
    return image["color"][..., 0], image["primitive"]


def plant(scale: float, move, texture: str = WHITE) -> str:
    put = "Transformation T_put { trans %.17g %.17g %.17g; scale %.17g %.17g %.17g; }\n" % (*move, scale, scale, scale)
    view = stage(scale, np.array(move, float), (3, -8, 5), (0, 0, 1.5), (6, -5, 9), 50)
    return view + PLANT + put + f"object {{ Top {texture} }}\n"


@pytest.mark.parametrize("texture", [WHITE, MIRROR], ids=["shadows", "mirrors"])
@pytest.mark.parametrize(
    "scale, move",
    [(1e-6, (0, 0, 0)), (1e6, (0, 0, 0)), (1, (1e6, -1e6, 1e6)), (1e6, (1e6, -1e6, 1e6)), (1e-6, (1, 1, 1)), (1e-3, (1e6, -1e6, 1e6))],
)
def test_shadows_are_the_same_at_any_size_and_place(scale, move, texture):
    here, which = picture(plant(1, (0, 0, 0), texture))
    there, same = picture(plant(scale, move, texture))
    alike = which == same
    assert alike.mean() > 0.99  # the others are on edges, where rounding decides
    assert 0.02 < np.mean(here[which >= 0] == 0) < 0.9 or texture == MIRROR
    other = np.mean(np.abs(there - here) > 1e-3, where=alike)
    # Round mirrors enlarge the rounding of coordinates; shadows don't.
    assert other < 1e-3 if texture == MIRROR else other == 0


@pytest.mark.parametrize("scale, levels", [(1 / 3, 8), (1 / 3, 16), (0.8, 32), (0.8, 64), (0.5, 30), (0.99, 1000)])
def test_shadows_deep_in_a_recursion(scale, levels):
    def view(n: int) -> str:
        size, place = scale**n, sum(scale**k for k in range(n))
        text = stage(size, np.array([place, 0, 0]), (3, -8, 5), (0, 0, 0.5), (6, -5, 9), 40)
        return text + DEEP.format(levels=n, scale=scale) + f"object {{ Top {WHITE} }}\n"

    (here, which), (there, same) = picture(view(0)), picture(view(levels))
    alike = which == same
    assert alike.mean() > 0.99
    assert np.mean((here > 0) != (there > 0), where=alike) < 1e-3


@pytest.mark.parametrize("elevation", [1e-2, 1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize("tilt", [0.0, 0.8, 1.4])
def test_no_facet_shadows_itself_however_grazing_the_light(tilt, elevation):
    """Smooth normals, tilted towards the light, say nothing of how flat its rays leave the facet."""
    for seed, (scale, move) in enumerate([(1.0, (0, 0, 0)), (1e-6, (0, 0, 0)), (1e6, (0, 0, 0)), (1.0, (1e4, -1e4, 1e4))]):
        turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
        # From far away coordinates themselves leave the plane by more than the light stands over it.
        low = elevation if not any(move) else max(elevation, 1e-6)

        def put(point) -> str:
            return vector(scale * (turn @ np.array(point, float)) + np.array(move, float))

        normal = vector(turn @ [np.sin(tilt), 0, np.cos(tilt)])
        corners = [put(p) for p in ((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0))]
        triangles = " ".join(
            "smooth_triangle { " + ", ".join(f"{corners[i]}, {normal}" for i in face) + " }" for face in ((0, 1, 2), (0, 2, 3))
        )
        light = (1000 * np.cos(low), 0, 1000 * np.sin(low))
        text = (
            f"camera {{ location {put((0.3, -0.2, 5))} sky {vector(turn @ [0, 1, 0])} right <-4/3, 0, 0> look_at {put((0, 0, 0))} angle 18 }}\n"
            f"light_source {{ {put(light)} color rgb 1 }}\nmesh {{ {triangles} {WHITE[10:-2]} }}\n"
        )
        light, _ = picture(text)
        assert (light > 0).all(), (scale, move)


@pytest.mark.parametrize("accelerator", ["none", "boxes", "grid", "bvh"])
def test_solids_shadow_themselves_where_rays_go_through_them(accelerator):
    """A convex solid can't be met by a ray that goes away from it; one that goes inside, or is concave, can."""

    def drawn(solid: str, eye: str, target: str, light: str, angle: float = 20) -> np.ndarray:
        text = (
            f"camera {{ location {eye} sky <0, 0, 1> right <-4/3, 0, 0> look_at {target} angle {angle} }}\n"
            f"light_source {{ {light} color rgb 1 }}\nobject {{ S {WHITE} }}\nSelection S {{ S -> {solid}; }}\n"
        )
        with Scene(compile(text), accelerator=accelerator) as scene:
            return scene.render(32, 24, channels=("color",))["color"][..., 0]

    for solid in ("sphere", "[ trans -1 -1 -1; scale 2 2 2 ] box", "[ trans 0 0 -1; scale 1 1 2 ] cylinder"):
        ball = f"{solid} + [ trans 9 0 0 ] {solid}"
        assert (drawn(ball, "<0, 0, 0>", "<-1, 0.1, 0.2>", "<50, 0, 0>") == 0).all(), solid
        assert (drawn(ball, "<0, 0, 0>", "<-1, 0.1, 0.2>", "<0.5, 0, 0>") > 0).all(), solid
        assert (drawn(ball, "<-9, 0.1, 0.2>", "<0, 0.1, 0.2>", "<-50, 0, 0>").max()) > 0.9, solid
        assert (drawn(ball, "<4.5, 0, 0.1>", "<9, 0, 0.1>", "<-50, 0, 0>") == 0).all(), solid
    ring = [drawn("torus(0.25)", "<-0.8, 0.001, 9>", "<-0.8, 0, 0>", light, 0.5) for light in ("<50, 0, 0>", "<0, 0, 0>")]
    assert ring[0].max() == 0 < ring[1].min()


def test_smooth_mirrors_reflect_what_is_around_them_and_not_themselves():
    text = """
    camera { location <0, -5, 1e-4> sky <0, 0, 1> right <-4/3, 0, 0> look_at <0, 0, 0> angle 20 }
    light_source { <0, 0, 9> color rgb 1 }
    background { color rgb 1 }
    mesh {
        smooth_triangle { <-2, -2, 0>, <0, -0.5, 1>, <2, -2, 0>, <0, -0.5, 1>, <0, 2, 0>, <0, -0.5, 1> }
        pigment { color rgb 1 } finish { ambient 0 diffuse 0 reflection 1 }
    }
    """
    light, _ = picture(text)
    assert (light == 1).all()
