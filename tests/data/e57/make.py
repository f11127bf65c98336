"""Two scans, the second from a turned scanner, written by libE57: pip install pye57 numpy

Writes scans.e57, and scans.csv with the points as libE57 reads them.
"""

import pathlib

import numpy as np
import pye57

HERE = pathlib.Path(__file__).parent


def scan(seed, count):
    """Random points with all that the writer can store."""
    rng = np.random.default_rng(seed)
    points = {f"cartesian{axis}": rng.random(count) * 10 for axis in "XYZ"}
    points["intensity"] = rng.random(count)
    for name in ("Red", "Green", "Blue"):
        points[f"color{name}"] = rng.integers(0, 256, count, dtype=np.uint8)
    points["rowIndex"] = np.arange(count, dtype=np.uint16)
    points["columnIndex"] = np.arange(count, dtype=np.uint16)[::-1].copy()
    return points


turned = np.array([0.9, 0.1, -0.3, 0.2])
turned /= np.linalg.norm(turned)
path = HERE / "scans.e57"
path.unlink(missing_ok=True)
file = pye57.E57(str(path), mode="w")
file.write_scan_raw(scan(1, 60), rotation=np.array([1, 0, 0, 0]), translation=np.zeros(3))
file.write_scan_raw(scan(2, 40), rotation=turned, translation=np.array([5.0, -2.0, 1.0]))
file.close()

file = pye57.E57(str(path))
with open(HERE / "scans.csv", "w", encoding="ascii") as out:
    print("x,y,z,red,green,blue,row", file=out)
    for number in range(file.scan_count):
        read = file.read_scan(number, colors=True, row_column=True, intensity=True, ignore_missing_fields=True)
        names = ["cartesianX", "cartesianY", "cartesianZ", "colorRed", "colorGreen", "colorBlue", "rowIndex"]
        for row in zip(*(read[name].tolist() for name in names)):
            print(",".join(map(repr, row)), file=out)
