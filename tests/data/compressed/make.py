"""Makes drop.csv and compressed copies of it, and bombs, with the compressors of Python and of the system.

    pip install zstandard==0.25.0 lz4==4.4.5
    python tests/data/compressed/make.py     # also runs zstd, xz, bzip2, lz4 and zip
"""

import bz2
import gzip
import lzma
import pathlib
import random
import struct
import subprocess
import zipfile

import lz4.frame
import zstandard

HERE = pathlib.Path(__file__).parent
# Longer than a block of LZ4, so that blocks refer to the ones before.
ROWS = 7000
# Raw points for .xyz.
ZEROS = 999_999_996


def write(name, bytes_):
    (HERE / name).write_bytes(bytes_)


def zipped(name, members, method=zipfile.ZIP_DEFLATED):
    with zipfile.ZipFile(HERE / name, "w", method) as archive:
        for member, bytes_ in members:
            archive.writestr(zipfile.ZipInfo(member, (2026, 1, 1, 0, 0, 0)), bytes_, method)


def tool(*command):
    return subprocess.run(command, input=text, capture_output=True, check=True).stdout


for old in HERE.iterdir():
    if old.suffix not in [".py", ".md"]:
        old.unlink()
# Few different numbers: the copies stay small.
random.seed(5)
rows = "".join(f"{random.randrange(9)},{random.randrange(4) / 4},0,{i % 7}\n" for i in range(ROWS))
text = ("x,y,z,id\n" + rows).encode()
half = len(text) // 2
write("drop.csv", text)
write("drop.csv.gz", gzip.compress(text, mtime=0))

zstd = zstandard.ZstdCompressor(level=19, write_checksum=True)
skippable = struct.pack("<II", 0x184D2A5A, 5) + b"note\n"
write("drop.csv.zst", tool("zstd", "-q", "-c"))
write("drop-plain.csv.zst", zstandard.ZstdCompressor(level=1, write_content_size=False).compress(text))
write("drop-frames.csv.zst",
      skippable + zstd.compress(text[:half]) + skippable + zstd.compress(text[half:]) + skippable)

write("drop.csv.bz2", tool("bzip2", "-c"))
write("drop-streams.csv.bz2", bz2.compress(text[:half], 1) + bz2.compress(text[half:]))

write("drop.csv.xz", tool("xz", "-c"))
write("drop-sha256.csv.xz", lzma.compress(text, check=lzma.CHECK_SHA256))
write("drop-none.csv.xz", lzma.compress(text, check=lzma.CHECK_NONE))
write("drop-streams.csv.xz", lzma.compress(text[:half]) + bytes(8) + lzma.compress(text[half:]))

small = dict(block_size=lz4.frame.BLOCKSIZE_MAX64KB)
write("drop.csv.lz4", tool("lz4", "-q", "-c", "-9"))
write("drop-linked.csv.lz4", tool("lz4", "-q", "-c", "-9", "-B4", "-BD", "-BX", "--content-size"))
write("drop-frames.csv.lz4",
      lz4.frame.compress(text[:half], content_checksum=True, block_linked=True, **small) + skippable
      + lz4.frame.compress(text[half:], block_checksum=True, block_linked=False, store_size=False, **small))

zipped("drop.csv.zip", [("run/", b""), ("run/drop.csv", text), ("__MACOSX/run/._drop.csv", b"\0" * 9)])
zipped("drop-stored.zip", [("drop.csv", text)], zipfile.ZIP_STORED)
zipped("several.zip", [(f"drop_{i}.csv", text[:99]) for i in (2, 0, 1, 3, 4, 5, 6)])

# Bombs compress well themselves: in gzip, they are small enough to be kept.
zeros = bytes(ZEROS)
bombs = {
    "zst": zstandard.ZstdCompressor(level=3).compress(zeros),
    "bz2": bz2.compress(zeros),
    "xz": lzma.compress(zeros, preset=0),
    "lz4": lz4.frame.compress(zeros),
}
zipped("bomb.zip", [("bomb.xyz", zeros)])
bombs["zip"] = (HERE / "bomb.zip").read_bytes()
(HERE / "bomb.zip").unlink()
for suffix, bytes_ in bombs.items():
    write(f"bomb.xyz.{suffix}.gz", gzip.compress(bytes_, mtime=0))
