#!/usr/bin/env python3
"""Writes the show scene: show.pbrt, the files it includes, geometry/ and textures/.

A room with windows to the left, a still life on a table, late sun on floor and wall: most of what one sees is lit by
light that has bounced at least once. Everything is modelled here, in metres, by the standard library alone; the same
files come out of every run.
"""

import math
import os

from modelling.pbrt import Writer, number, numbers
from modelling.vector import lerp, scale, smoothstep
from parts import branches, furniture, materials, pictures, room, still_life
from parts.layout import HEAD, SILL, SUN_DIRECTION, WALL, WINDOWS
from parts.part import ROOT

EYE, TARGET = (2.20, -0.12, 1.47), (1.86, 3.0, 1.04)
FIELD_OF_VIEW = 34

# Radiances. The sun gives about six times the irradiance of the sky at the windows.
SUN_SCALE = 73000.0
SKY, MEADOW = (9.0, 10.2, 12.0), (7.5, 8.0, 6.5)

PARTS = (materials, room, furniture, still_life, branches)


def view(out):
    out.line("# Mirrored in x: the world is right-handed, pbrt's camera space is not.")
    out.line("Scale -1 1 1")
    out.line(f"LookAt {numbers((EYE, TARGET, (0, 0, 1)))}")
    # In focus: the middle of the table.
    out.line(f'Camera "perspective" "float fov" {FIELD_OF_VIEW} "float lensradius" 0.006 "float focaldistance" 2.42')
    out.line('Film "rgb" "integer xresolution" 1280 "integer yresolution" 720 "float iso" 210 "string filename" "show.exr"')
    out.line('PixelFilter "gaussian" "float xradius" 1.5 "float yradius" 1.5 "float sigma" 0.5')
    out.line('Sampler "zsobol" "integer pixelsamples" 256')
    out.line('Integrator "path" "integer maxdepth" 16')


def sun(out):
    out.line("# The sun, alone in a black environment.")
    out.line(f'LightSource "infinite" "string filename" "textures/sun.png" "float scale" {number(SUN_SCALE)}')


def sky(out):
    """The sky in the windows: blades of light like those of a blind, their edges to the sun.

    Seen from the room they close the windows, and all of their light comes in; the sunbeams pass between them. Nearly all
    samples of an environment would end at the walls instead. What little shows between the blades is a uniform sky, which
    needs no light samples.
    """
    out.line("# The sky in the windows.")
    x, reach, pitch = -WALL - 0.02, 0.25, 0.075
    out.begin().line('NamedMaterial "black"')
    for low, high in WINDOWS:
        count = math.ceil((HEAD - SILL) / pitch)
        for k in range(count + 1):
            z = SILL + 0.02 + (HEAD - SILL) * k / count
            # Within a plane of the sunlight and a line along the window.
            rise = SUN_DIRECTION[2] / -SUN_DIRECTION[0] * reach
            flare = 0.9 * reach
            inner = ((x, low - 0.02, z), (x, high + 0.02, z))
            outer = ((x - reach, low - 0.02 - flare, z + rise), (x - reach, high + 0.02 + flare, z + rise))
            tint = lerp(MEADOW, SKY, smoothstep(0.0, 0.45, k / count))
            out.line(f'AreaLightSource "diffuse" "bool twosided" true "rgb L" [ {numbers(tint)} ]')
            out.line(f'Shape "bilinearmesh" "point3 P" [ {numbers((*inner, *outer))} ]')
    out.end()
    out.line(f'LightSource "infinite" "rgb L" [ {numbers(scale(SKY, 0.5))} ]')


def main():
    for folder in ("geometry", "textures"):
        os.makedirs(os.path.join(ROOT, folder), exist_ok=True)
    pictures.write()
    for part in PARTS:
        part.write()
    out = Writer("A still life in a room with windows to the left.")
    out.line()
    view(out)
    out.line().line("WorldBegin").line()
    sun(out)
    out.line()
    for part in PARTS:
        if part is room:
            sky(out)
        out.line(f'Include "{part.__name__.split(".")[-1]}.pbrt"')
    out.write(os.path.join(ROOT, "show.pbrt"))


if __name__ == "__main__":
    main()
