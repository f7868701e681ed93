"""The parts of the scene, one file of pbrt each. z is up, the window wall is x = 0, the camera looks along +y."""
