"""Makes the files of this directory: groups and data sets with many names, and objects with several.

    pip install h5py==3.16.0 numpy==2.4.6
    python tests/data/hdf5_names/make.py
"""

import lzma
import pathlib

import h5py
import numpy

HERE = pathlib.Path(__file__).parent

# Links and attributes of more than 512 KiB: heaps with two levels of indirect blocks
deep = HERE / "deep_heaps.h5"
with h5py.File(deep, "w", libver="latest") as file:
    group = file.create_group("run")
    positions = group.create_dataset("positions", data=numpy.arange(30, dtype="f4").reshape(10, 3))
    for index in range(2700):
        group["x" * 190 + f"_{index:05d}"] = positions
        group.attrs["y" * 180 + f"_{index:05d}"] = numpy.int8(index % 100)
    group.attrs["time"] = 2.5
    group["density"] = numpy.arange(10, dtype="f4")
(HERE / "deep_heaps.h5.xz").write_bytes(lzma.compress(deep.read_bytes(), preset=9 | lzma.PRESET_EXTREME))
deep.unlink()

# One group of particles under several names, one of them in itself
with h5py.File(HERE / "alias_links.h5", "w") as file:
    group = file.create_group("run1")
    group["positions"] = numpy.arange(12, dtype="f4").reshape(4, 3)
    file["again"] = group
    file["latest"] = h5py.SoftLink("/run1")
    group["self"] = group
    other = file.create_group("other")
    other["positions"] = group["positions"]
    other["id"] = numpy.arange(4)

# A layout that is known
with h5py.File(HERE / "alias_pysph.h5", "w") as file:
    arrays = file.create_group("particles/fluid/arrays")
    for name in "xyz":
        arrays[name] = numpy.arange(4, dtype="f8")
    file["particles/copy"] = file["particles/fluid"]
    file.create_group("solver_data").attrs["t"] = 0.5
