"""Tools to model in plain Python: vectors, meshes, images, and the writing of pbrt files."""
