"""Writes the files of this directory and `expected.tsv`:

    pip install numpy blosc==1.11.4
    python tests/data/houdini/make.py

Houdini is not needed: the layout is that of `UT_JSONDefines.h`, `UT_SCFWriter.h` and `UT_CompressedBlockIndex.h` of the
Houdini Development Kit, and of `hgeo.py`. Blosc frames are those of c-blosc. `expected.tsv` has the arrays before they
are divided into pages (`../reference.py`).
"""

import os
import struct
import sys

import blosc
import numpy

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.dirname(HERE))
import reference  # noqa: E402

# Codes of uniform arrays by storage
CODES = {
    "int8": (0x11, "i1"), "int16": (0x12, "i2"), "int32": (0x13, "i4"), "int64": (0x14, "i8"),
    "fpreal16": (0x18, "f2"), "fpreal32": (0x19, "f4"), "fpreal64": (0x1a, "f8"), "uint8": (0x21, "u1"),
}


class Writer:
    """Binary JSON in one byte order."""

    def __init__(self, endian):
        self.endian = endian
        self.bytes = bytearray(b"\x7f" + struct.pack(endian + "I", 0x624A534E))
        self.names = {}

    def length(self, number):
        if number < 0xF1:
            self.bytes.append(number)
        elif number < 1 << 16:
            self.bytes += b"\xf2" + struct.pack(self.endian + "H", number)
        else:
            self.bytes += b"\xf4" + struct.pack(self.endian + "I", number)

    def text(self, text):
        self.length(len(text))
        self.bytes += text.encode()

    def name(self, name):
        """A name: defined at its first use."""
        if name not in self.names:
            self.names[name] = len(self.names)
            self.bytes += b"+"
            self.length(self.names[name])
            self.text(name)
        self.bytes += b"&"
        self.length(self.names[name])

    def uniform(self, array, storage):
        code, dtype = CODES[storage]
        array = numpy.asarray(array).reshape(-1).astype(self.endian + dtype)
        self.bytes += bytes([0x40, code])
        self.length(len(array))
        self.bytes += array.tobytes()

    def bits(self, flags):
        self.bytes += bytes([0x40, 0x10])
        self.length(len(flags))
        for first in range(0, len(flags), 32):
            word = sum(1 << bit for bit, flag in enumerate(flags[first:first + 32]) if flag)
            self.bytes += struct.pack(self.endian + "I", word)

    def value(self, value):
        """A list as an array, a dictionary as a map, a function as whatever it writes."""
        if callable(value):
            value()
        elif value is None:
            self.bytes.append(0)
        elif isinstance(value, bool):
            self.bytes.append(0x31 if value else 0x30)
        elif isinstance(value, int):
            sizes = [(0x11, "b"), (0x12, "h"), (0x13, "i"), (0x14, "q")]
            code, form = next(s for s in sizes if -(1 << 8 * struct.calcsize(s[1]) - 1) <= value
                              < 1 << 8 * struct.calcsize(s[1]) - 1)
            self.bytes += bytes([code]) + struct.pack(self.endian + form, value)
        elif isinstance(value, float):
            self.bytes += b"\x1a" + struct.pack(self.endian + "d", value)
        elif isinstance(value, str):
            self.name(value)
        elif isinstance(value, dict):
            self.bytes += b"{"
            for key, item in value.items():
                self.bytes += b"'"
                self.text(key)
                self.value(item)
            self.bytes += b"}"
        else:
            self.bytes += b"["
            for item in value:
                self.value(item)
            self.bytes += b"]"


def pages(array, packing, page_len, constant):
    """Numbers in the order of the file, and the flags of constant pages of each packed vector."""
    array = array.reshape(len(array), sum(packing))
    numbers = []
    flags = [[] for _ in packing]
    for first in range(0, len(array), page_len):
        page = array[first:first + page_len]
        start = 0
        for vector, width in enumerate(packing):
            part = page[:, start:start + width]
            is_constant = constant and bool((part == part[0]).all())
            flags[vector].append(is_constant)
            numbers.append((part[:1] if is_constant else part).reshape(-1))
            start += width
    numbers = numpy.concatenate(numbers) if numbers else array.reshape(-1)
    # Without a constant page, a vector has no flags
    return numbers, [vector if any(vector) else [] for vector in flags]


