"""Writing of pbrt files and PLY meshes."""

import struct


def number(x):
    """The shortest decimal within a micrometre."""
    text = f"{x:.6f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def numbers(values):
    """Numbers for the inside of [ ], from numbers or tuples of them."""
    flat = [v for value in values for v in (value if isinstance(value, (tuple, list)) else (value,))]
    return " ".join(number(v) for v in flat)


def write_ply(path, mesh):
    """Writes a mesh as binary PLY."""
    uv = len(mesh.uvs) == len(mesh.points)
    names = ("x", "y", "z", "nx", "ny", "nz") + (("u", "v") if uv else ())
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(mesh.points)}"]
    header += [f"property float {name}" for name in names]
    header += [f"element face {len(mesh.triangles)}", "property list uchar int vertex_indices", "end_header", ""]
    with open(path, "wb") as file:
        file.write("\n".join(header).encode())
        for i, (p, n) in enumerate(zip(mesh.points, mesh.normals)):
            values = (*p, *n, *mesh.uvs[i]) if uv else (*p, *n)
            file.write(struct.pack(f"<{len(values)}f", *values))
        for triangle in mesh.triangles:
            file.write(struct.pack("<B3i", 3, *triangle))


class Writer:
    """Collects lines of pbrt with their indentation."""

    def __init__(self, comment):
        self.lines, self.depth = [f"# {comment}", "# Written by model.py: change that, not this."], 0

    def line(self, text=""):
        self.lines.append("  " * self.depth + text if text else "")
        return self

    def texts(self, text):
        """Several lines, in one string."""
        for line in text.strip("\n").split("\n"):
            self.line(line)
        return self

    def begin(self, kind="Attribute"):
        self.line(f"{kind}Begin")
        self.depth += 1
        return self

    def end(self, kind="Attribute"):
        self.depth -= 1
        return self.line(f"{kind}End")

    def array(self, declaration, values, per_line=12):
        """A parameter whose values fill several lines."""
        flat = [v for value in values for v in (value if isinstance(value, (tuple, list)) else (value,))]
        self.depth += 1
        self.line(f'"{declaration}" [')
        for i in range(0, len(flat), per_line):
            self.line("  " + " ".join(number(v) for v in flat[i : i + per_line]))
        self.line("]")
        self.depth -= 1
        return self

    def write(self, path):
        with open(path, "w", encoding="utf-8", newline="\n") as file:
            file.write("\n".join(self.lines) + "\n")
