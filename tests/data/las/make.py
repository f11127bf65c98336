"""Point clouds as LAS and as LAZ, compressed by the C++ library LASzip: pip install laspy laszip numpy"""

import pathlib

import laspy
import numpy as np

HERE = pathlib.Path(__file__).parent
COUNT = 300
FORMATS = [(0, True), (1, False), (2, False), (3, True), (5, False), (6, False), (7, True), (8, False)]


def cloud(point_format, with_extra):
    """Points on a wavy surface, with all dimensions that the format has."""
    version = "1.4" if point_format > 5 else "1.3" if point_format > 3 else "1.2"
    header = laspy.LasHeader(point_format=point_format, version=version)
    header.scales, header.offsets = [0.001, 0.001, 0.002], [500.0, -20.0, 7.0]
    if with_extra:
        header.add_extra_dim(laspy.ExtraBytesParams("echo", np.int16))
        header.add_extra_dim(laspy.ExtraBytesParams("height", np.float32))
    las = laspy.LasData(header)
    rng = np.random.default_rng(point_format)
    t = np.linspace(0, 9, COUNT)
    las.x, las.y = 500 + t + rng.normal(0, 0.1, COUNT), -20 + 3 * np.sin(t)
    las.z = 7 + np.cos(2 * t)
    las.intensity = rng.integers(0, 4000, COUNT)
    las.classification = rng.integers(0, 6, COUNT)
    las.point_source_id = np.arange(COUNT) // 100
    names = set(header.point_format.dimension_names)
    if "gps_time" in names:
        las.gps_time = times(t, rng) if point_format < 6 else 1e5 + t
    for index, name in enumerate(["red", "green", "blue", "nir"]):
        if name in names:
            las[name] = rng.integers(0, 65536, COUNT) if index else np.arange(COUNT)
    if with_extra:
        las["echo"] = np.arange(COUNT) - 300
        las["height"] = (t * 0.5).astype(np.float32)
    return las


def times(t, rng):
    """Times of four scanners, with steps that repeat, grow, shrink and jump."""
    steps = rng.choice([0, 1e-5, 1e-5, 1e-5, 2e-5, 2e-4, 3e-3, -1e-5, -2e-4, 1e3, -1e6], len(t))
    each = rng.integers(0, 4, len(t))
    all_times = np.zeros(len(t))
    for scanner in range(4):
        own = each == scanner
        all_times[own] = 1e5 * (1 + scanner) + np.cumsum(steps[own])
    return all_times


for point_format, with_extra in FORMATS:
    las = cloud(point_format, with_extra)
    las.write(HERE / f"format{point_format}.las")
    las.write(HERE / f"format{point_format}.laz", laz_backend=laspy.LazBackend.Laszip)
