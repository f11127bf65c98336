"""Makes parts.h5: the two parts of formats/tests/join.rs.

    pip install h5py==3.16.0 numpy==2.4.6
    python tests/data/join/make.py

Licence: CC0.
"""

import pathlib

import h5py
import numpy

with h5py.File(pathlib.Path(__file__).parent / "parts.h5", "w") as file:
    file["fluid/positions"] = numpy.array([[0, 0, 0], [1, 0, 0]], "f4")
    file["fluid/rho"] = numpy.array([1, 2], "f4")
    file["fluid/Vel"] = numpy.array([[3, 0, 0], [0, 4, 0]], "f4")
    file["wall/positions"] = numpy.array([[0, 1, 0]], "f4")
    file["wall/rho"] = numpy.array([0.1], "f8")
