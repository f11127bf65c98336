"""Makes the files of this directory with h5py: table.tsv has words of the error that each damaged one must give.

    pip install h5py==3.16.0 numpy==2.4.6
    python tests/damaged_hdf5/make.py
"""

import pathlib
import zlib

import h5py
import numpy

OUT = pathlib.Path(__file__).parent
POINTS = numpy.arange(12, dtype="f8").reshape(4, 3)
table = []


def made(name, words):
    """Opens a new file that must give an error with `words`."""
    table.append((name, words))
    return h5py.File(OUT / name, "w", libver="earliest")


def patched(name, words, change, **storage):
    """A file of positions whose bytes are changed."""
    with made(name, words) as file:
        file.create_dataset("positions", data=POINTS, **storage)
    data = bytearray((OUT / name).read_bytes())
    (OUT / name).write_bytes(bytes(change(data)))


def replaced(data, old, shift, new):
    at = bytes(data).index(old) + shift
    data[at:at + len(new)] = new
    return data


patched("cut.h5", "cut short", lambda data: data[:len(data) - 40])
patched("cut-in-superblock.h5", "cut short", lambda data: data[:30])
patched("superblock-version.h5", "damaged HDF5", lambda data: data[:8] + b"\x09" + data[9:])
patched("root-address.h5", "cut short", lambda data: replaced(data, b"\x89HDF", 64, b"\x01" * 7))
gzip = {"chunks": (2, 3), "compression": "gzip"}
patched("filter.h5", "Blosc (filter 32001), which is not read",
        lambda data: replaced(data, b"deflate", -8, (32001).to_bytes(2, "little")), **gzip)
patched("chunk-address.h5", "the file has", lambda data: replaced(data, b"TREE\x01", 24 + 8 + 4 * 8, b"\xff" * 5), **gzip)
patched("index.h5", "damaged HDF5", lambda data: replaced(data, b"TREE\x01", 0, b"TREX"), **gzip)
patched("contiguous-address.h5", "cut short",
        lambda data: replaced(data, b"\x08\x00\x18\x00", 10, b"\x00\x00\x00\x01"))


def chunk(name, words, data, **storage):
    with made(name, words) as file:
        dataset = file.create_dataset("positions", (4, 3), "f8", chunks=(4, 3), **storage)
        dataset.id.write_direct_chunk((0, 0), data)


chunk("long-chunk.h5", "has more than its 96 bytes", zlib.compress(bytes(1 << 16)), compression="gzip")
chunk("short-chunk.h5", "has 40 of its 96 bytes", zlib.compress(bytes(40)), compression="gzip")
chunk("garbled-chunk.h5", "the chunk here is damaged", b"\x78\x9c" + bytes(range(40, 80)), compression="gzip")
chunk("lzf-chunk.h5", "LZF", b"\xff\xff\xff", compression="lzf")
chunk("plain-chunk.h5", "has 10 of its 96 bytes", bytes(10))
with made("never-written.h5", "never written") as file:
    file.create_dataset("positions", (10**12, 3), "f8", chunks=(1000, 3), compression="gzip")
with made("half-written.h5", "never written") as file:
    file.create_dataset("positions", (4, 3), "f8", chunks=(2, 3))[:2] = POINTS[:2]
with made("no-coordinates.hdf5", "none of PartType0 has a data set Coordinates") as file:
    file["PartType0/ParticleIDs"] = numpy.arange(4)
with made("other-count.hdf5", "4 particles, Header/NumPart_ThisFile has 5") as file:
    file["PartType0/Coordinates"] = POINTS
    file.create_group("Header").attrs["NumPart_ThisFile"] = [5, 0]
with made("flat-coordinates.hdf5", "three numbers a particle are needed") as file:
    file["PartType0/Coordinates"] = POINTS.ravel()
with made("ragged.h5part", "shape [3] for 4 particles") as file:
    for name, count in [("x", 4), ("y", 3), ("z", 4)]:
        file[f"Step#0/{name}"] = numpy.zeros(count)
with made("no-axis.h5part", "has no coordinates y") as file:
    file["Step#0/x"] = numpy.zeros(4)
with made("ragged.hdf5", "shape [3] for 4 particles") as file:
    file.create_group("solver_data").attrs["t"] = 0.0
    for name, count in [("x", 4), ("y", 3), ("z", 4)]:
        file[f"particles/fluid/arrays/{name}"] = numpy.zeros(count)
with made("no-position.h5md", "has an element `position`") as file:
    file.create_group("h5md").attrs["version"] = [1, 1]
    file["particles/all/velocity/value"] = numpy.zeros((1, 4, 3))
