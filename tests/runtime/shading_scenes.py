"""The reference model's scenes (tests/povray) in the language of plsys: text → bytecode → picture.

picture(CASES["finish"], 160, 120)        a (120, 160, 3) float32 array, linear, unclipped
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from plsys.compiler import compile
from plsys.runtime import Scene
from povray.model import Scene as Model
from povray.shapes import Cone, Disc, Mesh, Triangle

RATIO = "<-image_width/image_height, 0, 0>"


def spelled(model: Model) -> Model:
    """The same scene without what plsys has not: open shapes are left out, holes closed, mesh2 is a mesh, and a smooth
    triangle becomes one (which keeps it in single precision)."""
    objects = []
    for thing in model.objects:
        shape = thing.shape
        if isinstance(shape, Cone) and shape.is_open:
            continue
        if isinstance(shape, Disc):
            thing = replace(thing, shape=replace(shape, hole=0.0))
        if isinstance(shape, Mesh | Triangle):
            triangles = shape.triangles if isinstance(shape, Mesh) else [shape]
            thing = replace(thing, shape=Mesh([replace(t) for t in triangles]))
        objects.append(thing)
    return replace(model, objects=objects)


def text(model: Model, aspect: float) -> str:
    """A plsys scene. Discs lose the 0 that says that they have no hole."""
    lines = (
        spelled(model).pov().replace("#version 3.7;\n", "").replace(RATIO, f"<-{aspect!r}, 0, 0>").split("\n")
    )
    return "\n".join(line.replace(", 0.0 ", " ", 1) if line.startswith("disc") else line for line in lines)


def opened(model: Model, width: int, height: int, **options) -> Scene:
    return Scene(compile(text(model, width / height)), **options)


def picture(model: Model, width: int, height: int, **options) -> np.ndarray:
    """Drawn with POV-Ray's tolerances; ``options`` are Scene.render's."""
    with opened(model, width, height, povray_epsilon=True) as scene:
        return scene.render(width, height, **options)["color"]
