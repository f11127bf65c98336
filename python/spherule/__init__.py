"""Renders particle simulations by CPU ray tracing: arrays to pictures in memory, and files to sequences of OpenEXR.

>>> import numpy, spherule
>>> image = spherule.render(numpy.random.rand(1000, 3).astype("float32"), radius=0.02, size=(64, 36))
>>> image.rgba.shape
(36, 64, 4)
"""

from ._command import command, inspect, movie, sheet
from ._explore import Explorer, explore
from ._errors import ArrayError, Error, InputError, InternalError, JobError, OutputError, SettingError
from ._frames import Cell, Frame, Sequence, read, sequence, write_spf
from ._image import Image
from ._job import Job
from ._render import render
from ._spherule import __version__

__all__ = [
    "ArrayError",
    "Cell",
    "Error",
    "Explorer",
    "Frame",
    "Image",
    "InputError",
    "InternalError",
    "Job",
    "JobError",
    "OutputError",
    "Sequence",
    "SettingError",
    "__version__",
    "command",
    "explore",
    "inspect",
    "movie",
    "read",
    "render",
    "sequence",
    "sheet",
    "write_spf",
]
