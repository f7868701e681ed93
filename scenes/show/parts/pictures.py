"""The images of the scene, drawn here: sun, floor tile, weave, Delft vase and tiles."""

import math
import os

from modelling.images import encode_srgb, octahedral_point, write_png
from modelling.vector import lerp, scale, smoothstep, unit

from .layout import SUN_DIRECTION
from .part import ROOT

# The hue of the sun; pigments of the ceramics.
SUN = (1.0, 0.732, 0.446)
WHITE, BLUE = (0.80, 0.80, 0.76), (0.035, 0.075, 0.30)


def write():
    save = lambda name, width, height, pixel: write_png(os.path.join(ROOT, "textures", name), width, height, pixel)
    save("sun.png", SUN_MAP, SUN_MAP, sun())
    save("tile.png", 128, 128, tile)
    save("weave.png", 32, 32, weave)
    save("vase.png", 512, 256, lambda x, y: encoded(vase((x + 0.5) / 512, 1 - (y + 0.5) / 256)))
    save("tiles.png", 512, 128, lambda x, y: encoded(delft_tile(x // 128, (x % 128 + 0.5) / 128, 1 - (y + 0.5) / 128)))


def encoded(radiance):
    return tuple(encode_srgb(v) for v in radiance)


SUN_MAP = 1024
SUN_TEXELS = 2.3


def sun():
    """pixel(x, y) of an environment map, black but for a sun of about 1.6 degrees across, as in haze."""
    u, v = octahedral_point(scale(unit(SUN_DIRECTION), -1))

    def pixel(x, y):
        distance = math.hypot(x + 0.5 - u * SUN_MAP, y + 0.5 - v * SUN_MAP)
        cover = min(max(SUN_TEXELS + 0.5 - distance, 0.0), 1.0)
        return encoded(scale(SUN, cover)) if cover > 0 else (0.0, 0.0, 0.0)

    return pixel


def tile(x, y):
    """Height of a floor tile: level, with rounded edges to joints of 3 mm. The texture's cell is a tile."""
    edge = min(x + 0.5, y + 0.5, 127.5 - x, 127.5 - y) / 128 * 300
    height = smoothstep(1.0, 3.5, edge)
    return (height, height, height)


def weave(x, y):
    """Height of a plain weave: two warp and two weft threads."""
    u, v = 2 * (x + 0.5) / 32, 2 * (y + 0.5) / 32
    warp = abs(math.sin(math.pi * u)) * (0.5 + 0.5 * math.sin(math.pi * v + math.pi * (int(u) % 2)))
    weft = abs(math.sin(math.pi * v)) * (0.5 - 0.5 * math.sin(math.pi * u + math.pi * (int(v) % 2)))
    return (max(warp, weft),) * 3


def ink(amount):
    """White glaze with that much cobalt in it; brush strokes pool at their middle."""
    return lerp(WHITE, BLUE, min(max(amount, 0.0), 1.0))


def stroke(distance, width, softness=0.25):
    """1 within `width` of a line, 0 outside."""
    return 1 - smoothstep(width * (1 - softness), width * (1 + softness), abs(distance))


def petals(x, y, count, radius, turn=0.0):
    """A flower around the origin."""
    r, a = math.hypot(x, y), math.atan2(y, x) + turn
    shape = radius * (0.62 + 0.38 * abs(math.cos(count * a / 2)))
    fill = (0.35 + 0.5 * smoothstep(0, shape, r)) * (1 - smoothstep(shape * 0.93, shape * 1.04, r))
    outline = stroke(r - shape, radius * 0.07)
    heart = 1 - smoothstep(radius * 0.16, radius * 0.22, r)
    return max(fill, outline, heart)


def vase(u, v):
    """Around and up the vase: bands at foot and neck, flowers and scrolls on the belly, leaves on the shoulder."""
    amount = 0.0
    for centre, width in ((0.045, 0.012), (0.10, 0.004), (0.12, 0.004), (0.655, 0.005), (0.68, 0.005), (0.93, 0.005), (0.975, 0.014)):
        amount = max(amount, 0.85 * stroke(v - centre, width))
    # Belly: the girth is about 55 cm, the height 27.
    cells = 5
    x, y = ((u * cells) % 1 - 0.5) * 0.55 / cells, (v - 0.40) * 0.268
    amount = max(amount, petals(x, y, 6, 0.030))
    vine = 0.022 * math.sin(2 * math.pi * u * cells)
    across = ((u * cells + 0.5) % 1 - 0.5) * 0.55 / cells
    amount = max(amount, 0.7 * stroke(y - vine, 0.0016) * smoothstep(0.024, 0.034, abs(x)))
    for side in (-1, 1):
        for ax, ay, turn in ((0.012, 0.018, 0.8), (0.014, -0.022, -0.7), (-0.004, 0.040, 1.4)):
            px, py = side * across - ax, side * y - ay
            c, s = math.cos(turn), math.sin(turn)
            along, off = c * px + s * py, -s * px + c * py
            amount = max(amount, 0.75 * (1 - smoothstep(0.8, 1.05, (along / 0.015) ** 2 + (off / 0.0052) ** 2)))
    # Foot and neck: pointed leaves.
    for low, high, count in ((0.125, 0.19, 22), (0.70, 0.90, 12)):
        t = (v - low) / (high - low)
        if 0 < t < 1:
            half = 0.42 * math.sin(math.pi * min(1.0, 0.25 + 0.75 * t))
            amount = max(amount, 0.7 * (1 - smoothstep(half * 0.8, half, abs((u * count) % 1 - 0.5))))
    return ink(amount)


def delft_tile(kind, x, y):
    """One of four tiles: corner ornaments around a small picture; a joint at the edge."""
    px, py = x - 0.5, y - 0.5
    edge = 0.5 - max(abs(px), abs(py))
    if edge < 0.012:
        return (0.34, 0.32, 0.28)
    # A quarter of a flower in each corner.
    amount = 0.8 * petals(0.5 - abs(px), 0.5 - abs(py), 8, 0.13)
    if kind == 0:  # A tulip.
        bloom = math.hypot(px / 0.11, (py - 0.10) / 0.15)
        teeth = 0.10 + 0.07 * abs(math.sin(px * 28))
        amount = max(amount, 0.75 * (1 - smoothstep(0.92, 1.02, bloom)) * (1 - smoothstep(0, 0.02, py - 0.10 - teeth)))
        amount = max(amount, 0.8 * stroke(px, 0.010) * (-0.26 < py < 0.0))
        for side in (-1, 1):
            amount = max(amount, 0.6 * stroke(py + 0.24 - 1.6 * side * px + 3.0 * px * px, 0.03) * (0 < side * px < 0.16))
    elif kind == 1:  # A ship.
        hull = -0.16 + 0.9 * px * px
        amount = max(amount, 0.85 * (hull < py < hull + 0.07) * (abs(px) < 0.2))
        for mast, top in ((-0.09, 0.14), (0.05, 0.24)):
            amount = max(amount, 0.8 * stroke(px - mast, 0.008) * (-0.12 < py < top))
            sail = 0.10 * math.sin(math.pi * min(max((py + 0.06) / (top + 0.04), 0), 1)) ** 0.5
            amount = max(amount, 0.45 * (0.012 < px - mast < sail))
        amount = max(amount, 0.5 * stroke(py + 0.21 + 0.015 * math.sin(40 * px), 0.010) * (abs(px) < 0.28))
    elif kind == 2:  # A flower in a ring.
        amount = max(amount, petals(px, py, 5, 0.17, 0.4), 0.6 * stroke(math.hypot(px, py) - 0.25, 0.009))
    else:  # A windmill.
        amount = max(amount, 0.7 * (-0.24 < py < 0.06) * (abs(px) < 0.06 - 0.12 * py))
        for k in range(4):
            a = math.pi / 4 + k * math.pi / 2 + 0.2
            along, off = math.cos(a) * px + math.sin(a) * (py - 0.08), -math.sin(a) * px + math.cos(a) * (py - 0.08)
            amount = max(amount, 0.85 * stroke(off, 0.008) * (0 < along < 0.22), 0.45 * (0 < off < 0.045) * (0.05 < along < 0.22))
        amount = max(amount, 0.5 * stroke(py + 0.25 + 0.01 * math.sin(30 * px), 0.012) * (abs(px) < 0.3))
    return ink(amount)
