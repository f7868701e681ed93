"""Table, chair, sideboard with lamp, mirror."""

import math

from modelling.mesh import Mesh, bezier, box, filleted, revolve, spline, tube

from .layout import BACK, SIDEBOARD, SIDEBOARD_FRONT, SIDEBOARD_TOP, TABLE_EDGE, TABLE_HIGH, TABLE_LOW
from .part import Part


def write():
    out = Part("furniture", "Table, chair, sideboard with lamp and books, convex mirror.")
    out.line()
    table(out)
    chair(out)
    sideboard(out)
    lamp(out, 3.72, 5.36)
    books(out, 3.02, 5.38)
    candlestick(out, 3.38, 5.40)
    mirror(out, 2.78, 1.86)
    out.save()


def table(out):
    out.mesh("table_top", box(TABLE_LOW, TABLE_HIGH, TABLE_EDGE, 4), "oak")
    (x0, y0, z), (x1, y1, _) = TABLE_LOW, TABLE_HIGH
    frame, inset, leg = Mesh(), 0.07, 0.035
    for y in (y0 + inset, y1 - inset):
        frame.append(box((x0 + 0.11, y - 0.012, z - 0.09), (x1 - 0.11, y + 0.012, z), 0.003))
    for x in (x0 + inset, x1 - inset):
        frame.append(box((x - 0.012, y0 + 0.11, z - 0.09), (x + 0.012, y1 - 0.11, z), 0.003))
    turning = filleted(
        [(0, 0), (0.028, 0), (0.036, 0.03), (0.024, 0.06), (0.03, 0.075), (0.022, 0.09), (0.026, 0.2), (0.034, 0.36)]
        + [(0.036, 0.42), (0.024, 0.49), (0.024, 0.5), (0.034, 0.515), (0.024, 0.53), (0.024, 0.56), (0, 0.56)],
        0.012,
        3,
    )
    for x in (x0 + inset, x1 - inset):
        for y in (y0 + inset, y1 - inset):
            frame.append(revolve(turning, 20).moved((x, y, 0)))
            frame.append(box((x - leg, y - leg, 0.555), (x + leg, y + leg, z), 0.004))
    out.mesh("table_frame", frame, "oak upright")


def chair(out):
    """A ladder-back chair with a rush seat, its back to the wall."""
    wood = Mesh()
    w, d, seat = 0.21, 0.19, 0.44
    post = lambda points, r: wood.append(tube(bezier(points, 12), lambda t: r * (1 - 0.15 * t), 12))
    for x in (-w, w):
        post([(x, -d, 0.019), (x, -d, seat + 0.035)], 0.019)
        # The back posts lean.
        post([(x, d, 0.019), (x, d, 0.4), (x, d, 0.55), (x * 1.05, d + 0.09, 1.02)], 0.019)
        for z in (0.16, 0.30):
            post([(x, -d, z), (x, d, z)], 0.011)
    for y, z in ((-d, 0.20), (-d, 0.33), (d, 0.22)):
        post([(-w, y, z), (w, y, z)], 0.011)
    for z in (0.58, 0.74, 0.90):
        lean = 0.09 * ((z - 0.44) / 0.58) ** 2
        bow = lambda p, lean=lean: (p[0], p[1] + d + lean + 0.035 * (1 - (p[0] / w) ** 2), p[2])
        wood.append(_subdivided_slat(w, z, bow))
    out.begin().place(1.72, 4.88, 0, (0.94, -0.342, 0), (0.342, 0.94, 0))
    out.mesh("chair", wood, "oak upright")
    out.mesh("seat", _rush_seat(w, d, seat), "rush")
    out.end()


def _subdivided_slat(w, z, bow):
    """A slat from post to post, its upper edge arched."""
    mesh, columns = Mesh(), 13
    section = [(-0.006, 0.0), (-0.006, 1.0), (-0.003, 1.06), (0.003, 1.06), (0.006, 1.0), (0.006, 0.0)]
    for i in range(columns):
        x = -w + 2 * w * i / (columns - 1)
        height = 0.06 + 0.03 * math.cos(math.pi * x / (2 * w))
        mesh.points += [bow((x, y, z + v * height)) for y, v in section]
    n = len(section)
    for i in range(columns - 1):
        for k in range(n):
            a, b = i * n + k, i * n + (k + 1) % n
            mesh.triangles += [(a, a + n, b + n), (a, b + n, b)]
    return mesh.smooth()


