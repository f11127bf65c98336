"""Makes the files of this directory with h5py: table.tsv has words of the error that each damaged one must give.

    pip install h5py==3.16.0 numpy==2.4.6
    python tests/damaged_hdf5_links/make.py
"""

import pathlib

import h5py
import numpy

OUT = pathlib.Path(__file__).parent
POINTS = numpy.arange(12, dtype="f8").reshape(4, 3)
SOURCE = "source.h5"
table = []


def made(name, words, libver="earliest"):
    """Opens a new file that must give an error with `words`."""
    table.append((name, words))
    return h5py.File(OUT / name, "w", libver=libver)


def virtual(name, words, *parts, shape=(4, 3), dtype="f8", **options):
    """A file of virtual positions; `parts` are rows, file, data set, its shape and rows of it."""
    with made(name, words, **options) as file:
        layout = h5py.VirtualLayout(shape, dtype)
        for rows, other, dataset, other_shape, other_rows in parts:
            layout[rows] = h5py.VirtualSource(other, dataset, other_shape)[other_rows]
        file.create_virtual_dataset("positions", layout)


def patched(name, words, change, **options):
    virtual(name, words, WHOLE, **options)
    data = bytearray((OUT / name).read_bytes())
    (OUT / name).write_bytes(bytes(change(data)))


def replaced(data, old, shift, new):
    at = bytes(data).index(old) + shift
    data[at:at + len(new)] = new
    return data


ALL = slice(None)
WHOLE = (ALL, SOURCE, "positions", (4, 3), ALL)
with h5py.File(OUT / SOURCE, "w") as file:
    file["positions"], file["single"] = POINTS, POINTS.astype("f4")
    file["short"], file["row"] = POINTS[:2], numpy.arange(12, dtype="f8")
    layout = h5py.VirtualLayout((4, 3), "f8")
    layout[:] = h5py.VirtualSource(file["positions"])
    file.create_virtual_dataset("virtual", layout)
    file["link"] = h5py.ExternalLink("link-and-back.h5", "/positions")

virtual("no-file.h5", "refers to the file `none.h5`, which cannot be opened", (ALL, "none.h5", "positions", (4, 3), ALL))
virtual("outside.h5", "which is not in its directory",
        (ALL, "../data/hdf5/plain.h5", "positions", (4, 3), ALL))
virtual("no-data.h5", "values of `none` in `source.h5`, where it is not", (ALL, SOURCE, "none", (4, 3), ALL))
virtual("no-hdf5.h5", "in `table.tsv`: ", (ALL, "table.tsv", "positions", (4, 3), ALL))
virtual("not-there.h5", "of whole rows one after the other", (ALL, SOURCE, "short", (4, 3), ALL))
virtual("every-other.h5", "of whole rows one after the other",
        (slice(None, None, 2), SOURCE, "short", (2, 3), ALL), (slice(1, None, 2), SOURCE, "short", (2, 3), ALL))
virtual("columns.h5", "of whole rows one after the other", ((ALL, slice(0, 2)), SOURCE, "positions", (4, 3), (ALL, slice(0, 2))))
virtual("shape.h5", "a virtual data set of shape", (slice(0, 4), SOURCE, "positions", (4, 3), ALL), shape=(2**63 - 1, 3))
virtual("gap.h5", "are in no other one", (slice(0, 2), SOURCE, "short", (2, 3), ALL))
virtual("twice.h5", "are in two others", (slice(0, 2), SOURCE, "short", (2, 3), ALL), WHOLE)
virtual("other-type.h5", "which has numbers of another type", (ALL, SOURCE, "single", (4, 3), ALL))
virtual("virtual-twice.h5", "which is virtual as well", (ALL, SOURCE, "virtual", (4, 3), ALL))
virtual("itself.h5", "which is virtual as well", (ALL, ".", "positions", (4, 3), ALL))
patched("no-list.h5", "the list of a virtual data set is missing", lambda data: replaced(data, b"GCOL", 16, b"\x07"))
patched("no-heap.h5", "damaged HDF5", lambda data: replaced(data, b"GCOL", 0, b"COLD"))
patched("list-version.h5", "virtual data sets of version 9", lambda data: replaced(data, b"GCOL", 32, b"\x09"))
patched("list-count.h5", "parts of a virtual data set", lambda data: replaced(data, b"GCOL", 33, b"\xff" * 6))
patched("list-cut.h5", "cut short", lambda data: replaced(data, b"GCOL", 33, b"\x02"))
patched("selection.h5", "a selection of type 9", lambda data: replaced(data, b"positions\0\2\0\0\0", 10, b"\x09"))
patched("dimensions.h5", "dimensions", lambda data: replaced(data, b"\x18\0\0\0\2\0\0\0", 4, b"\xff\xff"))
patched("checksum.h5", "damaged HDF5", lambda data: replaced(data, b"OHDR", 20, b"\x09"), libver="latest")
with made("no-target.h5", "is a link to `/none` in `source.h5`, where it is not") as file:
    file["positions"] = h5py.ExternalLink(SOURCE, "/none")
with made("no-linked-file.h5", "/positions refers to the file `none.h5`, which cannot be opened") as file:
    file["positions"] = h5py.ExternalLink("none.h5", "/positions")
with made("link-and-back.h5", "in a file that a link led to, and is not followed") as file:
    file["positions"] = h5py.ExternalLink(SOURCE, "/link")
with made("link-outside.h5", "which is not in its directory") as file:
    file["positions"] = h5py.ExternalLink("../data/hdf5/plain.h5", "/positions")
lines = [f"{name}\t{words}\n" for name, words in sorted(table)]
(OUT / "table.tsv").write_text("".join(lines))
