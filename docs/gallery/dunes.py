"""Writes a million ellipsoids under dunes as a LAMMPS dump: python dunes.py OUT.dump"""

import sys

import numpy as np

COUNT = 1_000_000
SIZE = (500, 250)  # in distances of grains
random = np.random.default_rng(3)

# Places of a lattice below waves, each moved; rows that are farther back are left out
x, y, z = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]), np.arange(24), indexing="ij")
waves = 9 + 6 * np.sin(0.05 * x + 1.5 * np.sin(0.04 * y)) + 2 * np.sin(0.11 * y - 0.03 * x)
waves += random.uniform(-0.5, 0.5, waves.shape[:2])[:, :, None]
below = z <= waves
place = np.stack([x[below], y[below], z[below]], axis=1)
order = np.argsort(place[:, 1], kind="stable")[:COUNT]
place = place[order] + random.uniform(-0.45, 0.45, (len(order), 3))
kind = 1 + (random.random(len(order)) < 0.3)

# Diameters and random orientations
diameter = np.where(kind[:, None] == 1, (1.5, 0.9, 0.7), (1.1, 1.1, 0.6))
diameter = diameter * random.uniform(0.85, 1.15, (len(order), 1))
turn = random.normal(size=(len(order), 4))
turn /= np.linalg.norm(turn, axis=1, keepdims=True)

rows = np.column_stack([np.arange(1, len(order) + 1), kind, place, diameter, turn])
with open(sys.argv[1], "w") as out:
    bounds = f"0 {SIZE[0]}\n0 {SIZE[1]}\n-1 40"
    out.write(f"ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n{len(order)}\nITEM: BOX BOUNDS ff ff ff\n{bounds}\n")
    out.write("ITEM: ATOMS id type x y z shapex shapey shapez quatw quati quatj quatk\n")
    np.savetxt(out, rows, fmt="%d %d" + " %.4g" * 3 + " %.3g" * 3 + " %.4f" * 4)
