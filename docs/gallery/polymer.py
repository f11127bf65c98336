"""Writes chains of two kinds of beads as a LAMMPS data file: python polymer.py OUT.data

Random walks in a periodic box, whose beads are then pushed apart; not an equilibrium.
"""

import random
import sys

CHAINS, LENGTH = 40, 40
EDGE = 12.5
BOND = 0.97
random.seed(11)


def wrapped(way):
    return [part - EDGE * round(part / EDGE) for part in way]


beads = []
for _ in range(CHAINS):
    place = [random.uniform(0, EDGE) for _ in range(3)]
    for _ in range(LENGTH):
        turn = [random.gauss(0, 1) for _ in range(3)]
        length = sum(part * part for part in turn) ** 0.5
        place = [p + BOND * part / length for p, part in zip(place, turn)]
        beads.append(place)

for _ in range(60):
    # Sort the beads into cells of edge 1, and push those apart that are nearer than that
    cells = {}
    for index, bead in enumerate(beads):
        cells.setdefault(tuple(int(p % EDGE) for p in bead), []).append(index)
    moves = [[0.0] * 3 for _ in beads]

    def push(a, b, wanted, share):
        way = wrapped([q - p for p, q in zip(beads[a], beads[b])])
        length = max(sum(part * part for part in way) ** 0.5, 1e-6)
        for axis in range(3):
            step = share * (length - wanted) * way[axis] / length
            moves[a][axis] += step
            moves[b][axis] -= step
        return length

    sides = range(-1, 2)
    for (x, y, z), own in cells.items():
        around = {(int((x + i) % int(EDGE + 1)), int((y + j) % int(EDGE + 1)), int((z + k) % int(EDGE + 1)))
                  for i in sides for j in sides for k in sides}
        for a in own:
            for b in (other for cell in around for other in cells.get(cell, ())):
                way = wrapped([q - p for p, q in zip(beads[a], beads[b])])
                if a < b and sum(part * part for part in way) < 1.0:
                    push(a, b, 1.0, 0.2)
    for index in range(len(beads) - 1):
        if (index + 1) % LENGTH:
            push(index, index + 1, BOND, 0.3)
    beads = [[p + move for p, move in zip(bead, way)] for bead, way in zip(beads, moves)]

bonds = [index for index in range(len(beads) - 1) if (index + 1) % LENGTH]
with open(sys.argv[1], "w") as out:
    out.write(f"A melt of diblock copolymers\n\n{len(beads)} atoms\n{len(bonds)} bonds\n2 atom types\n1 bond types\n\n")
    out.write("".join(f"0 {EDGE} {axis}lo {axis}hi\n" for axis in "xyz"))
    out.write("\nMasses\n\n1 1\n2 1\n\nAtoms # bond\n\n")
    for index, bead in enumerate(beads):
        kind = 1 if index % LENGTH < LENGTH // 2 else 2
        place = " ".join(f"{p % EDGE:.4f}" for p in bead)
        out.write(f"{index + 1} {index // LENGTH + 1} {kind} {place}\n")
    out.write("\nBonds\n\n")
    out.writelines(f"{number} 1 {first + 1} {first + 2}\n" for number, first in enumerate(bonds, 1))