def _rush_seat(w, d, z):
    """Strands wound around the frame: they run towards the middle from all four sides."""
    mesh, n = Mesh(), 49
    for j in range(n):
        for i in range(n):
            u, v = 2 * i / (n - 1) - 1, 2 * j / (n - 1) - 1
            across = u if abs(u) < abs(v) else v
            strand = abs(math.sin(across * math.pi * 12))
            edge = max(abs(u), abs(v))
            sag = -0.012 * (1 - u * u) * (1 - v * v)
            roll = -0.02 * max(0.0, (edge - 0.9) / 0.1) ** 2
            mesh.points.append((u * (w + 0.012), v * (d + 0.012), z + 0.012 + sag + roll + 0.0022 * strand))
    for j in range(n - 1):
        for i in range(n - 1):
            a = j * n + i
            mesh.triangles += [(a, a + 1, a + n + 1), (a, a + n + 1, a + n)]
    return mesh.smooth()


def sideboard(out):
    (x0, x1), y0, top = SIDEBOARD, SIDEBOARD_FRONT, SIDEBOARD_TOP
    y1 = BACK - 0.025
    body, panels, knobs = Mesh(), Mesh(), Mesh()
    body.append(box((x0, y0, top - 0.028), (x1, y1, top), 0.007, 3))
    body.append(box((x0 + 0.03, y0 + 0.035, 0.10), (x1 - 0.03, y1, top - 0.028), 0.004))
    body.append(box((x0 + 0.015, y0 + 0.015, 0), (x1 - 0.015, y1, 0.10), 0.006))
    # Two drawers over two doors; fronts stand 14 mm before the body, fields 6 mm more.
    front, middle = y0 + 0.021, (x0 + x1) / 2
    for a, b in ((x0 + 0.05, middle - 0.012), (middle + 0.012, x1 - 0.05)):
        for low, high in ((0.13, 0.63), (0.655, 0.83)):
            panels.append(box((a, front, low), (b, front + 0.03, high), 0.004))
            m = 0.055 if high < 0.7 else 0.03
            panels.append(box((a + m, front - 0.006, low + m), (b - m, front + 0.02, high - m), 0.005))
        knob_x = b - 0.03 if b < middle else a + 0.03
        for x, y, z in ((knob_x, front, 0.42), ((a + b) / 2, front - 0.006, 0.742)):
            knob = revolve(spline([(0.006, -0.004), (0.006, 0.006), (0.012, 0.016), (0.009, 0.022), (0, 0.024)], 4), 20)
            # Its axis points out of the front.
            turn = lambda p, x=x, y=y, z=z: (x + p[0], y - p[2], z + p[1])
            knobs.append(knob.mapped(turn))
    out.mesh("sideboard", body, "oak upright")
    out.mesh("fronts", panels, "oak upright")
    out.mesh("knobs", knobs, "brass")


def lamp(out, x, y):
    """A brass lamp with a shade of parchment, lit."""
    foot = spline(
        [(0, 0.002), (0.05, 0), (0.066, 0.002), (0.068, 0.008), (0.05, 0.017), (0.026, 0.03), (0.018, 0.06), (0.036, 0.10)]
        + [(0.045, 0.14), (0.036, 0.18), (0.016, 0.215), (0.013, 0.23), (0.013, 0.26), (0.0, 0.261)]
    )
    out.begin().line(f"Translate {x} {y} {SIDEBOARD_TOP}")
    out.mesh("lamp", revolve(foot, 40), "brass")
    shade = [(0.135, 0.27), (0.115, 0.35), (0.095, 0.43)]
    slope = (0.97, 0.243)
    out.mesh("shade", revolve([(r, z, *slope) for r, z in shade], 64), "shade")
    out.mesh("shade_rims", _rings(((0.135, 0.27), (0.095, 0.43))), "brass")
    spokes = Mesh()
    for k in range(3):
        spokes.append(tube([(0, 0, 0.425), (0.047, 0, 0.427), (0.094, 0, 0.43)], lambda t: 0.0015, 8).turned(120 * k + 20))
    spokes.append(tube([(0, 0, 0.25), (0, 0, 0.29)], lambda t: 0.011, 16))
    spokes.append(tube([(0.012, 0, 0.27), (0.03, 0, 0.35), (0.0, 0, 0.425)], lambda t: 0.0015, 8))
    out.mesh("shade_spokes", spokes, "brass")
    out.line("Translate 0 0 0.325").material("black").line('AreaLightSource "diffuse" "rgb L" [ 110 61 27 ]')
    out.line('Shape "sphere" "float radius" 0.024')
    out.end()


