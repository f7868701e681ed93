"""Textures and materials, by name. Reflectances are linear Rec. 709."""

import math

from .part import Part

TEXT = """
# Plaster: lime wash over trowel marks.
AttributeBegin
  Scale 0.9 0.9 0.9
  Texture "blotches" "float" "wrinkled" "integer octaves" 5 "float roughness" 0.55
AttributeEnd
AttributeBegin
  Scale 0.06 0.06 0.06
  Texture "trowel" "float" "fbm" "integer octaves" 5 "float roughness" 0.55
AttributeEnd
Texture "plaster relief" "float" "scale" "texture tex" "trowel" "float scale" 0.0035
Texture "plaster tone" "spectrum" "mix" "rgb tex1" [ 0.70 0.645 0.545 ] "rgb tex2" [ 0.55 0.49 0.40 ] "texture amount" "blotches"
MakeNamedMaterial "plaster" "string type" "diffuse" "texture reflectance" "plaster tone" "texture displacement" "plaster relief"
MakeNamedMaterial "ceiling" "string type" "diffuse" "rgb reflectance" [ 0.66 0.62 0.55 ]

# Floor: cream and black marble, laid diagonally, polished by feet.
AttributeBegin
  Rotate 37 0.3 0.2 1
  Scale 0.35 0.35 0.35
  Texture "cream veins" "spectrum" "marble" "integer octaves" 7 "float variation" 0.5 "float scale" 0.6
AttributeEnd
AttributeBegin
  Rotate -20 0.1 0.5 1
  Scale 0.22 0.22 0.22
  Texture "black veins" "spectrum" "marble" "integer octaves" 7 "float variation" 0.7 "float scale" 0.7
AttributeEnd
Texture "cream marble" "spectrum" "mix" "texture tex1" "cream veins" "rgb tex2" [ 0.62 0.54 0.40 ] "float amount" 0.72
Texture "black marble bright" "spectrum" "mix" "texture tex1" "black veins" "rgb tex2" [ 0.10 0.11 0.12 ] "float amount" 0.72
Texture "black marble" "spectrum" "scale" "texture tex" "black marble bright" "float scale" 0.22
Texture "floor tone" "spectrum" "checkerboard" "string mapping" "planar" {TILE}
  "texture tex1" "cream marble" "texture tex2" "black marble"
Texture "floor joints" "float" "imagemap" "string filename" "textures/tile.png" "string mapping" "planar" {TILE}
  "string encoding" "linear" "float scale" 0.0025 "string filter" "trilinear"
AttributeBegin
  Scale 0.5 0.5 0.5
  Texture "wear" "float" "wrinkled" "integer octaves" 6 "float roughness" 0.6
AttributeEnd
Texture "floor roughness" "float" "mix" "float tex1" 0.02 "float tex2" 0.12 "texture amount" "wear"
MakeNamedMaterial "floor" "string type" "coateddiffuse" "texture reflectance" "floor tone" "texture roughness" "floor roughness"
  "texture displacement" "floor joints"

# Oak: grain along x (table, beams) or z (chair, sideboard, window frames).
AttributeBegin
  Scale 0.55 0.022 0.022
  Texture "grain x" "float" "wrinkled" "integer octaves" 6 "float roughness" 0.62
AttributeEnd
AttributeBegin
  Scale 0.022 0.022 0.55
  Texture "grain z" "float" "wrinkled" "integer octaves" 6 "float roughness" 0.62
AttributeEnd
Texture "grain relief" "float" "scale" "texture tex" "grain x" "float scale" 0.0007
Texture "oak x tone" "spectrum" "mix" "rgb tex1" [ 0.42 0.25 0.12 ] "rgb tex2" [ 0.24 0.125 0.056 ] "texture amount" "grain x"
Texture "oak z tone" "spectrum" "mix" "rgb tex1" [ 0.30 0.16 0.075 ] "rgb tex2" [ 0.16 0.08 0.037 ] "texture amount" "grain z"
Texture "oak roughness" "float" "mix" "float tex1" 0.10 "float tex2" 0.35 "texture amount" "grain x"
MakeNamedMaterial "oak" "string type" "coateddiffuse" "texture reflectance" "oak x tone" "texture roughness" "oak roughness"
  "texture displacement" "grain relief"
MakeNamedMaterial "oak upright" "string type" "coateddiffuse" "texture reflectance" "oak z tone" "float roughness" 0.25
MakeNamedMaterial "painted wood" "string type" "coateddiffuse" "rgb reflectance" [ 0.36 0.39 0.35 ] "float roughness" 0.3
MakeNamedMaterial "rush" "string type" "diffuse" "rgb reflectance" [ 0.47 0.34 0.17 ]
MakeNamedMaterial "sill" "string type" "coateddiffuse" "texture reflectance" "cream marble" "float roughness" 0.2

# Glazed ceramics.
Texture "delft vase" "spectrum" "imagemap" "string filename" "textures/vase.png" "string filter" "trilinear"
MakeNamedMaterial "delft" "string type" "coateddiffuse" "texture reflectance" "delft vase" "float roughness" 0.03
Texture "delft tiles" "spectrum" "imagemap" "string filename" "textures/tiles.png" "string filter" "trilinear"
MakeNamedMaterial "tiles" "string type" "coateddiffuse" "texture reflectance" "delft tiles" "float roughness" 0.06
AttributeBegin
  Scale 0.03 0.03 0.012
  Texture "throwing" "float" "fbm" "integer octaves" 3
AttributeEnd
Texture "glaze relief" "float" "scale" "texture tex" "throwing" "float scale" 0.0006
AttributeBegin
  Scale 0.045 0.045 0.03
  Texture "glaze pooling" "float" "wrinkled" "integer octaves" 5
AttributeEnd
Texture "celadon" "spectrum" "mix" "rgb tex1" [ 0.16 0.33 0.29 ] "rgb tex2" [ 0.10 0.26 0.24 ] "texture amount" "glaze pooling"
MakeNamedMaterial "celadon" "string type" "coateddiffuse" "texture reflectance" "celadon" "float roughness" 0.02
  "texture displacement" "glaze relief"

# Metals. Old copper is darker and redder than the pure metal.
AttributeBegin
  Scale 0.02 0.02 0.05
  Texture "tarnish" "float" "wrinkled" "integer octaves" 6 "float roughness" 0.6
AttributeEnd
AttributeBegin
  Scale 0.014 0.014 0.014
  Texture "hammering" "float" "fbm" "integer octaves" 1
AttributeEnd
Texture "hammer relief" "float" "scale" "texture tex" "hammering" "float scale" 0.0003
Texture "copper roughness" "float" "mix" "float tex1" 0.01 "float tex2" 0.08 "texture amount" "tarnish"
MakeNamedMaterial "copper" "string type" "conductor" "rgb reflectance" [ 0.88 0.52 0.36 ]
  "texture roughness" "copper roughness" "texture displacement" "hammer relief"
MakeNamedMaterial "brass" "string type" "conductor" "spectrum eta" "metal-CuZn-eta" "spectrum k" "metal-CuZn-k" "float roughness" 0.05
MakeNamedMaterial "gilt" "string type" "conductor" "spectrum eta" "metal-Au-eta" "spectrum k" "metal-Au-k" "float roughness" 0.18
MakeNamedMaterial "iron" "string type" "conductor" "rgb reflectance" [ 0.16 0.155 0.15 ] "float roughness" 0.3
MakeNamedMaterial "mirror" "string type" "conductor" "spectrum eta" "metal-Ag-eta" "spectrum k" "metal-Ag-k" "float roughness" 0

# Glass and water. Where they meet, the inside of the interface is glass and the outside water.
MakeNamedMaterial "glass" "string type" "dielectric" "float eta" 1.5
MakeNamedMaterial "glass under water" "string type" "dielectric" "float eta" 1.128
MakeNamedMaterial "water" "string type" "dielectric" "float eta" 1.33

# Fruit.
AttributeBegin
  Scale 0.0028 0.0028 0.0028
  Texture "pores" "float" "wrinkled" "integer octaves" 2
AttributeEnd
Texture "peel relief" "float" "scale" "texture tex" "pores" "float scale" 0.0005
MakeNamedMaterial "lemon" "string type" "coateddiffuse" "rgb reflectance" [ 0.78 0.58 0.06 ] "float roughness" 0.22
  "texture displacement" "peel relief"
MakeNamedMaterial "orange" "string type" "coateddiffuse" "rgb reflectance" [ 0.70 0.235 0.022 ] "float roughness" 0.2
  "texture displacement" "peel relief"
AttributeBegin
  Scale 0.012 0.012 0.02
  Texture "speckle" "float" "wrinkled" "integer octaves" 6 "float roughness" 0.65
AttributeEnd
Texture "pear skin" "spectrum" "mix" "rgb tex1" [ 0.62 0.56 0.13 ] "rgb tex2" [ 0.50 0.36 0.09 ] "texture amount" "speckle"
MakeNamedMaterial "pear" "string type" "coateddiffuse" "texture reflectance" "pear skin" "float roughness" 0.25
MakeNamedMaterial "stalk" "string type" "diffuse" "rgb reflectance" [ 0.11 0.07 0.035 ]

# Leaves let light through, and shine.
MakeNamedMaterial "leaf blade" "string type" "diffusetransmission" "rgb reflectance" [ 0.13 0.20 0.085 ] "rgb transmittance" [ 0.11 0.19 0.035 ]
MakeNamedMaterial "leaf wax" "string type" "coateddiffuse" "rgb reflectance" [ 0.12 0.19 0.08 ] "float roughness" 0.2
MakeNamedMaterial "leaf" "string type" "mix" "string materials" [ "leaf blade" "leaf wax" ] "float amount" 0.35
MakeNamedMaterial "bark" "string type" "diffuse" "rgb reflectance" [ 0.15 0.115 0.075 ]

# Linen, paper, leather, wax.
Texture "weave" "float" "imagemap" "string filename" "textures/weave.png" "string mapping" "planar"
  "vector3 v1" [ 180 0 90 ] "vector3 v2" [ 0 180 90 ] "string encoding" "linear" "float scale" 0.0004 "string filter" "trilinear"
MakeNamedMaterial "linen" "string type" "diffusetransmission" "rgb reflectance" [ 0.52 0.49 0.43 ] "rgb transmittance" [ 0.12 0.11 0.09 ]
  "texture displacement" "weave"
MakeNamedMaterial "shade" "string type" "diffusetransmission" "rgb reflectance" [ 0.42 0.38 0.30 ] "rgb transmittance" [ 0.36 0.30 0.21 ]
MakeNamedMaterial "paper" "string type" "diffuse" "rgb reflectance" [ 0.62 0.56 0.44 ]
MakeNamedMaterial "red leather" "string type" "coateddiffuse" "rgb reflectance" [ 0.24 0.045 0.03 ] "float roughness" 0.3
MakeNamedMaterial "blue leather" "string type" "coateddiffuse" "rgb reflectance" [ 0.045 0.075 0.13 ] "float roughness" 0.3
MakeNamedMaterial "wax" "string type" "diffuse" "rgb reflectance" [ 0.70 0.62 0.46 ]
MakeNamedMaterial "black" "string type" "diffuse" "rgb reflectance" [ 0.03 0.03 0.03 ]
"""


def write():
    out = Part("materials", "Textures and materials.")
    # Square tiles of 30 cm, turned by 45 degrees.
    side = math.sqrt(0.5) / 0.30
    tile = f'"vector3 v1" [ {side:.4f} {side:.4f} 0 ] "vector3 v2" [ {-side:.4f} {side:.4f} 0 ]'
    out.texts(TEXT.replace("{TILE}", tile))
    out.save()