def values(writer, array, storage, packing=None, page_len=1024, constant=True, form="pages"):
    """The values of an attribute."""
    size = 1 if array.ndim == 1 else array.shape[1]
    head = ["size", size, "storage", storage]
    if form == "tuples":
        return head + ["tuples", [lambda row=row: writer.uniform(row, storage) for row in array]]
    if form == "arrays":
        rows = array.reshape(len(array), -1).T
        return head + ["arrays", [lambda row=row: writer.uniform(row, storage) for row in rows]]
    numbers, flags = pages(array, packing or [size], page_len, constant)
    if packing:
        head += ["packing", lambda: writer.uniform(packing, "uint8")]
    head += ["pagesize", page_len]
    if any(flags):
        head += ["constantpageflags", [lambda vector=vector: writer.bits(vector) for vector in flags]]
    if form == "list":
        return head + ["rawpagedata", [number.item() for number in numbers]]
    return head + ["rawpagedata", lambda: writer.uniform(numbers, storage)]


def numeric(writer, name, array, storage, scope="public", **how):
    size = 1 if array.ndim == 1 else array.shape[1]
    definition = ["scope", scope, "type", "numeric", "name", name, "options", {}]
    defaults = ["size", 1, "storage", "fpreal64", "values", lambda: writer.uniform([0.0], "fpreal64")]
    return [definition, ["size", size, "storage", storage, "defaults", defaults,
                         "values", values(writer, array, storage, **how)]]


def string(writer, name, strings, indices, **how):
    definition = ["scope", "public", "type", "string", "name", name, "options", {}]
    return [definition, ["size", 1, "storage", "int32", "strings", strings,
                         "indices", values(writer, indices, "int32", **how)]]


def geometry(writer, count, point_attributes, primitives=(), primitive_count=0):
    """A file with everything around the points that Houdini writes."""
    info = {"software": "Houdini 20.0.547", "timetocook": 0.25, "bounds": [0.0, 1.0, 0.0, 1.0, 0.0, 1.0],
            "nothing": None}
    indices = numpy.arange(primitive_count * 3) % max(count, 1)
    writer.value([
        "fileversion", "20.0.547",
        "hasindex", False,
        "pointcount", count,
        "vertexcount", len(indices),
        "primitivecount", primitive_count,
        "info", info,
        "topology", ["pointref", ["indices", lambda: writer.uniform(indices, "int32")]],
        "attributes", [
            "pointattributes", point_attributes,
            "globalattributes", [numeric(writer, "frame", numpy.array([12.5]), "fpreal64")],
        ],
        "primitives", list(primitives),
        "pointgroups", [[["name", "lead", "type", "point"],
                         ["selection", ["defaults", ["size", 1], "unordered", ["boolRLE", [count, False]]]]]],
    ])
    return bytes(writer.bytes)


def compressed(content, frame_len, cname="lz4", shuffle=blosc.SHUFFLE, level=7, typesize=4, block_len=0):
    """Houdini's seekable compressed format."""
    blosc.set_nthreads(1)
    blosc.set_blocksize(block_len)
    parts = [content[at:at + frame_len] for at in range(0, len(content), frame_len)]
    frames = [blosc.compress(part, typesize=typesize, clevel=level, shuffle=shuffle, cname=cname) for part in parts]
    ends = numpy.cumsum([len(frame) for frame in frames])[:-1]
    index = struct.pack(f">{len(ends)}Q2Q", *ends.tolist(), frame_len, len(parts[-1]))
    return b"scf1" + bytes(8) + b"".join(frames) + index + struct.pack(">Q", len(index)) + b"1fcs"


