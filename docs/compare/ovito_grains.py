"""Renders the heap of superquadrics of the gallery with OVITO, seen as in docs/gallery/heap.jpg.

    pip install ovito numpy
    python docs/compare/ovito_grains.py docs/gallery/heap.csv heap-ovito.png
"""

import sys

import numpy as np
from ovito.data import DataCollection, Particles, ParticleType
from ovito.pipeline import Pipeline, StaticSource
from ovito.vis import TachyonRenderer, Viewport

COLORS = [(0.902, 0.624, 0.0), (0.0, 0.62, 0.451), (0.835, 0.369, 0.0), (0.337, 0.706, 0.914)]
EYE = np.array([9.558, -16.48, 7.337])
LOOK_AT = np.array([0.1982, -0.2651, 0.5236])

source, picture = sys.argv[1:]
rows = np.genfromtxt(source, delimiter=",", names=True)


def columns(*names):
    return np.stack([rows[name] for name in names], axis=1)


particles = Particles(count=len(rows))
particles.create_property("Position", data=columns("x", "y", "z"))
types = particles.create_property("Particle Type", data=rows["type"].astype(int))
for number, color in enumerate(COLORS, 1):
    types.types.append(ParticleType(id=number, name=str(number), color=color))
particles.create_property("Aspherical Shape", data=columns("shapex", "shapey", "shapez"))
# OVITO has the reciprocals of half the exponents, those of the cross section first
roundness = 2 / columns("blockiness2", "blockiness1")
particles.create_property("Superquadric Roundness", data=roundness)
particles.create_property("Orientation", data=columns("quat2", "quat3", "quat4", "quat1"))
data = DataCollection()
data.objects.append(particles)
Pipeline(source=StaticSource(data=data)).add_to_scene()
view = Viewport(type=Viewport.Type.Perspective, camera_pos=EYE, camera_dir=LOOK_AT - EYE, fov=np.radians(25))
view.render_image(filename=picture, size=(800, 450), renderer=TachyonRenderer())
