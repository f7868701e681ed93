"""Walls, floor, ceiling, windows, skirting."""

from modelling.mesh import Mesh, box

from .layout import BACK, FRONT, HEAD, HEIGHT, SILL, WALL, WIDTH, WINDOWS
from .part import Part

TILE = 0.13


def write():
    out = Part("room", "The room: window wall x = 0, back wall y = 5.6.")
    out.line()
    floor(out)
    walls(out)
    windows(out)
    skirting(out)
    beams(out)
    out.save()


def floor(out):
    out.material("floor")
    out.patch((-WALL, FRONT, 0), (WIDTH, FRONT, 0), (-WALL, BACK, 0), (WIDTH, BACK, 0))


def walls(out):
    out.material("plaster")
    out.patch((-WALL, BACK, 0), (WIDTH, BACK, 0), (-WALL, BACK, HEIGHT), (WIDTH, BACK, HEIGHT))
    out.patch((WIDTH, BACK, 0), (WIDTH, FRONT, 0), (WIDTH, BACK, HEIGHT), (WIDTH, FRONT, HEIGHT))
    out.patch((WIDTH, FRONT, 0), (-WALL, FRONT, 0), (WIDTH, FRONT, HEIGHT), (-WALL, FRONT, HEIGHT))
    # The window wall: piers between the windows, then parapets and lintels.
    wall = Mesh()
    edges = [FRONT - 0.1] + [y for window in WINDOWS for y in window] + [BACK + 0.1]
    for low, high in zip(edges[::2], edges[1::2]):
        wall.append(box((-WALL, low, -0.1), (0, high, HEIGHT + 0.1), 0.018))
    for low, high in WINDOWS:
        # Deeper into the piers than their edges are round.
        wall.append(box((-WALL, low - 0.05, -0.1), (0, high + 0.05, SILL), 0.002))
        wall.append(box((-WALL, low - 0.05, HEAD), (0, high + 0.05, HEIGHT + 0.1), 0.002))
    out.mesh("wall", wall, "plaster")
    out.material("ceiling")
    out.patch((-WALL, FRONT, HEIGHT), (-WALL, BACK, HEIGHT), (WIDTH, FRONT, HEIGHT), (WIDTH, BACK, HEIGHT))


def windows(out):
    """Sills, and frames of two lights under two smaller ones, without panes: it is a warm evening."""
    sills, frames = Mesh(), Mesh()
    x0, x1 = -0.27, -0.20
    for low, high in WINDOWS:
        sills.append(box((-WALL - 0.04, low - 0.045, SILL), (0.035, high + 0.045, SILL + 0.03), 0.01, 3))
        foot, middle, transom = SILL + 0.03, (low + high) / 2, SILL + 1.12
        bar = lambda a, b: frames.append(box(a, b, 0.006))
        for y in (low, high - 0.06):
            bar((x0, y, foot), (x1, y + 0.06, HEAD))
        bar((x0, middle - 0.035, foot), (x1, middle + 0.035, HEAD))
        for z in (foot, transom, HEAD - 0.06):
            bar((x0 + 0.005, low + 0.02, z), (x1 - 0.005, high - 0.02, z + 0.06))
        for a, b in ((low, middle), (middle, high)):
            for z in (foot + 0.38, foot + 0.74):
                bar((x0 + 0.02, a, z), (x1 - 0.02, b, z + 0.022))
            y = (a + b) / 2
            bar((x0 + 0.02, y - 0.011, foot), (x1 - 0.02, y + 0.011, HEAD))
    out.mesh("sills", sills, "sill")
    out.mesh("frames", frames, "painted wood")


def skirting(out):
    """A row of tiles along the back and right walls, a tile of the image each 13 cm."""
    out.material("tiles")
    depth, top = 0.012, 2 * TILE
    for a, b in (((0, BACK - depth), (WIDTH, BACK - depth)), ((round(WIDTH - depth, 3), BACK), (round(WIDTH - depth, 3), FRONT))):
        length = abs(b[0] - a[0]) + abs(b[1] - a[1])
        points = f"{a[0]} {a[1]} 0  {b[0]} {b[1]} 0  {a[0]} {a[1]} {top}  {b[0]} {b[1]} {top}"
        u, v = length / (4 * TILE), top / TILE
        out.line(f'Shape "bilinearmesh" "point3 P" [ {points} ] "point2 uv" [ 0 0  {u:.4f} 0  0 {v:.4f}  {u:.4f} {v:.4f} ]')
    cap = Mesh()
    cap.append(box((0, BACK - 0.022, top), (WIDTH + 0.1, BACK + 0.1, top + 0.018), 0.006))
    cap.append(box((WIDTH - 0.022, FRONT - 0.1, top), (WIDTH + 0.1, BACK + 0.1, top + 0.018), 0.006))
    out.mesh("skirting", cap, "oak upright")


def beams(out):
    """Ceiling beams: one, and copies of it."""
    out.line('ObjectBegin "beam"')
    out.mesh("beam", box((-0.2, -0.08, HEIGHT - 0.2), (WIDTH + 0.2, 0.08, HEIGHT + 0.1), 0.012), "oak")
    out.line("ObjectEnd")
    y = FRONT + 0.45
    while y < BACK:
        out.begin().line(f"Translate 0 {y:.2f} 0").line('ObjectInstance "beam"').end()
        y += 0.78
