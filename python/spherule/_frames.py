"""Frames of files, and sequences of them."""

import os
from collections.abc import Sequence as _SequenceType
from dataclasses import dataclass, field

import numpy as np

from . import _arrays, _spherule
from ._errors import InputError


@dataclass
class Cell:
    """A simulation cell, in world units.

    Attributes
    ----------
    vectors : array (3, 3)
        The edges, one in each row.
    origin : tuple of float
        The corner where the edges begin.
    periodic : tuple of bool
        Whether the cell repeats along each edge.
    """

    vectors: object
    origin: tuple = (0.0, 0.0, 0.0)
    periodic: tuple = (True, True, True)

    def __post_init__(self):
        self.vectors = _arrays.cell_vectors_of(self.vectors)


@dataclass
class Frame:
    """The particles of one time step.

    Attributes
    ----------
    positions : numpy.ndarray
        World positions (N, 3), in the precision of the file: float32 or float64.
    radius : float, numpy.ndarray or None
        One radius, one for each particle (N,), or None if the file has none.
    attributes : dict of str to numpy.ndarray
        All other numbers of the particles, (N,) or (N, components), in the types of the file.
    time : float or None
        Simulation time.
    origin : tuple of float
        A round position near the particles, for calculations in single precision; zero on axes near zero.
    number : int
        Number of the frame.
    up : str
        The up axis that is usual for the format, "y" or "z".
    notes : list of str
        Oddities of the file.
    cell : Cell or None
        The simulation cell, if the file has one.
    """

    positions: np.ndarray
    radius: object = None
    attributes: dict = field(default_factory=dict)
    time: object = None
    origin: tuple = (0.0, 0.0, 0.0)
    number: int = 0
    up: str = "z"
    name: str = "memory"
    notes: list = field(default_factory=list)
    cell: object = None

    def __len__(self):
        return len(self.positions)


class Sequence(_SequenceType):
    """The frames of files, read when they are asked for: `len`, indices, slices of indices and loops work.

    Attributes
    ----------
    numbers : list of int
        Numbers of the frames.
    notes : list of str
        Oddities, such as gaps.
    """

    def __init__(self, native):
        self._native = native
        self.numbers = native.numbers
        self.notes = native.notes

    def __len__(self):
        return len(self.numbers)

    def __getitem__(self, index):
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        index = index.__index__()
        if not -len(self) <= index < len(self):
            raise IndexError(f"no frame has the index {index}, there are {len(self)}")
        index %= len(self)
        files = self._native.files(index)
        found = self._native.read(index, None)
        cell = found.pop("cell")
        if cell is not None:
            origin, vectors, periodic = cell
            cell = Cell(vectors, tuple(origin), tuple(periodic))
        return Frame(
            **found,
            cell=cell,
            number=self.numbers[index],
            up=self._native.up,
            name=os.path.basename(files[0]) if files else "memory",
        )

    def frame(self, number):
        """The frame with this number.

        Raises
        ------
        InputError
            There is no such frame, or it cannot be read.
        """
        if number not in self.numbers:
            shown = ", ".join(map(str, self.numbers[:8])) + (", ..." if len(self) > 8 else "")
            raise InputError(f"frame {number}: is not among the frames: {shown}", place="frame")
        return self[self.numbers.index(number)]


def _paths(path):
    paths = [path] if isinstance(path, (str, os.PathLike)) else list(path)
    return [os.fspath(path) for path in paths]


def sequence(path, *, follow_links=False, mesh_points=False, topology=None):
    """Finds the frames of files.

    Parameters
    ----------
    path : path or list of paths
        Files, a directory, or a pattern such as "run1/frame_####.vtk".
    follow_links : bool
        Whether lists of files, such as a .pvd, may name files outside their directory.
    mesh_points : bool
        Whether the vertices of meshes (PLY with faces) are particles; otherwise meshes are refused.
    topology : path, optional
        A file with the elements and other properties of the atoms of a trajectory, such as a .gro, .pdb or .psf.

    Returns
    -------
    Sequence

    Raises
    ------
    InputError
        There are no frames, or they cannot be listed.
    """
    topology = None if topology is None else os.fspath(topology)
    frames = _spherule.FrameList(
        _paths(path), follow_links=follow_links, mesh_points=mesh_points, topology=topology
    )
    return Sequence(frames)


def read(path, frame=None, *, mesh_points=False, topology=None):
    """Reads one frame.

    Parameters
    ----------
    path : path or list of paths
        As of `sequence`.
    frame : int, optional
        Number of the frame; may be left out if there is only one.
    mesh_points : bool
        As of `sequence`.
    topology : path, optional
        As of `sequence`.

    Returns
    -------
    Frame

    Raises
    ------
    InputError
        It cannot be read, or there are several frames and none was chosen.
    """
    frames = sequence(path, mesh_points=mesh_points, topology=topology)
    if frame is not None:
        return frames.frame(frame)
    if len(frames) != 1:
        raise InputError(
            f"{path}: {len(frames)} frames; choose one with frame=, or use spherule.sequence", place="frame"
        )
    return frames[0]


def write_spf(path, positions, *, radius=None, attributes=None, time=None):
    """Writes a native frame (.spf) without loss, in the order of a tree.

    Parameters
    ----------
    path : path
        The file; an existing one is replaced at once or not at all.
    positions : array (N, 3)
        World positions.
    radius : float or array (N,), optional
        Radii.
    attributes : dict of str to array, optional
        Other numbers, (N,) or (N, components).
    time : float, optional
        Simulation time.

    Raises
    ------
    ArrayError
        An array has a wrong shape, type or value.
    OutputError
        The file cannot be written.
    """
    positions = _arrays.positions_of(positions)
    common, radii = _arrays.radius_of(radius, len(positions))
    attributes = _arrays.attributes_of(attributes, len(positions))
    if radii is not None:
        attributes.append(("radius", radii))
    _spherule.write_spf(os.fspath(path), positions, attributes, radius=common, time=time)
