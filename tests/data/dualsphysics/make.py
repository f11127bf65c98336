"""Writes the files of this directory and `expected.tsv`:

    pip install numpy
    python tests/data/dualsphysics/make.py

DualSPHysics is not needed: the layout is that of the classes `JBinaryData`, `JPartDataBi4` and `JPartDataHead` of
DualSPHysics 5.4. `expected.tsv` has the arrays that are written (`../reference.py`).
"""

import os
import struct
import sys

import numpy

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.dirname(HERE))
import reference  # noqa: E402

TEXT, BOOL, INT, UINT, ULLONG, FLOAT, DOUBLE, DOUBLE3 = 1, 2, 7, 8, 10, 11, 12, 23
# Types of arrays by numpy's type and components
ARRAYS = {("i1", 1): 3, ("u1", 1): 4, ("i2", 1): 5, ("u2", 1): 6, ("i4", 1): 7, ("u4", 1): 8, ("i8", 1): 9, ("u8", 1): 10,
          ("f4", 1): 11, ("f8", 1): 12, ("i4", 3): 20, ("u4", 3): 21, ("f4", 3): 22, ("f8", 3): 23}


class Writer:
    """Items in one byte order."""

    def __init__(self, endian="<", is_long=False):
        self.endian, self.is_long = endian, is_long

    def uint(self, number):
        return struct.pack(self.endian + "I", number)

    def text(self, text):
        return self.uint(len(text)) + text.encode()

    def sized(self, content):
        return self.uint(len(content)) + content

    def value(self, name, kind, value):
        head = self.text(name) + self.uint(kind)
        if kind == TEXT:
            return head + self.text(value)
        form = {BOOL: "i", INT: "i", UINT: "I", ULLONG: "Q", FLOAT: "f", DOUBLE: "d", DOUBLE3: "3d"}[kind]
        return head + struct.pack(self.endian + form, *(value if kind == DOUBLE3 else [value]))

    def array(self, name, array):
        components = 1 if array.ndim == 1 else array.shape[1]
        content = array.astype(array.dtype.newbyteorder(self.endian)).tobytes()
        length = self.endian + ("Q" if self.is_long else "I")
        kind = ARRAYS[array.dtype.str[1:], components]
        definition = self.text("\nARRAY") + self.text(name) + self.uint(0) + self.uint(kind)
        definition += struct.pack(length, len(array)) + struct.pack(length, len(content))
        return self.sized(definition) + content

    def item(self, name, values, arrays=(), items=()):
        content = b""
        if values:
            content = self.text("\nVALUES") + self.uint(len(values)) + b"".join(self.value(*v) for v in values)
        definition = self.text("\nITEM\n") + self.text(name) + self.uint(0) + self.uint(0)
        definition += self.text("%.7E") + self.text("%.15E")
        definition += self.uint(len(arrays)) + self.uint(len(items)) + self.uint(len(content))
        return self.sized(definition) + content + b"".join(self.array(*a) for a in arrays) + b"".join(items)

    def file(self, name, item):
        order = (0 if self.endian == "<" else 1) + (10 if self.is_long else 0)
        title = f"#FileJBD {name}".ljust(58).encode() + b"\n\0"
        return title + bytes([order, self.is_long, 0, 0]) + item


def constants(counts, piece, piece_count):
    """Values of the root item."""
    fixed, moving, floating, fluid = counts
    zero = (0.0, 0.0, 0.0)
    return [
        ("Piece", UINT, piece), ("Npiece", UINT, piece_count), ("RunCode", TEXT, "AB12"), ("Date", TEXT, "01-06-2026"),
        ("AppName", TEXT, "DualSPHysics5 v5.4.355"), ("CaseName", TEXT, "Drop"), ("Data2d", BOOL, 0),
        ("Data2dPosY", DOUBLE, 0.0), ("MapPosMin", DOUBLE3, zero), ("MapPosMax", DOUBLE3, (1.0, 1.0, 1.0)),
        ("PeriMode", INT, 0), ("AxisDiv", INT, 99), ("CaseNp", ULLONG, sum(counts)), ("CaseNfixed", ULLONG, fixed),
        ("CaseNmoving", ULLONG, moving), ("CaseNfloat", ULLONG, floating), ("CaseNfluid", ULLONG, fluid),
        ("NpDynamic", BOOL, 1), ("Dp", DOUBLE, 0.02), ("H", DOUBLE, 0.0346), ("B", DOUBLE, 57142.0),
        ("Rhop0", DOUBLE, 1000.0), ("Gamma", DOUBLE, 7.0), ("MassBound", DOUBLE, 0.008), ("MassFluid", DOUBLE, 0.008),
    ]


