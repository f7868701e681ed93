"""Triangle meshes: surfaces of revolution, rounded boxes, tubes. Metres; normals point out of the solid."""

import math

from .vector import add, cross, dot, length, lerp, orthogonal, scale, sub, unit


class Mesh:
    """Indexed triangles with one normal a vertex and, if `uvs` is not empty, texture coordinates."""

    def __init__(self):
        self.points, self.normals, self.uvs, self.triangles = [], [], [], []

    def append(self, other):
        """Adds the triangles of another mesh. Both have texture coordinates or none."""
        base = len(self.points)
        self.points += other.points
        self.normals += other.normals
        self.uvs += other.uvs
        self.triangles += [(a + base, b + base, c + base) for a, b, c in other.triangles]
        return self

    def moved(self, offset):
        """Translates in place."""
        self.points = [add(p, offset) for p in self.points]
        return self

    def mapped(self, position):
        """Moves each vertex from p to position(p), in place, and recomputes the normals."""
        self.points = [position(p) for p in self.points]
        return self.smooth()

    def turned(self, degrees):
        """Turns about the z axis, in place."""
        c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        turn = lambda v: (c * v[0] - s * v[1], s * v[0] + c * v[1], v[2])
        self.points = [turn(p) for p in self.points]
        self.normals = [turn(n) for n in self.normals]
        return self

    def smooth(self):
        """Sets the normals to the mean of the adjacent triangles', weighted by area; vertices at one place share it."""
        key = lambda p: (round(p[0], 7), round(p[1], 7), round(p[2], 7))
        sums = {}
        for a, b, c in self.triangles:
            pa, pb, pc = self.points[a], self.points[b], self.points[c]
            n = cross(sub(pb, pa), sub(pc, pa))
            for p in (pa, pb, pc):
                sums[key(p)] = add(sums.get(key(p), (0.0, 0.0, 0.0)), n)
        self.normals = [unit(sums.get(key(p), (0.0, 0.0, 1.0))) for p in self.points]
        return self


def spline(points, steps=6):
    """A profile for `revolve`: a centripetal Catmull-Rom curve through points (r, z), `steps` vertices a span."""
    dist = lambda a, b: max(math.hypot(b[0] - a[0], b[1] - a[1]), 1e-9) ** 0.5
    mirror = lambda end, inner: (2 * end[0] - inner[0], 2 * end[1] - inner[1])
    # At the axis the profile arrives level: its continuation is the mirror image.
    before = (-points[1][0], points[1][1]) if points[0][0] == 0 else mirror(points[0], points[1])
    after = (-points[-2][0], points[-2][1]) if points[-1][0] == 0 else mirror(points[-1], points[-2])
    padded = [before, *points, after]
    curve = []
    for i in range(1, len(padded) - 2):
        p0, p1, p2, p3 = padded[i - 1 : i + 3]
        t0, t1 = -dist(p0, p1), 0.0
        t2 = dist(p1, p2)
        t3 = t2 + dist(p2, p3)
        for k in range(steps + (i == len(padded) - 3)):
            t = t2 * k / steps
            a1 = lerp(p0, p1, (t - t0) / (t1 - t0))
            a2 = lerp(p1, p2, t / t2)
            a3 = lerp(p2, p3, (t - t2) / (t3 - t2))
            b1 = lerp(a1, a2, (t - t0) / (t2 - t0))
            b2 = lerp(a2, a3, t / t3)
            curve.append(lerp(b1, b2, t / t2))
    curve = [(max(r, 0.0), z) for r, z in curve]
    normals = []
    for i, (r, z) in enumerate(curve):
        (r0, z0), (r1, z1) = curve[max(i - 1, 0)], curve[min(i + 1, len(curve) - 1)]
        l = math.hypot(r1 - r0, z1 - z0)
        normals.append((0.0, -1.0 if i == 0 else 1.0) if r == 0 else ((z1 - z0) / l, (r0 - r1) / l))
    return [(*p, *n) for p, n in zip(curve, normals)]


def filleted(points, radius, steps=4):
    """A profile for `revolve`: a polyline of (r, z), each inner corner rounded by an arc of at most `radius`."""
    profile = []
    for i, p in enumerate(points):
        if i in (0, len(points) - 1):
            q = points[1] if i == 0 else points[-2]
            d = _unit2(_sub2(q, p) if i == 0 else _sub2(p, q))
            profile.append((*p, d[1], -d[0]))
            continue
        a, b = _sub2(p, points[i - 1]), _sub2(points[i + 1], p)
        da, db = _unit2(a), _unit2(b)
        turn = math.atan2(da[0] * db[1] - da[1] * db[0], da[0] * db[0] + da[1] * db[1])
        # Distance from the corner to the ends of the arc: no more than half of either side.
        cut = min(radius * math.tan(abs(turn) / 2), 0.49 * math.hypot(*a), 0.49 * math.hypot(*b))
        if abs(turn) < 0.02:
            profile.append((*p, da[1], -da[0]))
            continue
        r, side = cut / math.tan(abs(turn) / 2), math.copysign(1, turn)
        start = (p[0] - da[0] * cut, p[1] - da[1] * cut)
        centre = (start[0] - da[1] * r * side, start[1] + da[0] * r * side)
        for k in range(steps + 1):
            c, s = math.cos(turn * k / steps), math.sin(turn * k / steps)
            d = (da[0] * c - da[1] * s, da[0] * s + da[1] * c)
            profile.append((centre[0] + d[1] * r * side, centre[1] - d[0] * r * side, d[1], -d[0]))
    return profile


