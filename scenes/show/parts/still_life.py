"""What stands on the table: copper jug, glass, bowl of oranges, lemons, pears, linen."""

import math
import random

from modelling.mesh import bezier, revolve, spline, tube
from modelling.vector import add, length, lerp, rotate, scale, smoothstep, sub, unit

from .layout import TABLE, TABLE_EDGE, TABLE_LOW
from .part import Part


def write():
    out = Part("still_life", "What stands on the table.")
    out.line()
    jug(out, 1.66, 2.02)
    carafe(out, 2.20, 2.04)
    tumbler(out, 2.335, 1.80)
    bowl(out, 1.945, 1.86)
    lemons(out)
    pears(out)
    napkin(out)
    out.save()


def jug(out, x, y):
    """A jug of hammered copper: a body with a lip drawn out, and a brass handle."""
    body = spline(
        [(0, 0.004), (0.045, 0.003), (0.056, 0), (0.061, 0.004), (0.064, 0.012), (0.083, 0.055), (0.088, 0.085)]
        + [(0.078, 0.125), (0.054, 0.172), (0.0445, 0.20), (0.047, 0.225), (0.058, 0.253), (0.0605, 0.2562), (0.0585, 0.2575)]
        + [(0.055, 0.253), (0.0445, 0.225), (0.042, 0.20), (0.0515, 0.172), (0.0755, 0.125), (0.0855, 0.085), (0.0805, 0.055)]
        + [(0.061, 0.014), (0.045, 0.007), (0, 0.0065)],
        4,
    )

    def lip(p):
        away = max(0.0, -p[0] / max(math.hypot(p[0], p[1]), 1e-9)) ** 4 * smoothstep(0.195, 0.26, p[2])
        return (p[0] - 0.030 * away, p[1] * (1 - 0.25 * away), p[2] + 0.010 * away)

    out.begin().line(f"Translate {x} {y} {TABLE}").line("Rotate 28 0 0 1")
    out.mesh("jug", revolve(body, 60).mapped(lip), "copper")
    path = bezier([(0.0495, 0, 0.232), (0.10, 0, 0.275), (0.150, 0, 0.215), (0.105, 0, 0.105), (0.0845, 0, 0.10)], 28)
    handle = tube(path, lambda t: 0.0046 + 0.0016 * math.cos(2 * math.pi * t), 14, 1.7)
    out.mesh("jug_handle", handle, "brass")
    out.end()


# Profiles of glass are closed: outside from the foot up, over the rim, inside down to the axis.
CARAFE_OUTSIDE = [
    (0, 0.004), (0.022, 0.003), (0.040, 0.0), (0.050, 0.003), (0.054, 0.010), (0.058, 0.035), (0.059, 0.060),
    (0.055, 0.088), (0.043, 0.118), (0.029, 0.146), (0.0215, 0.172), (0.0200, 0.198), (0.0225, 0.226), (0.0310, 0.254),
    (0.0335, 0.2610),
]
CARAFE_RIM = [(0.0333, 0.2625), (0.0322, 0.2628)]
CARAFE_INSIDE = [
    (0.0307, 0.2605), (0.0283, 0.254), (0.0198, 0.226), (0.0172, 0.198), (0.0187, 0.172), (0.0262, 0.146), (0.0403, 0.118),
    (0.0525, 0.088), (0.0562, 0.060), (0.0552, 0.035), (0.0510, 0.016), (0.044, 0.0105), (0.022, 0.0115), (0, 0.0125),
]