def part(writer, number, arrays, counts, piece=0, piece_count=1):
    """A part file."""
    count = len(next(iter(arrays.values())))
    values = [
        ("Cpart", UINT, number), ("TimeStep", DOUBLE, number * 0.05), ("Npok", UINT, count), ("Nout", UINT, 2),
        ("Step", UINT, number * 120), ("RunTime", DOUBLE, 3.5), ("DomainMin", DOUBLE3, (0.0, 0.0, 0.0)),
        ("DomainMax", DOUBLE3, (1.0, 1.0, 1.0)), ("NpTotal", ULLONG, sum(counts)),
    ]
    item = writer.item(f"PART_{number:04}", values, list(arrays.items()))
    root = writer.item("JPartDataBi4", constants(counts, piece, piece_count), items=[item])
    return writer.file("JPartDataBi4", root)


def particles(ids, double=False):
    """Arrays of a part in the order of the cells, not of the ids."""
    ids = numpy.array(ids)
    position = numpy.stack([ids % 4 * 0.02, ids % 3 * 0.02, ids // 12 * 0.02 + 0.001], 1)
    return {
        ("Idpd" if double else "Idp"): ids.astype("u8" if double else "u4"),
        ("Posd" if double else "Pos"): position if double else position.astype("f4"),
        "Vel": numpy.stack([ids * 0.1, ids * -0.5, 1.0 / (ids + 1)], 1).astype("f4"),
        "Rhop": (1000 + ids * 0.25).astype("f4"),
    }


def main():
    lines = []

    def save(name, content, number=None, arrays=None, counts=None):
        with open(os.path.join(HERE, name), "wb") as file:
            file.write(content)
        if arrays is None:
            return
        ids = next(iter(arrays.values()))
        first = numpy.cumsum(counts[:3])
        arrays = {**arrays, "radius": numpy.full(len(ids), 0.01, "f4"),
                  "part": (ids[:, None] >= first).sum(1).astype("u4")}
        for array_name, array in arrays.items():
            array_name = "positions" if array_name in ("Pos", "Posd") else array_name
            lines.append(reference.line(name, 0, None, number * 0.05, array_name, array))

    counts = (7, 4, 3, 16)
    order = numpy.random.default_rng(5).permutation(30)
    arrays = particles(order)
    save("Part_0000.bi4", part(Writer(), 0, arrays, counts), 0, arrays, counts)
    # Two particles have left the domain; other arrays of the solver
    arrays = {**particles(order[2:], double=True), "Mk": (order[2:] % 5).astype("u1"),
              "FtRid": order[2:].astype("u2"), "Cell": numpy.stack([order[2:]] * 3, 1).astype("u4"),
              "Press": (order[2:] * 9.81)}
    save("Part_0001.bi4", part(Writer(is_long=True), 1, arrays, counts), 1, arrays, counts)
    arrays = particles(order)
    save("big-endian.bi4", part(Writer(">"), 2, arrays, counts), 2, arrays, counts)
    save("Part_p00_0003.bi4", part(Writer(), 3, particles(order[:18]), counts, 0, 2))
    save("Part_p01_0003.bi4", part(Writer(), 3, particles(order[18:]), counts, 1, 2))
    writer = Writer()
    head = writer.item("JPartDataHead", [("FmtVersion", UINT, 180720), ("AppName", TEXT, "DualSPHysics5 v5.4.355")])
    save("Part_Head.ibi4", writer.file("JPartDataHead", head))

    with open(os.path.join(HERE, "expected.tsv"), "w", encoding="utf-8") as file:
        file.writelines(lines)


if __name__ == "__main__":
    main()
