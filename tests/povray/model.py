"""A NumPy model of POV-Ray 3.7's shading: the formulas of runtime/SHADING.md, executable and slow.

Input: a `Scene`.  Output: `scene.render(width, height)`, a (height, width, 3) float64 image in linear light
that POV-Ray's own image of `scene.pov()` must equal to its 16-bit quantisation (`povray(scene, …)`).
It follows the documentation, not our runtime, so that the two can be compared.

    scene = Scene([Object(Sphere((0, 0, 1), 1), Plain((1, 0, 0, 0, .5)))], [Light((5, -5, 9))])
    difference = scene.render(160, 120) - povray(scene, 160, 120)
"""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from .shapes import Vector, dot, unit, vector_text
from .textures import Object, colour_text

SMALLEST_HIT = 1e-4
SHADOW_TOLERANCE = 1e-3
FARTHEST_HIT = 1e7
EPSILON = 1e-10
GREY = np.array([0.297, 0.589, 0.114])


@dataclass
class Light:
    """`kind` holds POV-Ray's words: "spotlight", "parallel", "shadowless" or "", or two of them."""

    location: Vector
    colour: Vector = (1, 1, 1)
    kind: str = ""
    point_at: Vector = (0, 0, 1)
    radius: float = 30.0
    falloff: float = 45.0
    tightness: float = 0.0
    fade_distance: float = 0.0
    fade_power: float = 0.0

    def ray(self, p):
        """Unit vectors to the light, distances, and the colour that arrives, unshadowed."""
        location = np.asarray(self.location, float)
        axis = unit(np.asarray(self.point_at, float) - location)
        distance = np.sqrt(dot(location - p, location - p))
        towards = (location - p) / distance[:, None]
        if "parallel" in self.kind:
            distance = (p - location) @ axis
            towards = np.broadcast_to(-axis, p.shape)
        strength = np.ones(len(p))
        if "spotlight" in self.kind:
            strength = self.cone(np.where(distance > 0, -1, 1) * (towards @ axis))
        if self.fade_power > 0 and self.fade_distance != 0:
            strength = strength * 2 / (1 + (distance / self.fade_distance) ** self.fade_power)
        return towards, distance, strength[:, None] * np.asarray(self.colour, float)

    def cone(self, cosine):
        """Strength of a spotlight by the cosine of the angle to its axis."""
        low, high = np.cos(np.radians([self.falloff, self.radius]))
        with np.errstate(all="ignore"):
            x = (cosine - low) / (high - low)
            step = np.where(cosine < low, 0.0, np.where(cosine >= high, 1.0, x * x * (3 - 2 * x)))
            step = np.where((high > 0) & (cosine < high), step, 1.0)
            return np.where(cosine > 0, step * np.abs(cosine) ** self.tightness, 0.0)

    def pov(self):
        words = [self.kind]
        if "spotlight" in self.kind:
            words.append(f"radius {self.radius!r} falloff {self.falloff!r} tightness {self.tightness!r}")
        if "spotlight" in self.kind or "parallel" in self.kind:
            words.append(f"point_at {vector_text(self.point_at)}")
        if self.fade_power:
            words.append(f"fade_distance {self.fade_distance!r} fade_power {self.fade_power!r}")
        return (
            f"light_source {{ {vector_text(self.location)}, {colour_text(self.colour)} {' '.join(words)} }}"
        )


