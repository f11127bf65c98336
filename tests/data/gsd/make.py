"""Makes the GSD files of this directory with the reference writer, and expected.tsv with the reference reader.

    pip install gsd==5.0.1 numpy
    python tests/data/gsd/make.py
"""

import pathlib
import struct
import sys

import gsd.fl
import gsd.hoomd
import gsd.pygsd
import numpy

HERE = pathlib.Path(__file__).parent
sys.path.insert(0, str(HERE.parent))
import reference  # noqa: E402

FIELDS = ["typeid", "mass", "charge", "diameter", "body", "orientation", "velocity", "image"]
rng = numpy.random.default_rng(7)


def polymer(precision):
    """Beads of two types in a triclinic box: attributes in frame 0 only, positions and velocities in each."""
    count = 40
    for index in range(5):
        frame = gsd.hoomd.Frame()
        frame.configuration.step = 250 * index
        frame.configuration.box = [12, 10, 8, 0.25, 0, -0.5]
        frame.particles.N = count
        frame.particles.position = rng.normal(size=(count, 3))
        frame.particles.velocity = rng.normal(size=(count, 3)) if index != 3 else None
        if index == 0:
            frame.particles.types = ["A", "solvent"]
            frame.particles.typeid = numpy.arange(count) % 2
            frame.particles.diameter = 0.5 + 0.25 * (numpy.arange(count) % 2)
            frame.particles.orientation = rng.normal(size=(count, 4))
            frame.bonds.N = count - 1
            frame.bonds.types = ["chain"]
            frame.bonds.group = [(i, i + 1) for i in range(count - 1)]
        frame.log["particles/md/pair/LJ/energies"] = rng.normal(size=count)
        frame.log["md/compute/kinetic_temperature"] = numpy.array([1.5 + index])
        yield frame


def varying():
    """Particles come and go, and properties appear late: what is left out has the values of the schema."""
    for count in [3, 5, 3, 0, 1, 3]:
        frame = gsd.hoomd.Frame()
        frame.configuration.box = [4, 4, 0, 0, 0, 0]
        frame.particles.N = count
        if count > 1:
            frame.particles.position = rng.uniform(-2, 2, size=(count, 3))
        if count == 5:
            frame.particles.mass = rng.uniform(1, 2, size=count)
            frame.particles.body = [-1, 0, 0, 3, 3]
            frame.particles.charge = [1, -1, 0, 0, 2]
            frame.particles.image = rng.integers(-2, 3, size=(count, 3))
        yield frame


def write(name, frames, precision="single"):
    with gsd.hoomd.open(HERE / name, "w", precision=precision) as file:
        file.extend(frames)
    (HERE / name).chmod(0o644)


def to_version_1(name, new):
    """Rewrites a file in the file layer 1.0 with the schema 1.4: names in units of 64 bytes, behind the rest."""
    bytes_ = bytearray((HERE / name).read_bytes())
    at, units = struct.unpack_from("<QQ", bytes_, 24)
    names = [n for n in bytes(bytes_[at:at + 64 * units]).split(b"\0") if n]
    struct.pack_into("<QQ", bytes_, 24, len(bytes_), len(names) + 1)
    struct.pack_into("<II", bytes_, 40, (1 << 16) + 4, 1 << 16)
    for n in names + [b""]:
        bytes_ += n.ljust(64, b"\0")
    (HERE / new).write_bytes(bytes_)


def expected(name):
    layer = gsd.pygsd.GSDFile((HERE / name).open("rb"))
    known = layer.find_matching_chunk_names("particles/")
    has_steps = bool(layer.find_matching_chunk_names("configuration/step"))
    trajectory = gsd.hoomd.HOOMDTrajectory(layer)
    for index in range(len(trajectory)):
        frame = trajectory[index]
        number = frame.configuration.step if has_steps else None
        arrays = {"positions": frame.particles.position}
        for field in FIELDS:
            if field == "diameter" or f"particles/{field}" in known:
                arrays[field] = getattr(frame.particles, field)
        for key, value in frame.log.items():
            if key.startswith("particles/"):
                arrays[key.removeprefix("particles/")] = value
        for key, value in arrays.items():
            yield reference.line(name, index, number, None, key, value)


write("polymer.gsd", polymer("single"))
write("polymer-double.gsd", polymer("double"), "double")
write("varying.gsd", varying())
to_version_1("polymer.gsd", "polymer-version-1.gsd")
names = ["polymer.gsd", "polymer-double.gsd", "polymer-version-1.gsd", "varying.gsd"]
(HERE / "expected.tsv").write_text("".join(l for name in names for l in expected(name)))
