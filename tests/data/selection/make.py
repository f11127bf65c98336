"""Makes particles.npz and counts.tsv of this directory: how many particles meet conditions, counted by numpy.

    pip install numpy==2.4.6
    python tests/data/selection/make.py
"""

import pathlib

import numpy

HERE = pathlib.Path(__file__).parent
rng = numpy.random.default_rng(16)
COUNT = 1100
positions = rng.uniform(-1.0, 1.0, (COUNT, 3)).astype("f4")
velocity = rng.normal(0.0, 2.0, (COUNT, 3)).astype("f4")
density = rng.uniform(900.0, 1100.0, COUNT)
density[::13] = numpy.nan
density[5::17] = 0.0
kind = rng.integers(0, 4, COUNT).astype("i4")
ids = rng.permutation(COUNT).astype("u4") * 3 + 1
numpy.savez_compressed(
    HERE / "particles.npz", positions=positions, velocity=velocity, density=density, type=kind, id=ids
)

x, y, z = positions.astype("f8").T
vx, vy, vz = velocity.astype("f8").T
speed = numpy.sqrt(vx * vx + vy * vy + vz * vz)
index = numpy.arange(COUNT)
with numpy.errstate(all="ignore"):
    counts = {
        "speed > 2 && z < 0.5 && type == 1": (speed > 2) & (z < 0.5) & (kind == 1),
        "velocity.x / density > 0.001 || !(density >= 0)": (vx / density > 0.001) | ~(density >= 0),
        "sqrt(x*x + y*y) <= 0.5 && abs(velocity[2]) > max(1, 2 * speed - 4)": (numpy.sqrt(x * x + y * y) <= 0.5)
        & (numpy.abs(vz) > numpy.maximum(1, 2 * speed - 4)),
        "1 / density > 1e9 || density != density || -index + 7 >= id * 0.01": (1 / density > 1e9)
        | (density != density)
        | (-index + 7 >= ids * 0.01),
        "min(density, 1000) == 1000 && type != 2 && (x - 0.25) * -4 > 1": (numpy.minimum(density, 1000) == 1000)
        & (kind != 2)
        & ((x - 0.25) * -4 > 1),
    }
lines = [f"{numpy.count_nonzero(keep)}\t{numpy.sum(index[keep])}\t{text}\n" for text, keep in counts.items()]
(HERE / "counts.tsv").write_text("".join(lines))