def _rings(circles, wire=0.0025):
    mesh = Mesh()
    for r, z in circles:
        arc = [2 * math.pi * k / 8 for k in range(9)]
        mesh.append(revolve([(r + wire * math.cos(a), z + wire * math.sin(a), math.cos(a), math.sin(a)) for a in arc], 64))
    return mesh


def books(out, x, y):
    """Three books lying on one another."""
    z = SIDEBOARD_TOP
    for name, cover, size, turn in (
        ("book_a", "red leather", (0.25, 0.19, 0.042), 4),
        ("book_b", "blue leather", (0.23, 0.165, 0.03), -9),
        ("book_c", "paper", (0.19, 0.13, 0.022), 14),
    ):
        w, d, h = size
        boards, pages = Mesh(), Mesh()
        boards.append(box((-w / 2, -d / 2, 0), (w / 2, d / 2, 0.003), 0.001))
        boards.append(box((-w / 2, -d / 2, h - 0.003), (w / 2, d / 2, h), 0.001))
        # The back of the book is towards the room.
        boards.append(box((-w / 2, -d / 2 - 0.004, 0), (w / 2, -d / 2 + 0.003, h), 0.0019, 3))
        pages.append(box((-w / 2 + 0.005, -d / 2 + 0.003, 0.003), (w / 2 - 0.005, d / 2 - 0.005, h - 0.003), 0.0008))
        out.begin().line(f"Translate {x} {y} {z:.4f}").line(f"Rotate {turn} 0 0 1")
        out.mesh(name, boards, cover)
        out.mesh(name + "_pages", pages, "paper")
        out.end()
        z += h


def candlestick(out, x, y):
    turning = filleted(
        [(0, 0.003), (0.05, 0.003), (0.052, 0), (0.06, 0), (0.06, 0.008), (0.045, 0.016), (0.018, 0.026), (0.012, 0.05)]
        + [(0.022, 0.065), (0.022, 0.07), (0.011, 0.085), (0.015, 0.13), (0.009, 0.16), (0.03, 0.175), (0.03, 0.181)]
        + [(0.016, 0.183), (0.016, 0.205), (0.0125, 0.205), (0.0125, 0.185), (0, 0.185)],
        0.006,
    )
    out.begin().line(f"Translate {x} {y} {SIDEBOARD_TOP}")
    out.mesh("candlestick", revolve(turning, 24), "brass")
    candle = spline([(0, 0.1855), (0.010, 0.186), (0.0115, 0.188), (0.0112, 0.28), (0.0105, 0.355), (0.0085, 0.360), (0.004, 0.358), (0, 0.357)])
    out.mesh("candle", revolve(candle, 24), "wax")
    out.material("black").line('Shape "curve" "string type" "cylinder" "float width" 0.0016')
    out.array("point3 P", [(0, 0, 0.356), (0, 0, 0.361), (0.001, 0, 0.365), (0.003, 0, 0.368)])
    out.end()


def mirror(out, x, z):
    """A convex mirror in a gilt frame: a cap of a sphere that shows the whole room."""
    rim, bulge = 0.235, 0.055
    radius = (rim * rim + bulge * bulge) / (2 * bulge)
    # Local z points into the room, as does the cap.
    out.begin().place(x, BACK, z, (1, 0, 0), (0, 0, 1), (0, -1, 0))
    out.begin().line(f"Translate 0 0 {0.022 + bulge - radius:.5f}").material("mirror")
    out.line(f'Shape "sphere" "float radius" {radius:.5f} "float zmin" {radius - bulge:.5f} "float zmax" {radius:.5f}')
    out.end()
    frame = spline(
        [(0.222, 0.001), (0.30, 0.001), (0.318, 0.004), (0.322, 0.014), (0.315, 0.024), (0.302, 0.027), (0.296, 0.024)]
        + [(0.288, 0.026), (0.272, 0.043), (0.256, 0.047), (0.246, 0.040), (0.243, 0.034), (0.238, 0.036), (0.234, 0.032)]
        + [(0.231, 0.020), (0.231, 0.006)],
        4,
    )
    out.mesh("mirror_frame", revolve(frame, 64), "gilt")
    out.end()
