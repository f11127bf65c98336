"""What the reference readers of `expected.tsv` files have in common.

Each line is one array of one time step: file, index of the step, number of the step, time, array, type, components,
particles, least and largest number (NaN aside) of each component, CRC-32 of the little-endian bytes. `-` stands for none.
"""

import zlib

import numpy

TYPES = {
    "int8": "i8", "uint8": "u8", "int16": "i16", "uint16": "u16", "int32": "i32", "uint32": "u32",
    "int64": "i64", "uint64": "u64", "float32": "f32", "float64": "f64",
}


def line(file, index, number, time, name, array):
    """The line of `array`, which has one row a particle."""
    array = numpy.ascontiguousarray(array)
    rows = array.reshape(len(array), -1) if array.size else numpy.zeros((0, 1), array.dtype)
    components = array.shape[1] if array.ndim > 1 else 1
    bounds = ["-", "-"]
    if len(rows):
        bounds = [" ".join(repr(v.item()) for v in f(rows, axis=0)) for f in (numpy.fmin.reduce, numpy.fmax.reduce)]
    little = array.astype(array.dtype.newbyteorder("<"))
    fields = [file, index, "-" if number is None else number, "-" if time is None else repr(float(time)), name,
              TYPES[array.dtype.name], components, len(rows), *bounds, f"{zlib.crc32(little.tobytes()):08x}"]
    return "\t".join(map(str, fields)) + "\n"
