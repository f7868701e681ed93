"""Measures that several parts share, in metres."""

# The room, inner faces.
WIDTH, FRONT, BACK, HEIGHT = 4.4, -1.7, 5.6, 3.0
WALL = 0.35

# All windows are in the wall x = 0: from and to in y, sill and head.
WINDOWS = ((-1.60, -0.15), (1.0, 2.45), (3.45, 4.75))
SILL, HEAD = 0.92, 2.62

# The table top.
TABLE_LOW, TABLE_HIGH = (0.55, 1.45, 0.728), (2.5, 2.35, 0.76)
TABLE_EDGE = 0.006
TABLE = TABLE_HIGH[2]

# Top of the sideboard at the back wall: from and to in x, front, height.
SIDEBOARD = (2.72, 4.06)
SIDEBOARD_FRONT, SIDEBOARD_TOP = 5.14, 0.88

# Where sunlight travels: in at the windows, towards the back wall, down.
SUN_DIRECTION = (0.748, 0.524, -0.407)