with made("few-steps.h5md", "1 numbers for 2 samples") as file:
    file.create_group("h5md").attrs["version"] = [1, 1]
    file["particles/all/position/value"] = numpy.zeros((2, 4, 3))
    file["particles/all/position/step"] = [0]
with made("meshes.h5", "without particles") as file:
    file.attrs["openPMD"], file.attrs["basePath"] = "1.1.0", "/data/%T/"
    file["data/0/fields/E"] = numpy.zeros(4)
with made("ragged-species.h5", "has 3 values for 4 particles") as file:
    file.attrs["openPMD"], file.attrs["basePath"] = "1.1.0", "/data/%T/"
    for name, count in [("x", 4), ("y", 3)]:
        file[f"data/0/particles/e/position/{name}"] = numpy.zeros(count)
with made("image.vtkhdf", "type `ImageData`, which is not read") as file:
    file.create_group("VTKHDF").attrs["Type"] = numpy.bytes_("ImageData")
with made("no-step.vtkhdf", "has no offset for step 1") as file:
    group = file.create_group("VTKHDF")
    group.attrs["Type"] = numpy.bytes_("PolyData")
    group["NumberOfPoints"], group["Points"] = [2, 2], POINTS
    group.create_group("Steps").attrs["NSteps"] = 2
    group["Steps/Values"], group["Steps/PointOffsets"], group["Steps/PartOffsets"] = [0.0, 1.0], [0, 2], [0]
with made("images.vtkhdf", "MultiBlockDataSet: a (ImageData)`, which is not read") as file:
    group = file.create_group("VTKHDF")
    group.attrs["Type"] = numpy.bytes_("MultiBlockDataSet")
    group.create_group("a").attrs["Type"] = numpy.bytes_("ImageData")
with made("no-blocks.vtkhdf", "PartitionedDataSetCollection: without blocks") as file:
    file.create_group("VTKHDF").attrs["Type"] = numpy.bytes_("PartitionedDataSetCollection")
    file.create_group("VTKHDF/Assembly")
with made("block.vtkhdf", "/VTKHDF/a has no data set Points with three numbers") as file:
    group = file.create_group("VTKHDF")
    group.attrs["Type"] = numpy.bytes_("PartitionedDataSetCollection")
    group.create_group("a").attrs["Type"] = numpy.bytes_("PolyData")
    group["a/NumberOfPoints"] = [4]
with made("block-steps.vtkhdf", "/VTKHDF/a has 2 time steps, /VTKHDF/b has 3") as file:
    group = file.create_group("VTKHDF")
    group.attrs["Type"] = numpy.bytes_("PartitionedDataSetCollection")
    for name, steps in [("a", 2), ("b", 3)]:
        block = group.create_group(name)
        block.attrs["Type"] = numpy.bytes_("PolyData")
        block["NumberOfPoints"], block["Points"] = [4], POINTS
        block.create_group("Steps").attrs["NSteps"] = steps
with made("points.vtkhdf", "rows 0 to 9 of 4") as file:
    group = file.create_group("VTKHDF")
    group.attrs["Type"] = numpy.bytes_("PolyData")
    group["NumberOfPoints"], group["Points"] = [9], POINTS
with made("external-link.h5", "/positions refers to the file `other.h5`, which cannot be opened") as file:
    file["positions"] = h5py.ExternalLink("other.h5", "/positions")
with made("external-values.h5", "its values are in another file") as file:
    file.create_dataset("positions", (4, 3), "f8", external=[("values.bin", 0, 96)])
with made("virtual.h5", "/positions: refers to the file `other.h5`, which cannot be opened") as file:
    layout = h5py.VirtualLayout((4, 3), "f8")
    layout[:] = h5py.VirtualSource("other.h5", "positions", (4, 3))
    file.create_virtual_dataset("positions", layout)
with made("cycle.h5", "no known layout") as file:
    group = file.create_group("a/b/c")
    group["again"], file["soft"], file["other"] = file["a"], h5py.SoftLink("/other"), h5py.SoftLink("/soft")
with made("text.h5", "no known layout") as file:
    file["positions"] = numpy.full((4, 3), b"1.0")
with made("empty.h5", "it has no data sets") as file:
    pass
with h5py.File(OUT / "bomb.h5", "w") as file:
    # 48 MB of zeros
    file.create_dataset("positions", data=numpy.zeros((2 * 10**6, 3)), chunks=(10**6, 3), compression=9)
lines = [f"{name}\t{words}\n" for name, words in sorted(table)]
(OUT / "table.tsv").write_text("".join(lines))
