"""A graph → a POV-Ray 3.7 scene that draws the same picture.

The scene is unfolded, grouped into one ``union`` per texture (and its frame, where it has a pattern), and
written in memory that doesn't grow with it: primitives go to a spool file first, group by group they are then
copied behind the camera and the lights.

Example: ``export_povray(graph, "tree.pov").primitives`` is 2050; then ``povray +Itree.pov +Otree.png``.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO, TextIO

from ..bytecode.layout_rows import RECORDS
from ..graph.graph import Graph
from ..reading.model import Record
from . import povray_text as text
from .files import whole_file
from .output import Exported, check_size
from .textures import Palette, Texture
from .unfold import unfold

MOST_UNIONS = 4096
"""Textures beyond this number are written with each primitive, so that a scene in which every leaf has a
colour of its own needs no list of all colours."""


@dataclass
class _Group:
    """The primitives of one texture: where they stand in the spool."""

    texture: Texture | None
    no_shadow: bool
    count: int = 0
    segments: list[list[int]] = field(default_factory=list)  # [offset, length]


def export_povray(graph: Graph, path: str | Path, **limits: int) -> Exported:
    """Writes the scene to ``path``, whole or not at all. ``limits`` are those of :func:`unfold.unfold`.
    Raises PlsysError where the scene can't be unfolded or the file can't be written."""
    check_size(graph)
    result = Exported()
    with whole_file(path) as file, tempfile.TemporaryFile(dir=Path(path).parent) as spool:
        groups = _spool(graph, spool, result, limits)
        _write_head(graph, file, result)
        for group in groups:
            _write_group(group, spool, file)
    return result


def _spool(graph: Graph, spool: BinaryIO, result: Exported, limits: dict[str, int]) -> list[_Group]:
    """Unfolds the scene into ``spool`` and says which parts of it belong together."""
    groups: dict[tuple[bytes, bool], _Group] = {}
    single = _Group(None, False)
    palette = Palette(graph)
    unfolding = unfold(graph, **limits)
    for batch in unfolding:
        result.count(batch)
        lines = text.primitives(batch)
        textures, of = palette.distinct(batch)
        code = of * 2 + batch.no_shadow
        for value in sorted(set(code.tolist())):
            (key, texture), no_shadow = textures[value // 2], bool(value % 2)
            chosen = lines[code == value]
            group = groups.get((key, no_shadow))
            if group is None and len(groups) < MOST_UNIONS:
                group = groups[key, no_shadow] = _Group(texture, no_shadow)
            if group is None:
                group, tail = single, _modifiers(texture, no_shadow)
                chosen = [f"object{{{line}{tail}}}" for line in chosen]
            _append(spool, group, "\n".join(chosen) + "\n", len(chosen))
    result.finish(unfolding)
    return [*groups.values(), single]


def _append(spool: BinaryIO, group: _Group, content: str, count: int) -> None:
    offset, length = spool.tell(), spool.write(content.encode())
    group.count += count
    if group.segments and sum(group.segments[-1]) == offset:
        group.segments[-1][1] += length
    else:
        group.segments.append([offset, length])


def _modifiers(texture: Texture | None, no_shadow: bool) -> str:
    return ("" if texture is None else " " + text.texture(texture)) + (" no_shadow" if no_shadow else "")


def _write_group(group: _Group, spool: BinaryIO, file: TextIO) -> None:
    if not group.count:
        return
    tail = _modifiers(group.texture, group.no_shadow)
    if tail:
        file.write("\nobject {\n" if group.count == 1 else "\nunion {\n")
    for offset, length in group.segments:
        file.flush()
        spool.seek(offset)
        _copy(spool, file.buffer, length)
    if tail:
        file.write(f"{tail.strip()}\n}}\n")


def _copy(source: BinaryIO, target: BinaryIO, length: int) -> None:
    while length:
        block = source.read(min(length, 1 << 20))
        target.write(block)
        length -= len(block)


# --- the scene around the primitives ---


def _write_head(graph: Graph, file: TextIO, result: Exported) -> None:
    lines = [
        "#version 3.7;",
        f"// Written by plsys, unfolded; primitives: {result.primitives}",
        "// Reference image in linear light: povray +I… +FN16 File_Gamma=1.0 Dither=off -A",
        *(f"// Not carried: {line}" for line in result.lost),
        _settings(graph.settings),
    ]
    if graph.camera is not None:
        lines.append(_camera(graph.camera))
    lines += [_light(light) for light in graph.lights]
    lines += [f"#declare Mesh{i} = {text.mesh2(mesh)}" for i, mesh in enumerate(graph.meshes)]
    file.write("\n".join(lines) + "\n")


def values_of(record: Record | None, kind: str) -> dict[str, tuple[float, ...]]:
    """All values of a record by name, defaults filled in."""
    values = {row.name: row.default for row in RECORDS[kind].values.values()}
    return values | {name: tuple(numbers) for name, numbers in (record.values if record else ())}


def _settings(record: Record | None) -> str:
    values = values_of(record, "settings")
    return (
        f"global_settings {{ assumed_gamma 1.0 max_trace_level {int(values['max_trace_level'][0])} "
        f"adc_bailout {values['adc_bailout'][0]!r} "
        f"ambient_light rgb{text.vector(values['ambient_light'])} }}\n"
        f"background {{ rgb{text.vector(values['background'])} }}"
    )


def _camera(record: Record) -> str:
    values = values_of(record, "camera")
    words = [
        f"{name} {text.vector(values[name])}" for name in ("location", "direction", "right", "up", "sky")
    ]
    if values["angle"][0]:
        words.append(f"angle {values['angle'][0]!r}")
    if values["has_look_at"][0]:
        words.append(f"look_at {text.vector(values['look_at'])}")
    return f"camera {{ {' '.join(words)} }}"


def _light(record: Record) -> str:
    values = values_of(record, "light")
    words = [f"{text.vector(values['location'])} rgb{text.vector(values['color'])}"]
    words += [word for word in ("parallel", "spotlight", "shadowless") if values[word][0]]
    if values["parallel"][0] or values["spotlight"][0]:
        words.append(f"point_at {text.vector(values['point_at'])}")
    names = ("radius", "falloff", "tightness") if values["spotlight"][0] else ()
    if values["fade_power"][0]:
        names += ("fade_distance", "fade_power")
    words += [f"{name} {values[name][0]!r}" for name in names]
    return f"light_source {{ {' '.join(words)} }}"