@dataclass
class Scene:
    objects: Sequence[Object]
    lights: Sequence[Light]
    location: Vector = (0, -8, 4)
    look_at: Vector = (0, 0, 0.5)
    angle: float = 50.0
    background: Vector = (0, 0, 0)
    ambient_light: Vector = (1, 1, 1)
    max_trace_level: int = 5
    adc_bailout: float = 1 / 255

    def rays(self, x, y, width, height):
        """Camera rays of image coordinates; a pixel's centre has whole coordinates plus a half."""
        eye = np.asarray(self.location, float)
        d = unit(np.asarray(self.look_at, float) - eye)
        r = unit(np.cross([0.0, 0.0, 1.0], d))
        u = np.cross(d, r)
        aspect = width / height
        depth = aspect / np.tan(np.radians(self.angle) / 2) / 2
        across = (np.asarray(x) / width - 0.5)[..., None]
        down = (0.5 - np.asarray(y) / height)[..., None]
        # `right <-W/H, 0, 0>` makes the view right-handed, which turns POV-Ray's r around.
        direction = unit(depth * d - across * aspect * r + down * u)
        return np.broadcast_to(eye, direction.shape), direction

    def render(self, width, height):
        x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
        return self.colour_at(x.ravel(), y.ravel(), width, height).reshape(height, width, 3)

    def colour_at(self, x, y, width, height):
        o, d = self.rays(x, y, width, height)
        return self.trace(o, d, np.ones(len(o)), 0, False)

    def nearest(self, o, d, least, objects, farthest=FARTHEST_HIT):
        """t (inf: none), normal and index into `objects` of each ray's first hit beyond `least`."""
        best = np.full(len(o), np.inf)
        normal, which = np.zeros((len(o), 3)), np.full(len(o), -1)
        for i, thing in enumerate(objects):
            t, n = thing.hits(o, d)
            t = np.where((t >= least) & (t < farthest), t, np.inf)
            k = t.argmin(axis=0)
            here = t[k, np.arange(len(o))]
            closer = here < best
            best, which = np.where(closer, here, best), np.where(closer, i, which)
            normal[closer] = n[k, np.arange(len(o))][closer]
        return best, normal, which

    def trace(self, o, d, weight, level, continued):
        """Light that comes against the rays.  `weight`: what it still counts for; `continued`: transmitted."""
        colour = np.zeros((len(o), 3))
        alive = np.flatnonzero(weight >= self.adc_bailout)
        if level >= self.max_trace_level or not len(alive):
            return colour
        o, d, weight = o[alive], d[alive], weight[alive]
        t, n, which = self.nearest(o, d, SMALLEST_HIT, self.objects)
        colour[alive] = self.background
        for i in np.unique(which[which >= 0]):
            m = which == i
            colour[alive[m]] = self.shade(
                self.objects[i], o[m] + t[m, None] * d[m], d[m], n[m], weight[m], level + (not continued)
            )
        return colour

    def shade(self, thing, p, d, n, weight, level):
        n = unit(n)
        n = np.where(dot(n, d)[:, None] > 0, -n, n)
        c, finish = thing.colour(p), thing.finish
        rgb, opacity = c[:, :3], (1 - c[:, 3] - c[:, 4])[:, None]
        total = rgb * opacity * (np.asarray(finish.ambient) * self.ambient_light + finish.emission)
        for light in self.lights:
            total = total + self.lit(light, finish, p, d, n, rgb, opacity)
        through = rgb * c[:, 3:4] + c[:, 4:5]
        m = np.abs(through @ GREY) > self.adc_bailout
        if m.any():
            beyond = self.trace(p[m], d[m], weight[m] * np.abs(through[m]).max(axis=1), level, True)
            total[m] += through[m] * beyond
        mirror = np.asarray(finish.reflection, float)
        if mirror.any():
            r = unit(d - 2 * dot(d, n)[:, None] * n)
            total = total + mirror * self.trace(p, r, weight * mirror.max(), level, False)
        return total

    def lit(self, light, finish, p, d, n, rgb, opacity):
        """Diffuse and highlights of one light, shadows included."""
        towards, distance, colour = light.ray(p)
        cosine = dot(n, towards)
        m = (cosine >= EPSILON) & (np.abs(colour) >= EPSILON).any(axis=1)
        total = np.zeros((len(p), 3))
        if not m.any():
            return total
        p, d, n, towards, cosine = p[m], d[m], n[m], towards[m], cosine[m]
        colour = colour[m]
        if "shadowless" not in light.kind:
            colour = self.filtered(p, towards, distance[m], colour)
        share = rgb[m] * opacity[m] * (finish.diffuse * cosine**finish.brilliance)[:, None]
        if "shadowless" not in light.kind:
            r = dot(d - 2 * dot(d, n)[:, None] * n, towards)
            size = finish.phong_size
            bright = np.where((r > 0) & ((size < 60) | (r > 0.0008)), np.maximum(r, 0) ** size, 0)
            half = dot(unit(towards - d), n)
            glint = np.maximum(half, 0) ** (1 / finish.roughness)
            share = share + (finish.phong * bright + finish.specular * glint)[:, None]
        total[m] = colour * share
        return total

    def filtered(self, p, towards, distance, colour):
        """The light's colour behind everything between p and the light, surface by surface."""
        casters = [thing for thing in self.objects if not thing.no_shadow]
        colour, left = colour.copy(), distance.copy()
        active = np.arange(len(p))
        while len(active):
            t, _, which = self.nearest(p[active], towards[active], SHADOW_TOLERANCE, casters)
            hit = (t < left[active] - SHADOW_TOLERANCE) & (t > SHADOW_TOLERANCE)
            active, t, which = active[hit], t[hit], which[hit]
            p = p.copy()
            p[active] += t[:, None] * towards[active]
            left[active] -= t
            for i in np.unique(which):
                rows = active[which == i]
                c = casters[i].colour(p[rows])
                colour[rows] *= 0 if casters[i].opaque else c[:, :3] * c[:, 3:4] + c[:, 4:5]
            active = active[np.abs(colour[active]).max(axis=1) >= EPSILON] if len(active) else active
        return colour

    def pov(self, version=True):
        """The whole scene as POV-Ray text."""
        settings = f"ambient_light {colour_text(self.ambient_light)} max_trace_level {self.max_trace_level}"
        view = (
            f"location {vector_text(self.location)} angle {self.angle!r} look_at {vector_text(self.look_at)}"
        )
        lines = [
            "#version 3.7;" if version else "",
            f"global_settings {{ assumed_gamma 1.0 {settings} adc_bailout {self.adc_bailout!r} }}",
            f"camera {{ right <-image_width/image_height, 0, 0> up <0, 1, 0> sky <0, 0, 1> {view} }}",
            f"background {{ {colour_text(self.background)} }}",
            *(light.pov() for light in self.lights),
            *(thing.pov() for thing in self.objects),
        ]
        return "\n".join(lines) + "\n"


def povray(text: Scene | str, width: int, height: int, *options: str, executable="povray") -> np.ndarray:
    """POV-Ray's image of a scene, linear, as a (height, width, 3) float64 array in steps of 1/65535.

    Raises RuntimeError with POV-Ray's own words when it fails.
    """
    if isinstance(text, Scene):
        text = text.pov()
    with tempfile.TemporaryDirectory() as folder:
        scene, image = Path(folder, "scene.pov"), Path(folder, "image.png")
        scene.write_text(text)
        command = [executable, f"+I{scene}", f"+O{image}", f"+W{width}", f"+H{height}", "-D", "-V", "+WT1"]
        command += ["-A", "+FN16", "File_Gamma=1.0", "Dither=off", *options]
        result = subprocess.run(command, check=False, capture_output=True, text=True, cwd=folder)
        if result.returncode:
            raise RuntimeError(result.stderr[-2000:])
        buffer = oiio.ImageBuf(str(image))
        return buffer.get_pixels(oiio.UINT16).astype(float)[..., :3] / 65535
