"""Writes the sky of water.py as an environment for spherule, for dam.toml: python docs/compare/sky.py sky.hdr

An equirectangular image whose colour is linear in the angle between the nadir and the zenith.
"""

import math
import sys

WIDTH, HEIGHT = 512, 256
BOTTOM, TOP = (0.62, 0.66, 0.70), (0.36, 0.58, 0.95)


def rgbe(color):
    mantissa, exponent = math.frexp(max(color))
    scale = mantissa * 256 / max(color)
    return bytes(int(v * scale) for v in color) + bytes([exponent + 128])


with open(sys.argv[1], "wb") as file:
    file.write(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % (HEIGHT, WIDTH))
    for y in range(HEIGHT):
        part = (y + 0.5) / HEIGHT
        file.write(WIDTH * rgbe([part * low + (1 - part) * high for low, high in zip(BOTTOM, TOP)]))
