"""Writes an open tank as STL: python tank.py X0,Y0,Z0 X1,Y1,Z1 tank.stl, with y up."""

import sys

low, high = ([float(v) for v in corner.split(",")] for corner in sys.argv[1:3])


def corner(x, y, z):
    return [(low, high)[bit][axis] for axis, bit in enumerate((x, y, z))]


def side(a, b, c, d):
    return [(a, b, c), (a, c, d)]


triangles = []
for z in (0, 1):
    triangles += side(corner(0, 0, z), corner(1, 0, z), corner(1, 1, z), corner(0, 1, z))
for x in (0, 1):
    triangles += side(corner(x, 0, 0), corner(x, 1, 0), corner(x, 1, 1), corner(x, 0, 1))

with open(sys.argv[3], "w") as file:
    file.write("solid tank\n")
    for triangle in triangles:
        file.write("facet normal 0 0 0\nouter loop\n")
        for vertex in triangle:
            file.write("vertex %g %g %g\n" % tuple(vertex))
        file.write("endloop\nendfacet\n")
    file.write("endsolid tank\n")
