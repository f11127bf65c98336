"""Writes a heap of superquadrics with the columns of LIGGGHTS: python heap.py OUT.csv"""

import math
import random
import sys

SEMI_AXES = (0.62, 0.42, 0.34)
EXPONENTS = [(2, 2), (6, 2), (8, 8), (3, 6)]
APART = 1.1  # distance of centres
random.seed(4)

grains = []
for _ in range(9000):
    # Drop a grain onto the others, unless the slope would be too steep
    radius, angle = 6.5 * math.sqrt(random.random()), 2 * math.pi * random.random()
    x, y = radius * math.cos(angle), radius * math.sin(angle)
    z = 0.4
    for other in grains:
        flat = math.hypot(other[0] - x, other[1] - y)
        if flat < APART:
            z = max(z, other[2] + math.sqrt(APART**2 - flat**2))
    if z < 4.2 - 0.6 * radius or z == 0.4:
        grains.append((x, y, z))

with open(sys.argv[1], "w") as out:
    out.write("id,type,x,y,z,shapex,shapey,shapez,blockiness1,blockiness2,quat1,quat2,quat3,quat4\n")
    for number, place in enumerate(grains):
        kind = random.randrange(4)
        turn = [random.gauss(0, 1) for _ in range(4)]
        length = math.sqrt(sum(part**2 for part in turn))
        row = [*place, *SEMI_AXES, *EXPONENTS[kind], *(part / length for part in turn)]
        out.write(f"{number},{kind + 1}," + ",".join(f"{value:.5g}" for value in row) + "\n")
