"""Small images: 8-bit PNG, and the map from directions to pbrt's equal-area octahedral square."""

import math
import struct
import zlib


def write_png(path, width, height, pixel):
    """Writes an image whose pixel(x, y), y down, is an sRGB-encoded triple in [0, 1]."""
    rows = bytearray()
    for y in range(height):
        rows.append(0)
        for x in range(width):
            rows += bytes(min(max(round(255 * v), 0), 255) for v in pixel(x, y))
    chunk = lambda kind, data: struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header))
        file.write(chunk(b"IDAT", zlib.compress(bytes(rows), 9)) + chunk(b"IEND", b""))


def encode_srgb(linear):
    """The stored value of a linear one, both in [0, 1]."""
    linear = min(max(linear, 0.0), 1.0)
    return 12.92 * linear if linear <= 0.0031308 else 1.055 * linear ** (1 / 2.4) - 0.055


def octahedral_point(d):
    """The point in [0, 1]² of the equal-area octahedral square [Clarberg 2008] for a unit direction, z up."""
    r = math.sqrt(max(0.0, 1 - abs(d[2])))
    # The angle within a quadrant tells how r is shared out.
    share = math.atan2(abs(d[1]), abs(d[0])) / (math.pi / 2) * r
    u, v = r - share, share
    if d[2] < 0:
        u, v = 1 - v, 1 - u
    return (0.5 + 0.5 * math.copysign(u, d[0]), 0.5 + 0.5 * math.copysign(v, d[1]))