def carafe(out, x, y):
    """A carafe of water. Three interfaces meet: glass in air, glass under water, water in air."""
    profile = spline(CARAFE_OUTSIDE + CARAFE_RIM + CARAFE_INSIDE, 4)
    # The water stands to the first vertex of the inside at or below this height.
    inside = (len(CARAFE_OUTSIDE) + len(CARAFE_RIM)) * 4
    level = next(i for i in range(inside, len(profile)) if profile[i][1] <= 0.100)
    r, z = profile[level][:2]
    # A meniscus climbs the last 3 mm; its edge is the last ring of the dry glass.
    climb = lambda s: 0.0018 * math.exp(-(r - s) / 0.0012)
    steps = [0, 0.4, 0.7, 0.85, 0.9, 0.93, 0.95, 0.97, 0.985, 1]
    surface = [(s * r, z - climb(r) + climb(s * r), *_slope(climb(s * r) / 0.0012)) for s in steps]
    out.begin().line(f"Translate {x} {y} {TABLE}")
    out.mesh("carafe", revolve(profile[: level + 1], 80), "glass")
    out.mesh("carafe_wet", revolve(profile[level:], 80), "glass under water")
    # From the rim inwards, for normals that point up.
    out.mesh("carafe_water", revolve(surface[::-1], 80), "water")
    out.end()


def _slope(rise):
    """The upward unit normal, (radial, z), of a profile that rises by `rise` a metre outwards."""
    l = math.hypot(1, rise)
    return (-rise / l, 1 / l)


def tumbler(out, x, y):
    profile = spline(
        [(0, 0.002), (0.020, 0.0015), (0.0285, 0), (0.0325, 0.002), (0.0338, 0.007), (0.0352, 0.03), (0.0372, 0.06)]
        + [(0.0392, 0.088), (0.0394, 0.0915), (0.0388, 0.0930), (0.0378, 0.0932), (0.0371, 0.0915), (0.0368, 0.088)]
        + [(0.0348, 0.06), (0.0327, 0.03), (0.0312, 0.0195), (0.0275, 0.0152), (0.018, 0.014), (0, 0.0137)],
        4,
    )
    out.begin().line(f"Translate {x} {y} {TABLE}")
    out.mesh("tumbler", revolve(profile, 80), "glass")
    out.end()