def revolve(profile, segments=64, uv=False):
    """The surface that a profile of (r, z, nr, nz) sweeps about the z axis.

    Where the profile goes up the solid is on the side of the axis: bottom, outside, rim, inside is the order of a vase.
    u runs around, v along the profile.
    """
    mesh = Mesh()
    travelled = [0.0]
    for a, b in zip(profile, profile[1:]):
        travelled.append(travelled[-1] + math.hypot(b[0] - a[0], b[1] - a[1]))
    for (r, z, nr, nz), l in zip(profile, travelled):
        for j in range(segments + 1):
            phi = 2 * math.pi * (j % segments) / segments
            c, s = math.cos(phi), math.sin(phi)
            mesh.points.append((r * c, r * s, z))
            mesh.normals.append((nr * c, nr * s, nz))
            if uv:
                mesh.uvs.append((j / segments, l / travelled[-1]))
    row = segments + 1
    for i in range(len(profile) - 1):
        for j in range(segments):
            a, b, c, d = i * row + j, i * row + j + 1, (i + 1) * row + j + 1, (i + 1) * row + j
            if profile[i][0] > 0:
                mesh.triangles.append((a, b, c))
            if profile[i + 1][0] > 0:
                mesh.triangles.append((a, c, d))
    return mesh


def box(low, high, radius, steps=1):
    """An axis-parallel box between two corners, its edges rounded by `radius`."""
    mesh = Mesh()
    centre, half = scale(add(low, high), 0.5), scale(sub(high, low), 0.5)
    radius = min(radius, *(0.49 * h for h in half))
    # Across a face: the arc of one edge, the flat, the arc of the other. `t` is the tangent of the angle of the arc.
    arc = [math.tan(math.pi / 4 * k / steps) for k in range(steps + 1)]
    line = [(-1, -t) for t in reversed(arc)] + [(1, t) for t in arc]
    for axis in range(3):
        for sign in (-1, 1):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            base, n = len(mesh.points), len(line)
            for side_v, tv in line:
                for side_u, tu in line:
                    d, corner = [0.0] * 3, [0.0] * 3
                    d[axis], d[u], d[v] = sign, tu, tv
                    corner[axis] = sign * (half[axis] - radius)
                    corner[u], corner[v] = side_u * (half[u] - radius), side_v * (half[v] - radius)
                    normal = unit(tuple(d))
                    mesh.points.append(add(add(centre, tuple(corner)), scale(normal, radius)))
                    mesh.normals.append(normal)
            for j in range(n - 1):
                for i in range(n - 1):
                    a, b, c, e = (base + j * n + i + k for k in (0, 1, n + 1, n))
                    mesh.triangles += [(a, b, c), (a, c, e)] if sign > 0 else [(a, c, b), (a, e, c)]
    return mesh


def bezier(points, count):
    """`count` points along a Bézier curve of any degree."""
    curve = []
    for i in range(count):
        t, p = i / (count - 1), list(points)
        while len(p) > 1:
            p = [lerp(a, b, t) for a, b in zip(p, p[1:])]
        curve.append(p[0])
    return curve


def tube(path, radius, sides=12, flatten=1.0):
    """A closed tube along points; `radius(t)` at t in [0, 1]. Its section is `flatten` times as wide in one direction."""
    mesh = Mesh()
    count = len(path)
    tangents = [unit(sub(path[min(i + 1, count - 1)], path[max(i - 1, 0)])) for i in range(count)]
    side = orthogonal(tangents[0])
    rings = []
    for i, (p, t) in enumerate(zip(path, tangents)):
        side = unit(sub(side, scale(t, dot(side, t))))
        other, r = cross(t, side), radius(i / (count - 1))
        rings.append((p, side, other, r))
    # Round ends: two more rings each, then a point.
    first, last = rings[0], rings[-1]
    cap = lambda ring, t, a: (add(ring[0], scale(t, ring[3] * math.sin(a))), ring[1], ring[2], ring[3] * math.cos(a))
    back, ahead = scale(tangents[0], -1), tangents[-1]
    angles = (math.pi / 2, math.pi / 3, math.pi / 6)
    rings = [cap(first, back, a) for a in angles] + rings + [cap(last, ahead, a) for a in reversed(angles)]
    for p, a, b, r in rings:
        for j in range(sides):
            phi = 2 * math.pi * j / sides
            mesh.points.append(add(p, add(scale(a, r * math.cos(phi)), scale(b, flatten * r * math.sin(phi)))))
    for i in range(len(rings) - 1):
        for j in range(sides):
            k = (j + 1) % sides
            a, b, c, d = i * sides + j, i * sides + k, (i + 1) * sides + k, (i + 1) * sides + j
            # The first and last rings are points.
            mesh.triangles += [(a, b, c)] if i > 0 else []
            mesh.triangles += [(a, c, d)] if i < len(rings) - 2 else []
    return mesh.smooth()


def _sub2(a, b):
    return (a[0] - b[0], a[1] - b[1])


def _unit2(a):
    l = math.hypot(*a)
    return (a[0] / l, a[1] / l)