def flip(writer, count):
    """Points as a FLIP simulation has them."""
    row = numpy.arange(count)
    position = numpy.stack([row % 10 * 0.1, row // 10 % 10 * 0.1, row // 100 * 0.1], 1).astype("f4")
    arrays = {
        "P": position,
        "v": (position[:, ::-1] * [1, -2, 0.5]).astype("f4"),
        "pscale": numpy.full(count, 0.05, "f4"),
        "id": (row * 3 + 7).astype("i4"),
        "Cd": numpy.where(row[:, None] < 1024, [0.25, 0.5, 1.0], position[:, :]).astype("f4"),
    }
    storages = {"id": "int32"}
    attributes = [numeric(writer, name, array, storages.get(name, "fpreal32")) for name, array in arrays.items()]
    attributes.append(numeric(writer, "__topology", row, "int32", scope="private"))
    arrays["name"] = (row // 7 % 2).astype("i4")
    attributes.append(string(writer, "name", ["drop", "spray"], arrays["name"]))
    definition = ["scope", "public", "type", "dict", "name", "notes", "options", {}]
    attributes.append([definition, ["size", 1, "storage", "int32", "dicts", [{"a": 1}]]])
    return attributes, arrays


def pages_of_all_kinds(writer):
    """Every storage, short pages of which some are constant, and other arrangements."""
    count = 29
    row = numpy.arange(count)
    last = numpy.where(row < 16, 1.0, row % 3 * 2.0)
    four = numpy.stack([row * 0.5, row * -0.25, row // 8 * 1.0, last], 1).astype("f4")
    w = four[:, 3:]
    position = four[:, :3] / numpy.where(w == 0, 1, w)
    how = {"page_len": 8}
    attributes = [numeric(writer, "P", four, "fpreal32", packing=[3, 1], **how)]
    arrays = {"P": position.astype("f4")}

    def add(name, array, storage, **more):
        attributes.append(numeric(writer, name, array, storage, **{**how, **more}))
        arrays[name] = array.astype("f4") if storage == "fpreal16" else array

    add("half", (row * 0.125).astype("f2"), "fpreal16")
    add("wide", numpy.stack([row / 3, row // 8 / 7, row * 1e-9], 1), "fpreal64", packing=[1, 1, 1])
    add("byte", (row % 5 - 2).astype("i1"), "int8")
    add("code", (row * 9 % 256).astype("u1"), "uint8")
    add("short", (row // 8 * 1000 - 1500).astype("i2"), "int16")
    add("id", row.astype("i8") + (1 << 40), "int64")
    add("listed", (row // 8).astype("i4"), "int32", form="list")
    add("reals", (row // 8 * 0.5).astype("f4"), "fpreal32", form="list")
    add("plain", four[:, :3].copy(), "fpreal32", constant=False)
    add("tuples", four[:, :2].copy(), "fpreal32", form="tuples")
    add("arrays", four[:, 1:].copy(), "fpreal32", form="arrays")
    return geometry(writer, count, attributes), arrays


def main():
    lines = []

    def save(name, content, arrays):
        with open(os.path.join(HERE, name), "wb") as file:
            file.write(content)
        for array_name, array in arrays.items():
            array_name = "positions" if array_name == "P" else array_name
            lines.append(reference.line(name, 0, None, None, array_name, array))

    # Two triangles beside points
    writer = Writer("<")
    attributes, arrays = flip(writer, 25)
    triangles = [[["type", "Polygon_run"], ["startvertex", 0, "nprimitives", 2, "nvertices_rle", [3, 2]]]]
    save("flip_12.bgeo", geometry(writer, 25, attributes, triangles, 2), arrays)

    save("pages.bgeo", *pages_of_all_kinds(Writer(">")))

    writer = Writer("<")
    empty = numpy.zeros((0, 3), "f4")
    attributes = [numeric(writer, "P", empty, "fpreal32"), numeric(writer, "v", empty, "fpreal32")]
    save("empty.bgeo", geometry(writer, 0, attributes), {"P": empty, "v": empty})

    writer = Writer("<")
    attributes, arrays = flip(writer, 2100)
    cache = geometry(writer, 2100, attributes)
    save("cache_0012.bgeo.sc", compressed(cache, 16 << 10), arrays)
    save("zlib.bgeo.sc", compressed(cache, 40 << 10, "zlib", blosc.NOSHUFFLE, block_len=8 << 10), arrays)
    # Two blocks in a frame, with elements of 12 bytes that do not fill the last one
    save("split.bgeo.sc", compressed(cache, 50_001, typesize=12, block_len=24_000), arrays)

    writer = Writer("<")
    position = numpy.arange(90).reshape(30, 3) * 0.1
    save("double.bgeo.sc", compressed(
        geometry(writer, 30, [numeric(writer, "P", position, "fpreal64")]), 1 << 20, level=0), {"P": position})

    with open(os.path.join(HERE, "expected.tsv"), "w", encoding="utf-8") as file:
        file.writelines(lines)


if __name__ == "__main__":
    main()
