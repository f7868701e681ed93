"""One included file with its meshes."""

import os

from modelling.pbrt import Writer, numbers, write_ply

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))


class Part(Writer):
    """A file of shapes beside show.pbrt; its meshes are in geometry/."""

    def __init__(self, name, comment):
        super().__init__(comment)
        self.name = name

    def material(self, name):
        return self.line(f'NamedMaterial "{name}"')

    def mesh(self, name, mesh, material):
        """A mesh in its place."""
        file = f"geometry/{name}.ply"
        write_ply(os.path.join(ROOT, file), mesh)
        return self.material(material).line(f'Shape "plymesh" "string filename" "{file}"')

    def loop(self, points, triangles, levels):
        """A Loop subdivision surface of the current material."""
        self.line(f'Shape "loopsubdiv" "integer levels" {levels}')
        return self.array("integer indices", triangles, 24).array("point3 P", points)

    def patch(self, p00, p10, p01, p11):
        """A bilinear patch of the current material; its normal is (p10 - p00) x (p01 - p00)."""
        return self.line(f'Shape "bilinearmesh" "point3 P" [ {numbers((p00, p10, p01, p11))} ]')

    def place(self, x, y, z, x_axis=(1, 0, 0), y_axis=(0, 1, 0), z_axis=(0, 0, 1)):
        """The transform of what follows: axes and origin."""
        axes = (*x_axis, 0, *y_axis, 0, *z_axis, 0, x, y, z, 1)
        return self.line(f"ConcatTransform [ {numbers(axes)} ]")

    def save(self):
        self.write(os.path.join(ROOT, f"{self.name}.pbrt"))
