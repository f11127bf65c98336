"""Makes the HDF5 files of this directory, which refer to others in `parts`, and expected.tsv as h5py reads them.

    pip install h5py==3.16.0 numpy==2.4.6
    python tests/data/hdf5_links/make.py
"""

import pathlib
import sys

import h5py
import numpy

HERE = pathlib.Path(__file__).parent
sys.path.insert(0, str(HERE.parent))
import reference  # noqa: E402

rng = numpy.random.default_rng(18)
COUNTS = [50, 31]
NAMES = ["parts/first.h5", "parts/second.h5"]
lines = []


def expect(file, arrays, index=0, number=None, time=None):
    lines.extend(reference.line(file, index, number, time, name, array)
                 for name, array in arrays.items())


def parts():
    (HERE / "parts").mkdir(exist_ok=True)
    for number, (name, count) in enumerate(zip(NAMES, COUNTS)):
        with h5py.File(HERE / name, "w") as file:
            storage = {"chunks": True, "compression": "gzip", "shuffle": True} if number else {}
            file.create_dataset("x", data=rng.normal(size=(count, 3)).astype("f4"), **storage)
            file.create_dataset("m", data=rng.uniform(size=count), **storage)
            file.create_dataset("group/ids", data=numpy.arange(count) + 1000 * number, **storage)
            kind = numpy.dtype([("x", "f8"), ("y", "f8"), ("tag", "i2"), ("z", "f8")])
            rows = numpy.zeros(count, kind)
            for key in "xyz":
                rows[key] = rng.normal(size=count)
            rows["tag"] = numpy.arange(count)
            file.create_dataset("table", data=rows)
            file.create_dataset("frames", data=rng.normal(size=(2, 20, 3)), **storage)


def layout(source, row, dtype):
    """All rows of `source` of all files, one after the other."""
    all_rows = h5py.VirtualLayout((sum(COUNTS),) + row, dtype)
    first = 0
    for name, count in zip(NAMES, COUNTS):
        all_rows[first:first + count] = h5py.VirtualSource(name, source, (count,) + row)
        first += count
    return all_rows


# Rows of two files, one of them in chunks
def joined(name, libver):
    with h5py.File(HERE / name, "w", libver=libver) as file:
        file.create_virtual_dataset("positions", layout("x", (3,), "f4"))
        file.create_virtual_dataset("mass", layout("m", (), "f8")).attrs["unit"] = "kg"
        file.create_virtual_dataset("id", layout("group/ids", (), "i8"))
        file["temperature"] = rng.uniform(size=sum(COUNTS))
    with h5py.File(HERE / name) as file:
        expect(name, {key: file[key][()] for key in ["positions", "id", "mass", "temperature"]})


# A part of the rows of each file, in another order, and a part of this file
def selected():
    with h5py.File(HERE / "selected.h5", "w") as file:
        file["own"] = rng.normal(size=(7, 3)).astype("f4")
        rows = h5py.VirtualLayout((30, 3), "f4")
        rows[:10] = h5py.VirtualSource(NAMES[1], "x", (COUNTS[1], 3))[5:15]
        rows[10:17] = h5py.VirtualSource(file["own"])
        rows[17:30] = h5py.VirtualSource(NAMES[0], "x", (COUNTS[0], 3))[30:43]
        file.create_virtual_dataset("positions", rows)
    with h5py.File(HERE / "selected.h5") as file:
        expect("selected.h5", {"positions": file["positions"][()]})


def table():
    with h5py.File(HERE / "table.h5", "w") as file:
        with h5py.File(HERE / NAMES[0]) as source:
            kind = source["table"].dtype
        file.create_virtual_dataset("table", layout("table", (), kind))
    with h5py.File(HERE / "table.h5") as file:
        rows = file["table"][()]
        expect("table.h5", {"positions": numpy.stack([rows[key] for key in "xyz"], 1), "tag": rows["tag"]})


# Time steps: a file each, and several in a file; the first dimension may grow
def frames():
    with h5py.File(HERE / "frames.h5", "w", libver="latest") as file:
        steps = h5py.VirtualLayout((4, 20, 3), "f8", maxshape=(None, 20, 3))
        steps[:2] = h5py.VirtualSource(NAMES[0], "frames", (2, 20, 3))
        steps[2] = h5py.VirtualSource(NAMES[1], "frames", (2, 20, 3))[1]
        steps[3] = h5py.VirtualSource(NAMES[1], "x", (COUNTS[1], 3), dtype="f4")[:20]
        file.create_virtual_dataset("unlike", steps)
        steps = h5py.VirtualLayout((3, 20, 3), "f8", maxshape=(None, 20, 3))
        steps[:2] = h5py.VirtualSource(NAMES[0], "frames", (2, 20, 3))
        steps[2] = h5py.VirtualSource(NAMES[1], "frames", (2, 20, 3))[1]
        file.create_virtual_dataset("positions", steps)
        file["time"] = numpy.array([0.0, 0.25, 0.5])
    with h5py.File(HERE / "frames.h5") as file:
        for index in range(3):
            expect("frames.h5", {"positions": file["positions"][index]}, index, index, file["time"][index])


# A snapshot whose types are in other files: a whole group, and single data sets
def snapshot():
    with h5py.File(HERE / "linked.hdf5", "w") as file:
        header = file.create_group("Header")
        header.attrs["NumPart_ThisFile"] = numpy.array([*COUNTS, 0, 0, 0, 0], "u4")
        header.attrs["Time"] = 1.5
        gas = file.create_group("PartType0")
        gas["Coordinates"] = h5py.ExternalLink(NAMES[0], "/x")
        gas["Masses"] = h5py.ExternalLink(NAMES[0], "m")
        gas["ParticleIDs"] = h5py.ExternalLink(NAMES[0], "/group/ids")
        file["PartType1"] = h5py.ExternalLink("parts/type.h5", "/PartType1")
    with h5py.File(HERE / "parts/type.h5", "w") as file:
        group = file.create_group("PartType1")
        for name, source, row, dtype in [("Coordinates", "x", (3,), "f4"), ("Masses", "m", (), "f8"),
                                         ("ParticleIDs", "group/ids", (), "i8")]:
            # Relative to the file of the virtual data set
            rows = h5py.VirtualLayout((COUNTS[1],) + row, dtype)
            rows[:] = h5py.VirtualSource("second.h5", source, (COUNTS[1],) + row)
            group.create_virtual_dataset(name, rows)
    with h5py.File(HERE / "linked.hdf5") as file:
        names = {"Coordinates": "positions", "Masses": "Masses", "ParticleIDs": "ParticleIDs"}
        arrays = {new: numpy.concatenate([file[f"PartType{i}/{old}"][()] for i in range(2)])
                  for old, new in names.items()}
        arrays["part"] = numpy.repeat([0, 1], COUNTS).astype("u4")
        expect("linked.hdf5", arrays, time=1.5)


# Many links, which are stored in a heap
def many():
    with h5py.File(HERE / "many.h5", "w", libver="latest") as file:
        for index in range(40):
            file[f"other{index:02}"] = h5py.ExternalLink(NAMES[0], "/group")
        file["positions"] = h5py.ExternalLink(NAMES[0], "/x")
        file["mass"] = h5py.ExternalLink(NAMES[0], "/m")
    with h5py.File(HERE / "many.h5") as file:
        expect("many.h5", {name: file[name][()] for name in ["positions", "mass"]})


parts()
joined("joined.h5", "earliest")
joined("joined-latest.h5", "latest")
selected()
table()
frames()
snapshot()
many()
(HERE / "expected.tsv").write_text("".join(lines))