def bowl(out, x, y):
    """A celadon bowl, spherical inside, and oranges that have rolled to rest in it."""
    foot, thickness, radius, rim = 0.016, 0.0055, 0.158, 0.132
    centre = foot + thickness + radius
    angles = [math.asin(rim / radius) * k / 10 for k in range(11)]
    inner = [(radius * math.sin(a), centre - radius * math.cos(a)) for a in angles]
    outer = [((radius + thickness) * math.sin(a), centre - (radius + thickness) * math.cos(a)) for a in angles]
    lip = (0.5 * (inner[-1][0] + outer[-1][0]) + 0.002, 0.5 * (inner[-1][1] + outer[-1][1]) + 0.0025)
    profile = [(0, 0.006), (0.040, 0.006), (0.0425, 0.0035), (0.0435, 0), (0.048, 0), (0.0497, 0.004), (0.050, 0.012)]
    profile += [(0.053, 0.0245)] + [p for p in outer if p[0] > 0.06] + [lip] + inner[::-1]
    out.line('ObjectBegin "orange"')
    out.mesh("orange", orange(), "orange")
    out.mesh("orange_button", revolve(spline([(0.0045, 0.971), (0.0040, 0.985), (0.0022, 0.992), (0, 0.990)], 3), 10).mapped(
        lambda p: (p[0] * 12, p[1] * 12, p[2] - 0.035)), "stalk")
    out.line("ObjectEnd")
    out.begin().line(f"Translate {x} {y} {TABLE}")
    out.mesh("bowl", revolve(spline(profile, 3), 72), "celadon")

    rng = random.Random(5)
    for centre_of_orange, size in oranges_at_rest((0, 0, centre), radius - 0.0006, rng):
        axis, turn = unit((rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-0.3, 0.3))), rng.uniform(-75, 75)
        axes = [scale(rotate(e, axis, turn), size) for e in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
        out.begin().place(*centre_of_orange, *axes).line('ObjectInstance "orange"').end()
    out.end()


def orange():
    """Of radius 1, a little flat, dimpled around the stalk."""
    profile = []
    for k in range(33):
        a = math.pi * k / 32
        r, z = math.sin(a), -math.cos(a)
        dimple = 0.045 * math.exp(-((r / 0.16) ** 2)) if z > 0 else 0.015 * math.exp(-((r / 0.1) ** 2))
        profile.append((max(r, 0.0) if 0 < k < 32 else 0.0, 0.95 * z * (1 - dimple)))
    return revolve(spline(profile, 1), 40).smooth()


def oranges_at_rest(centre, cavity, rng, count=6):
    """Centres and radii of spheres that settled under gravity inside a spherical cavity without overlap."""
    radii = [rng.uniform(0.0355, 0.039) for _ in range(count)]
    points = []
    for i in range(count):
        a, ring = 2 * math.pi * i / (count - 1), 0.06 if i < count - 1 else 0.005
        points.append((ring * math.cos(a), ring * math.sin(a), 0.08 if i < count - 1 else 0.15))
    for step in range(6000):
        fall = 2e-4 * max(0.0, 1 - step / 4500)
        points = [(p[0], p[1], p[2] - fall) for p in points]
        for i in range(count):
            for j in range(i):
                d = sub(points[i], points[j])
                overlap = radii[i] + radii[j] - length(d)
                if overlap > 0:
                    push = scale(unit(d), overlap / 2)
                    points[i], points[j] = add(points[i], push), sub(points[j], push)
            d = sub(points[i], centre)
            excess = length(d) + radii[i] - cavity
            # The cavity is open above its rim, where the wall pushes nothing.
            if excess > 0 and d[2] < 0:
                points[i] = sub(points[i], scale(unit(d), excess))
    return list(zip(points, radii))


def lemon():
    """Along x, 8 cm, 5.8 cm across."""
    profile = spline(
        [(0, -0.0395), (0.004, -0.0392), (0.0065, -0.0368), (0.0095, -0.0335), (0.018, -0.0265), (0.0262, -0.0140), (0.029, 0.0)]
        + [(0.0265, 0.0140), (0.0185, 0.0268), (0.0105, 0.0335), (0.0072, 0.0375), (0.0055, 0.0412), (0.0025, 0.0425), (0, 0.0427)],
        5,
    )
    # Bumpy at large, as no lemon is round: but not where it lies.
    lumps = lambda p: 1 + 0.012 * math.sin(90 * p[2] + 2 * math.atan2(p[1], p[0]))
    mesh = revolve(profile, 48).mapped(lambda p: (p[0] * lumps(p), p[1] * lumps(p), p[2]))
    return mesh.mapped(lambda p: (p[2], p[0], p[1]))


def lemons(out):
    mesh = lemon()
    bottom = min(p[2] for p in mesh.points)
    out.line('ObjectBegin "lemon"')
    out.mesh("lemon", mesh.moved((0, 0, -bottom)), "lemon")
    out.line("ObjectEnd")
    for x, y, turn in ((2.185, 1.675, 25), (2.108, 1.612, 140)):
        out.begin().line(f"Translate {x} {y} {TABLE}").line(f"Rotate {turn} 0 0 1").line('ObjectInstance "lemon"').end()


def pears(out):
    """Two pears from one cage for Loop subdivision, one upright and one on its side."""
    rings = [(0.0, -0.002), (0.017, 0.0), (0.035, 0.010), (0.042, 0.032), (0.037, 0.056), (0.025, 0.078), (0.0185, 0.096)]
    rings += [(0.014, 0.108), (0.006, 0.110), (0.0, 0.106)]
    sides, points, triangles = 8, [], []
    lean = lambda z: 0.10 * z + 1.1 * z * z
    for k, (r, z) in enumerate(rings):
        if r == 0:
            points.append((lean(z), 0, z))
            continue
        for j in range(sides):
            a = 2 * math.pi * (j + 0.5 * (k % 2)) / sides
            lump = 1 + 0.05 * math.sin(2 * a + 9 * z / 0.1)
            points.append((1.06 * r * lump * math.cos(a) + lean(z), 1.06 * r * lump * math.sin(a), z))
    ring = lambda k, j: 1 + (k - 1) * sides + j % sides
    last = len(points) - 1
    for j in range(sides):
        triangles += [(0, ring(1, j + 1), ring(1, j)), (last, ring(len(rings) - 2, j), ring(len(rings) - 2, j + 1))]
        for k in range(1, len(rings) - 2):
            odd = k % 2
            a, b, c, d = ring(k, j), ring(k, j + 1), ring(k + 1, j), ring(k + 1, j + 1)
            triangles += [(a, b, d), (a, d, c)] if odd else [(a, b, c), (b, d, c)]
    tip = lean(0.100)
    out.line('ObjectBegin "pear"').material("pear")
    out.loop(points, triangles, 3)
    stalk = bezier([(tip, 0, 0.100), (tip + 0.004, 0, 0.115), (tip + 0.012, 0.002, 0.128), (tip + 0.013, 0.005, 0.136)], 8)
    out.mesh("pear_stalk", tube(stalk, lambda t: 0.0016 + 0.0012 * t**3, 8), "stalk")
    out.line("ObjectEnd")
    out.begin().line(f"Translate 1.80 1.735 {TABLE + 0.0011:.4f}").line("Rotate 160 0 0 1").line('ObjectInstance "pear"').end()
    # On its side it touches with belly and neck; the neck is the thinner, so the axis dips towards it.
    out.begin().line(f"Translate 1.745 1.655 {TABLE + 0.0459:.4f}").line("Rotate 205 0 0 1").line("Rotate 97 0 1 0")
    out.line("Translate 0 0 -0.034").line('ObjectInstance "pear"').end()


# Folds of the napkin: where each crosses the table's edge, its direction (x for each metre towards the room), its bend,
# half width, height on the table and how it opens where the linen hangs.
FOLDS = (
    (1.13, -0.10, 0.5, 0.020, 0.011, 0.9), (1.225, 0.16, -0.6, 0.017, 0.017, 1.3), (1.295, 0.05, 0.3, 0.024, 0.008, 1.5),
    (1.385, -0.22, 0.9, 0.018, 0.019, 1.1), (1.47, 0.10, -0.4, 0.022, 0.010, 1.4), (1.545, -0.12, 0.5, 0.016, 0.013, 1.0),
)


def napkin(out):
    """A linen napkin over the front edge of the table, pushed into folds.

    The flat sheet is laid on the table and rolled over its edge, which keeps lengths; folds then lift it along the normal.
    """
    columns, rows, width, depth = 66, 72, 0.50, 0.62
    corner, turn = (1.135, 1.80), math.radians(-11)
    roll, front = TABLE_EDGE + 0.0012, TABLE_LOW[1] + TABLE_EDGE
    points = []
    for j in range(rows):
        for i in range(columns):
            u, v = width * i / (columns - 1), depth * (1 - j / (rows - 1))
            x = corner[0] + u * math.cos(turn) - v * math.sin(-turn)
            y = corner[1] + u * math.sin(turn) - v * math.cos(turn)
            beyond = front - y
            hang = smoothstep(-0.02, 0.16, beyond)
            lift = 0.0
            for crossing, slope, bend, half, height, opening in FOLDS:
                at = crossing + slope * beyond + bend * beyond * beyond * (1 if beyond < 0 else -0.4)
                # A fold dies away towards the far edge of the sheet.
                rise = height * lerp(smoothstep(0.02, 0.22, v), 1.0 + 0.9 * hang, hang)
                lift += rise * math.exp(-(((x - at) / (half * lerp(1.0, opening, hang))) ** 2))
            lift += 0.0007 * (1 + math.sin(61 * x + 23 * y + 2 * math.sin(37 * y))) + 0.0005 * (1 + math.sin(83 * y - 40 * x))
            # One far corner stands up a little.
            lift += 0.018 * smoothstep(0.12, 0.0, math.hypot(width - u, v)) + 0.0014
            angle = min(max(beyond / roll, 0.0), math.pi / 2)
            down = max(0.0, beyond - roll * math.pi / 2)
            radius = roll + lift
            base = y if beyond < 0 else front
            points.append((x, base - radius * math.sin(angle), TABLE - TABLE_EDGE - 0.0012 + radius * math.cos(angle) - down))
    cells = [j * columns + i for j in range(rows - 1) for i in range(columns - 1)]
    triangles = [t for a in cells for t in ((a, a + 1, a + columns + 1), (a, a + columns + 1, a + columns))]
    out.material("linen")
    out.loop(points, triangles, 1)
