"""Writes a Radiance HDR image of a hall with windows: python hall.py hall.hdr"""

import math
import sys

WIDTH, HEIGHT = 512, 256


def radiance(x, y):
    """Linear RGB of a pixel: walls, a floor, and a row of windows."""
    up = math.cos(math.pi * (y + 0.5) / HEIGHT)
    turn = (x + 0.5) / WIDTH
    if up < -0.1:
        return (0.10, 0.07, 0.05)
    window = turn * 12 % 1
    if 0.15 < up < 0.55 and 0.3 < window < 0.7:
        warm = 0.5 + 0.5 * math.cos(2 * math.pi * (turn - 0.3))
        return (3 + 9 * warm, 4 + 6 * warm, 6 + 2 * warm)
    return (0.22, 0.20, 0.18)


def rgbe(color):
    largest = max(color)
    mantissa, exponent = math.frexp(largest)
    scale = mantissa * 256 / largest
    return bytes(int(v * scale) for v in color) + bytes([exponent + 128])


with open(sys.argv[1], "wb") as file:
    file.write(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % (HEIGHT, WIDTH))
    for y in range(HEIGHT):
        file.write(b"".join(rgbe(radiance(x, y)) for x in range(WIDTH)))
