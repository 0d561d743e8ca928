"""Mitsuba 3, scalar_rgb, in its best form: scenes split by hand into two levels of instances, curves where they win.

The same camera, light and resolution as plsys, one sample a pixel, shadows, diffuse surfaces, no ground.

    files = write_scene(folder / "scene.xml", case, [Group("curves", data)], instances)
    render(folder / "scene.xml", 640, 480).wall
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import peers
from prepare import Case

FACES = np.array([[0, 1, 2], [0, 2, 3]], np.int32)


@dataclass
class Group:
    """kind "curves": data (n, 8) of cone_curves; "quads": (n, 12) of box_quads. instanced: shown only by instances."""

    kind: str
    data: np.ndarray
    instanced: bool = False


def program() -> Path | None:
    path = Path(sys.executable).with_name("mitsuba")
    if not path.exists():
        peers.MISSING["mitsuba"] = "pip install mitsuba"
        return None
    return path


def write_curves(path: Path, data: np.ndarray) -> None:
    """A linearcurve file: control points `x y z r`, a blank line between curves."""
    with open(path, "w") as file:
        for row in data.reshape(-1, 8).tolist():
            file.write("%.7g %.7g %.7g %.7g\n%.7g %.7g %.7g %.7g\n\n" % tuple(row))


def write_ply(path: Path, quads: np.ndarray) -> None:
    """Quads as triangles, little-endian binary PLY."""
    vertices = quads.reshape(-1, 3).astype("<f4")
    corners = (FACES[None] + 4 * np.arange(len(quads), dtype=np.int32)[:, None, None]).reshape(-1, 3)
    faces = np.empty(len(corners), dtype=[("n", "u1"), ("v", "<i4", 3)])
    faces["n"], faces["v"] = 3, corners
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    path.write_bytes(header.encode() + vertices.tobytes() + faces.tobytes())


def write_scene(path: Path, case: Case, groups: list[Group], instances: list[tuple[int, np.ndarray]]) -> Path:
    """An XML scene with its shape files beside it."""
    camera = {name: ", ".join(f"{x:.9g}" for x in np.ravel(value)) for name, value in case.camera.items()}
    light = ", ".join(f"{x:.9g}" for x in dict(case.compilation.graph.lights[0].values)["location"])
    lines = [
        '<scene version="3.0.0"><default name="w" value="640"/><default name="h" value="480"/>',
        '<integrator type="direct"><integer name="emitter_samples" value="1"/><integer name="bsdf_samples" value="0"/></integrator>',
        f'<sensor type="perspective"><string name="fov_axis" value="x"/><float name="fov" value="{camera["angle"]}"/>'
        f'<transform name="to_world"><lookat origin="{camera["location"]}" target="{camera["look_at"]}" up="{camera["sky"]}"/></transform>'
        '<film type="hdrfilm"><integer name="width" value="$w"/><integer name="height" value="$h"/><rfilter type="box"/></film>'
        '<sampler type="independent"><integer name="sample_count" value="1"/></sampler></sensor>',
        f'<emitter type="point"><point name="position" value="{light}"/><rgb name="intensity" value="2000"/></emitter>',
        '<bsdf type="diffuse" id="wood"><rgb name="reflectance" value="0.45, 0.3, 0.15"/></bsdf>',
    ]
    for i, group in enumerate(groups):
        if group.kind == "curves":
            file = path.with_name(f"group{i}.txt")
            write_curves(file, group.data)
            shape = f'<shape type="linearcurve"><string name="filename" value="{file.name}"/><ref id="wood"/></shape>'
        else:
            file = path.with_name(f"group{i}.ply")
            write_ply(file, group.data)
            shape = (
                f'<shape type="ply"><string name="filename" value="{file.name}"/>'
                '<boolean name="face_normals" value="true"/><ref id="wood"/></shape>'
            )
        lines.append(f'<shape type="shapegroup" id="group{i}">{shape}</shape>' if group.instanced else shape)
    for group, matrix in instances:
        value = " ".join(f"{x:.8g}" for x in np.ravel(matrix)) + " 0 0 0 1"
        lines.append(
            f'<shape type="instance"><ref id="group{group}"/><transform name="to_world"><matrix value="{value}"/></transform></shape>'
        )
    path.write_text("\n".join([*lines, "</scene>"]) + "\n")
    return path


def render(path: Path, width: int, height: int) -> peers.Run | None:
    """The whole process, all cores."""
    command = program()
    if not command:
        return None
    arguments = [
        "-m",
        "scalar_rgb",
        "-D",
        f"w={width}",
        "-D",
        f"h={height}",
        "-o",
        path.with_suffix(".exr"),
        path,
    ]
    return peers.run([command, *arguments], pinned=False)
