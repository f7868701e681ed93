"""Olive branches in a Delft vase: stems are curves, leaves are copies of one Loop subdivision surface."""

import math
import random

from modelling.mesh import bezier, revolve, spline
from modelling.vector import add, cross, lerp, orthogonal, rotate, scale, sub, unit

from .layout import TABLE
from .part import Part

VASE = (1.22, 2.02)
VASE_HEIGHT = 0.268


def write():
    out = Part("branches", "Olive branches in a Delft vase.")
    out.line()
    leaf(out)
    out.begin().line(f"Translate {VASE[0]} {VASE[1]} {TABLE}")
    vase(out)
    rng = random.Random(3)
    for azimuth, reach, height, droop in (
        (205, 0.20, 0.66, 0.05), (150, 0.24, 0.52, 0.10), (20, 0.23, 0.60, 0.07), (-25, 0.25, 0.46, 0.11),
        (85, 0.16, 0.70, 0.03), (262, 0.17, 0.50, 0.08), (325, 0.12, 0.62, 0.03), (110, 0.22, 0.62, 0.08), (230, 0.25, 0.56, 0.12),
    ):
        branch(out, rng, math.radians(azimuth), reach, height, droop)
    out.end()
    out.save()


def vase(out):
    profile = spline(
        [(0, 0.005), (0.040, 0.004), (0.052, 0), (0.057, 0.003), (0.058, 0.010), (0.060, 0.022), (0.078, 0.070), (0.088, 0.112)]
        + [(0.085, 0.150), (0.066, 0.190), (0.045, 0.215), (0.0385, 0.235), (0.0420, 0.255), (0.0475, 0.2655), (0.0465, 0.268)]
        + [(0.0435, 0.266), (0.0385, 0.255), (0.0345, 0.235), (0.041, 0.215), (0.060, 0.190), (0.079, 0.150), (0.082, 0.112)]
        + [(0.072, 0.070), (0.054, 0.022), (0, 0.016)],
        4,
    )
    mesh = revolve(profile, 64, uv=True)
    mesh.uvs = [(u, p[2] / VASE_HEIGHT) for (u, _), p in zip(mesh.uvs, mesh.points)]
    out.mesh("vase", mesh, "delft")


def leaf(out):
    """Along x from the origin, 6 cm, folded at its midrib, its tip bent down."""
    points, triangles = [], []
    outline = [(0.0, 0.0012), (0.008, 0.0030), (0.022, 0.0072), (0.036, 0.0076), (0.049, 0.0046), (0.060, 0.0006)]
    for x, half in outline:
        bend = -0.10 * x - 2.2 * x * x
        points += [(x, -half, bend + 0.25 * half), (x, 0, bend), (x, half, bend + 0.25 * half)]
    for k in range(len(outline) - 1):
        for a in (3 * k, 3 * k + 1):
            triangles += [(a, a + 3, a + 4), (a, a + 4, a + 1)]
    out.line('ObjectBegin "leaf"').material("leaf").loop(points, triangles, 2).line("ObjectEnd")


def branch(out, rng, azimuth, reach, height, droop):
    """One stem out of the mouth of the vase, with leaves in opposite pairs, each pair a quarter turn from the last."""
    d = (math.cos(azimuth), math.sin(azimuth), 0.0)
    # It stands on the bottom at the far side, passes the mouth, and bends over.
    control = [
        add(scale(d, -0.035), (0, 0, 0.06)),
        add(scale(d, 0.026), (0, 0, 0.285)),
        add(scale(d, 0.45 * reach), (0, 0, height)),
        add(scale(d, reach), (rng.uniform(-0.03, 0.03), rng.uniform(-0.03, 0.03), height - droop)),
    ]
    out.material("bark")
    out.line('Shape "curve" "string type" "cylinder" "float width0" 0.0058 "float width1" 0.0014')
    out.array("point3 P", control)
    stem = bezier(control, 61)
    side = rotate(orthogonal(unit(sub(stem[1], stem[0]))), unit(sub(stem[1], stem[0])), rng.uniform(0, 360))
    for k in range(24, 61, 2):
        p, tangent = stem[k], unit(sub(stem[min(k + 1, 60)], stem[k - 1]))
        side = rotate(unit(cross(cross(tangent, side), tangent)), tangent, 90 + rng.uniform(-25, 25))
        for sign in (1, -1):
            if rng.random() < 0.12:
                continue
            spread = 0.35 + 0.9 * rng.random()
            along = unit(add(tangent, scale(side, sign * spread)))
            # Leaves turn their upper sides to the light of the window and the sky.
            up = unit(add((-0.5, -0.1, 0.8), tuple(rng.uniform(-0.6, 0.6) for _ in range(3))))
            y = unit(cross(up, along))
            z = cross(along, y)
            size = rng.uniform(0.9, 1.35) * (1 - 0.35 * (k - 24) / 36)
            axes = [scale(e, size) for e in (along, y, z)]
            out.begin().place(*add(p, scale(along, 0.001)), *axes).line('ObjectInstance "leaf"').end()
    # One more at the tip.
    tangent = unit(sub(stem[60], stem[58]))
    y = orthogonal(tangent)
    axes = [scale(e, 0.6) for e in (tangent, y, cross(tangent, y))]
    out.begin().place(*stem[60], *axes).line('ObjectInstance "leaf"').end()
