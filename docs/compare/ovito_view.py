"""Renders a frame of examples/dam-break with OVITO's default settings, for docs/ovito.md.

    pip install ovito numpy
    python docs/compare/ovito_view.py examples/dam-break/ParticleData_Fluid_9.bgeo ovito.png

OVITO does not read BGEO, so the positions are passed to it as an array. OVITO 3.17 needs a Vulkan driver for its
default renderer; Debian's package mesa-vulkan-drivers has one for the CPU. `--tachyon` uses OVITO's ray tracer.
"""

import argparse
import gzip
import struct
import time

import numpy as np
from ovito.data import DataCollection
from ovito.pipeline import Pipeline, StaticSource
from ovito.vis import TachyonRenderer, Viewport

RADIUS = 0.02
SIZE = (960, 540)


def positions(path):
    """Positions of a classic BGEO file (version 5, gzipped), N x 3, with the z axis up."""
    data = gzip.open(path).read()
    assert data[:5] == b"BgeoV", "not a classic BGEO file"
    _, points, _, _, _, attributes, _, _, _ = struct.unpack(">9i", data[5:41])
    # Each point has four floats of position, then its attributes
    place, floats = 41, 4
    for _ in range(attributes):
        (length,) = struct.unpack_from(">H", data, place)
        (components,) = struct.unpack_from(">H", data, place + 2 + length)
        place += 2 + length + 6 + 4 * components
        floats += components
    rows = np.frombuffer(data, ">f4", points * floats, place).reshape(points, floats)
    x, y, z = rows[:, :3].astype(float).T
    return np.stack([x, -z, y], axis=1)


parser = argparse.ArgumentParser()
parser.add_argument("frame")
parser.add_argument("output")
parser.add_argument("--tachyon", action="store_true")
arguments = parser.parse_args()

found = positions(arguments.frame)
collection = DataCollection()
particles = collection.create_particles(count=len(found))
particles.create_property("Position", data=found)
particles.create_property("Radius", data=np.full(len(found), RADIUS))
Pipeline(source=StaticSource(data=collection)).add_to_scene()

# About the direction of spherule's automatic camera
viewport = Viewport(type=Viewport.Type.Perspective, camera_dir=(-1, 2, -1))
viewport.zoom_all(size=SIZE)
start = time.time()
renderer = {"renderer": TachyonRenderer()} if arguments.tachyon else {}
viewport.render_image(filename=arguments.output, size=SIZE, **renderer)
print(f"{len(found)} particles, {time.time() - start:.2f} s")
