"""What `plsys render` tells about its work: the JSON of ``--json``, the tables of ``--statistics`` and ``--explain``.

Example: ``facts(arguments, scene.statistics, seconds, left_out)["rays"]["shadow"]`` (JSON.md has all keys).
"""

from __future__ import annotations

import argparse
import resource

from .common import json_integer

# Boxes that a node of bvh tests at a time.
NODE_BOXES = 8


def facts(arguments: argparse.Namespace, statistics: dict, seconds: dict[str, float], left_out: list) -> dict:
    """The object of ``--json``. ``statistics`` are the runtime's Scene.statistics after rendering, ``seconds`` those of all
    phases."""
    width, height = arguments.size
    rays = sum(statistics["rays"].values())
    tests = {
        "nodes": statistics["box_tests"] // NODE_BOXES if statistics["isa"] else statistics["box_tests"],
        "instances": statistics["instances"],
        "primitives_filtered": statistics["filtered"],
        "primitives": statistics["primitive_tests"],
    }
    return {
        "scene": arguments.scene,
        "width": width,
        "height": height,
        "accelerator": statistics["accelerator"],
        "threads": statistics["threads"],
        "povray_epsilon": arguments.povray_epsilon,
        "primitives": json_integer(statistics["primitives"]),
        "states": statistics["states"],
        "detail": statistics["detail"],
        "cut": statistics["cut"],
        "lazy": statistics["lazy"],
        "rays": statistics["rays"],
        "rays_per_second": round(rays / seconds["trace"]) if seconds["trace"] > 0 else None,
        "ended": {"bailout": statistics["bailout"], "trace_level": statistics["trace_level"]},
        "isa": statistics["isa"],
        "front": statistics["front"],
        "terrain": statistics["terrain"],
        "tests": tests,
        "tests_per_ray": {name: round(count / max(rays, 1), 3) for name, count in tests.items()},
        "seconds": {name: round(value, 6) for name, value in seconds.items()},
        "memory": {
            "scene_bytes": statistics["scene_bytes"],
            **{f"{name}_bytes": value for name, value in statistics["bytes"].items()},
            "peak_rss_bytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
        },
        "left_out": [{"what": row.what, "why": row.why} for row in left_out],
        "image": arguments.output,
    }


def explanation(statistics: dict, facts: dict) -> list[str]:
    """Lines of ``--explain``: what was built, its bytes and time, and what was left out."""
    rows = [f"built: {name:<13} {size:>14,} bytes  {text}" for name, size, text in _built(statistics)]
    left_out = [(row["what"], row["why"]) for row in facts["left_out"]] + _not_opened(statistics)
    return rows + [f"left out: {what}: {why}" for what, why in left_out]


def _not_opened(statistics: dict) -> list[tuple[str, str]]:
    """What fronts don't hold, by the estimate that decided it."""
    front = statistics["front"]
    if not front["instances"]:
        return []
    text = f"{front['instances']:,} instances stay closed"
    if front["pilot_rays"]:
        text += f"; {front['pilot_rays']} pilot rays in {front['pilot_seconds']:.4f} s expect {front['entries']:.1f} entered a ray"
        text += f", and the flat scene to take {front['flat_bytes']:,} bytes"
    return [("larger fronts", text)]


def _built(statistics: dict) -> list[tuple[str, int, str]]:
    """(structure, bytes, what it holds) of what the scene needed."""
    front, size, seconds = statistics["front"], statistics["bytes"], statistics["seconds"]
    rows = [("program", size["program"], f"verified in {seconds['verify']:.4f} s")]
    if size["meshes"]:
        rows.append(("meshes", size["meshes"], "boxes over triangles"))
    if size["states"]:
        rows.append(("states", size["states"], f"{statistics['states']} in {seconds['states']:.4f} s"))
    terrain = statistics["terrain"]
    if terrain["tiles"]:
        each = (terrain["bytes"] + terrain["node_bytes"]) / terrain["triangles"]
        text = f"{terrain['tiles']:,}, of {terrain['triangles']:,} triangles, {each:.1f} bytes each"
        rows.append(("terrain tiles", terrain["bytes"], text))
        rows.append(("terrain nodes", terrain["node_bytes"], f"above them, all in {seconds['build']:.4f} s; {statistics['isa']}"))
    if front["count"]:
        limit = "any number" if front["limit"] is None else f"at most {front['limit']:,}"
        build = seconds["build"] - seconds["states"]
        rows.append(("front items", size["items"] - terrain["bytes"], f"{front['items']:,}, {front['instances']:,} of them instances"))
        rows.append(
            ("front nodes", size["nodes"] - terrain["node_bytes"], f"of {front['count']:,} fronts with {limit} items each, in {build:.4f} s; {statistics['isa']}")
        )
    return rows


def table(facts: dict) -> list[str]:
    """Lines of ``--statistics``; of what there was none isn't shown."""
    tests, each, rays, lazy, front = (facts[key] for key in ("tests", "tests_per_ray", "rays", "lazy", "front"))
    rows = [(f"rays, {name}", f"{count:,}", "") for name, count in rays.items() if count]
    rows.append(("rays a second", f"{facts['rays_per_second'] or 0:,}", _plural(facts["threads"], "thread")))
    names = {"nodes": "nodes" if facts["isa"] else "boxes", "primitives_filtered": "primitives, in single precision"}
    rows += [(names.get(name, name), f"{count:,}", f"{each[name]:,.2f} a ray") for name, count in tests.items() if count]
    rows += [(f"rays ended by {name}", f"{count:,}", "") for name, count in facts["ended"].items() if count]
    if facts["primitives"] is not None:
        rows.append(("primitives of the scene", f"{int(facts['primitives']):,}", _plural(facts["states"], "state")))
    if front["items"]:
        rows.append(("items of fronts", f"{front['items']:,}", _plural(front["count"], "front")))
    if facts["cut"]["instances"]:
        rows.append(("rays that met a cut-off", f"{facts['cut']['instances']:,}", f"below {facts['detail']:g} pixels"))
    if lazy["unfolded"]:
        share = lazy["found"] / (lazy["found"] + lazy["unfolded"])
        rows.append(("states found in memory", f"{lazy['found']:,}", f"{share:.2%} of those asked for"))
        rows.append(("states unfolded", f"{lazy['unfolded']:,}", f"{lazy['evicted']:,} thrown out again"))
    rows += [(name.replace("_", " "), f"{size:,}", "") for name, size in facts["memory"].items() if size]
    rows += [(f"seconds, {name.replace('_', ' ')}", f"{value:.4f}", "") for name, value in facts["seconds"].items()]
    return [f"{name:<32} {value:>20}  {note}".rstrip() for name, value, note in rows]


def _plural(count: int, what: str) -> str:
    return f"{count:,} {what}{'' if count == 1 else 's'}"
