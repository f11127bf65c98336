"""Prints by how many bytes for each particle a render raises the peak of resident memory, and its time.

measure_memory.py COUNT [CHANNEL ...]
"""

import resource
import sys
import time

import numpy as np

import spherule


def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def main(count, *channels):
    options = {"channels": list(channels) or None, "size": (320, 180), "samples": 1}
    spherule.render(np.zeros((2, 3), np.float32), radius=0.1, **options)
    positions = np.empty((count, 3), np.float32)
    generator = np.random.default_rng(1)
    for first in range(0, count, 1 << 16):
        positions[first : first + (1 << 16)] = generator.random((min(1 << 16, count - first), 3), dtype=np.float32)
    before, start = peak(), time.monotonic()
    spherule.render(positions, radius=0.002, **options)
    seconds = time.monotonic() - start
    print(f"{count} particles: {(peak() - before) / count:.2f} bytes each beside the array, {seconds:.1f} s")


if __name__ == "__main__":
    main(int(float(sys.argv[1])), *sys.argv[2:])
