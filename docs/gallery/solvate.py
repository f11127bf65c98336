"""Puts a molecule into water with sodium and chloride: python solvate.py MOLECULE.pdb OUT.pdb

The water is a jittered lattice with the density of the liquid, not an equilibrium.
"""

import math
import random
import sys

MARGIN = 8.0  # from the molecule to the sides of the box, angstroms
STEP = 3.1  # distance of molecules of water
CLEAR = 2.6  # smallest distance between water and the molecule
random.seed(3)

lines = [line.rstrip() for line in open(sys.argv[1]) if line.startswith("ATOM")]
atoms = [tuple(float(line[start:start + 8]) for start in (30, 38, 46)) for line in lines]
low = [min(atom[axis] for atom in atoms) - MARGIN for axis in range(3)]
high = [max(atom[axis] for atom in atoms) + MARGIN for axis in range(3)]


def direction():
    turn = [random.gauss(0, 1) for _ in range(3)]
    length = math.sqrt(sum(part * part for part in turn))
    return [part / length for part in turn]


def hydrogens(oxygen):
    """Two hydrogens at 0.96 angstroms and an angle of 104.5 degrees."""
    first, other = direction(), direction()
    along = sum(a * b for a, b in zip(first, other))
    across = [b - along * a for a, b in zip(first, other)]
    length = math.sqrt(sum(part * part for part in across))
    angle = math.radians(104.5)
    second = [math.cos(angle) * a + math.sin(angle) * b / length for a, b in zip(first, across)]
    return [[o + 0.96 * part for o, part in zip(oxygen, way)] for way in (first, second)]


def row(name, residue, number, place, element):
    serial = len(lines) + 1
    x, y, z = place
    return (f"HETATM{serial:5d} {name:<4} {residue:>3} W{number:4d}    {x:8.3f}{y:8.3f}{z:8.3f}"
            f"  1.00  0.00          {element:>2}")


counts = [int((high[axis] - low[axis]) / STEP) for axis in range(3)]
number = 0
for i in range(counts[0]):
    for j in range(counts[1]):
        for k in range(counts[2]):
            cell = zip(low, (i, j, k))
            place = [start + STEP * (index + 0.5 + random.uniform(-0.25, 0.25)) for start, index in cell]
            if any(math.dist(place, atom) < CLEAR for atom in atoms):
                continue
            number += 1
            if number % 60 == 0:
                lines.append(row("NA", "NA", number, place, "NA"))
            elif number % 60 == 30:
                lines.append(row("CL", "CL", number, place, "CL"))
            else:
                lines.append(row("O", "HOH", number, place, "O"))
                lines.extend(row("H", "HOH", number, hydrogen, "H") for hydrogen in hydrogens(place))

with open(sys.argv[2], "w") as out:
    out.write("\n".join(lines) + "\nEND\n")
