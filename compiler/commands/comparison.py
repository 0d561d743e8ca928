"""What ``compare`` does alike against POV-Ray and through a mesh: our picture, drawn with POV-Ray's tolerances, and the
report of how two pictures differ.

Example: ``report(facts, ours, theirs, arguments)`` prints the facts, writes the pictures side by side and gives the
exit code."""

from __future__ import annotations

import argparse

from .common import print_json

MOST_OVER = 1e-4  # share of the pixels that may differ by more than 1e-5
CHANNELS = ("color", "depth", "normal", "primitive")


def render_ours(data: bytes, arguments: argparse.Namespace):
    """(channels, agrees, scene): our picture with POV-Ray's tolerances, a test of single rays, and the open
    scene."""
    from ...runtime import Scene

    scene = Scene(data, accelerator=arguments.accel, threads=arguments.threads or None, povray_epsilon=True)
    image = scene.render(*arguments.size, channels=CHANNELS)

    def agrees(ray) -> bool:
        """Whether the runtime takes the retracer's decision on one ray."""
        import numpy as np

        origin, direction = (np.asarray(v, np.float64)[None] for v in (ray.origin, ray.direction))
        if ray.is_shadow:
            return bool(scene.occluded(origin, direction, np.array([ray.end]))[0]) == (ray.primitive >= 0)
        return int(scene.intersect(origin, direction).primitive[0]) == ray.primitive

    return image, agrees, scene


def report(facts: dict, ours, theirs, arguments: argparse.Namespace) -> int:
    """Writes the picture, prints the facts, and gives the exit code."""
    from .differences import write_side_by_side

    if arguments.output:
        facts["amplified"] = arguments.amplify or _amplification(facts["max_abs"])
        write_side_by_side(arguments.output, ours, theirs, facts["amplified"], arguments.through or "POV-Ray")
        facts["image"] = arguments.output
    facts.setdefault("passed", passes(facts))
    if arguments.json:
        print_json(facts)
    else:
        print(text(facts))
    return 0 if facts["passed"] else 1


def _amplification(max_abs: float) -> float:
    """A power of ten that makes the largest difference visible."""
    factor = 1.0
    while factor < 1e4 and max_abs * factor < 0.1:
        factor *= 10
    return factor


def passes(facts: dict) -> bool:
    classes = facts.get("classes", {})
    return (
        facts["over_1e5"] <= MOST_OVER * facts["pixels"]
        and facts["interior_over_1_255"] == 0
        and not classes.get("ours_wrong", 0)
        and not classes.get("unclassified", 0)
    )


def text(facts: dict) -> str:
    """The facts for people."""
    lines = [
        f"{facts['scene']}: {facts['width']}x{facts['height']}, largest difference {facts['max_abs']:.3g}, "
        f"rmse {facts['rmse']:.3g}",
        f"  {facts['over_1e5']} of {facts['pixels']} pixels differ by more than 1e-5; "
        f"{facts['interior_over_1_255']} visibly and away from the {facts['edge_pixels']} edge pixels",
    ]
    if mesh := facts.get("mesh"):
        lines += [
            f"  {mesh['triangles']:,} triangles, at most {mesh['error']:.3g} from the surfaces "
            f"(tolerance {mesh['tolerance']:.3g}), {'' if mesh['watertight'] else 'NOT '}watertight",
            f"  volume {mesh['volume']:.9g} (its facets' {mesh['facets_volume']:.9g}, "
            f"the scene's {mesh['exact_volume']:.9g}); bounds off by {mesh['bounds_error']:.3g}",
            *(f"  not carried: {line}" for line in facts["lost"]),
            "  the mesh is the scene" if facts["passed"] else "  THE MESH ISN'T THE SCENE",
        ]
        return "\n".join(lines)
    if facts["over_1e5"]:
        classes = ", ".join(f"{count} {name}" for name, count in facts["classes"].items() if count)
        lines.append(f"  traced again: {classes}")
    lines.append(
        f"  plsys {facts['ours_seconds']:.2f} s, {facts['ours_rss'] / 1e6:.0f} MB; "
        f"POV-Ray {facts['povray_seconds']:.2f} s, {facts['povray_rss'] / 1e6:.0f} MB"
    )
    lines.append("  the pictures agree" if facts["passed"] else "  THE PICTURES DIFFER")
    return "\n".join(lines)
