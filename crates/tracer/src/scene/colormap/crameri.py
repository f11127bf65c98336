"""Writes crameri.bin, the colour maps of Fabio Crameri, from the Python package cmcrameri (tested: version 1.10).

    pip install cmcrameri && python3 crameri.py

One map after the other, in the order of NAMES: 256 colours of three bytes, sRGB. `crameri.rs` has the same names.
"""
import pathlib

import cmcrameri

NAMES = (
    "acton bamako batlow batlowK batlowW bilbao buda bukavu davos devon fes glasgow grayC hawaii imola lajolla lapaz "
    "lipari navia nuuk oleron oslo tokyo turku bam berlin broc cork lisbon managua roma tofino vanimo vik "
    "bamO brocO corkO romaO vikO"
).split()

tables = pathlib.Path(cmcrameri.__file__).parent / "cmaps"
out = bytearray()
for name in NAMES:
    lines = (tables / f"{name}.txt").read_text().splitlines()
    rows = [[float(v) for v in line.split()] for line in lines if line.strip()]
    assert len(rows) == 256 and all(len(row) == 3 for row in rows), name
    out += bytes(round(255 * v) for row in rows for v in row)
pathlib.Path(__file__).with_name("crameri.bin").write_bytes(out)
