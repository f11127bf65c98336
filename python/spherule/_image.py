"""Finished pictures."""

import os
import tempfile

import numpy as np

from ._errors import OutputError


def _camera(eye, look_at, up, fov, height):
    """Keys of a camera that does not move."""
    keys = {"mode": "fixed", "eye": eye, "look_at": look_at, "up": up}
    if height is None:
        return {**keys, "fov": fov}
    return {**keys, "projection": "orthographic", "height": height}


class Image:
    """A picture in memory.

    Attributes
    ----------
    width, height : int
        Size in pixels.
    planes : dict of str to numpy.ndarray
        The planes by name, as read-only arrays over the memory of the picture, without a copy. `rgba` has the shape
        (height, width, 4), float32, linear and premultiplied. `Z` (distance along the view axis, infinite without
        particles) and `id` (uint32) have (height, width), `N`, `P`, `V` and `albedo` (height, width, 3). All other
        channels have their names in an EXR file, such as `diffuse`, with (height, width) or (height, width, components).
        Rows are from the top. Arrays keep the picture alive.
    notes : list of str
        What was left out or changed.
    origin : tuple of float
        World position that the tree was relative to.
    color_range, range : tuple of float or None
        The values at both ends of the colour map, for a colour bar.
    camera : dict
        The view of the picture as keys of the section `camera` of a manifest: render(..., camera=image.camera) has the
        same view of other particles.
    """

    def __init__(self, native):
        self._native = native
        self._srgb = None
        self.width, self.height = native.width, native.height
        self.notes = native.notes
        self.origin = tuple(native.origin)
        self.color_range = native.color_range
        self.range = self.color_range
        self.camera = _camera(*native.view)
        self.planes = {}
        for name, plane in native.planes().items():
            self.planes.update(_grouped(*plane) if isinstance(plane, tuple) else {name: plane})

    @property
    def rgba(self):
        """The colours, see `planes`."""
        return self.planes["rgba"]

    @property
    def srgb(self):
        """The pixels of the PNG: uint8 (height, width, 3), or 4 with alpha, in sRGB after the view transform."""
        if self._srgb is None:
            self._srgb = self._native.srgb()
            self._srgb.flags.writeable = False
        return self._srgb

    def __array__(self, dtype=None, copy=None):
        """`srgb`, so that matplotlib and others show the picture."""
        pixels = self.srgb
        if dtype is not None and np.dtype(dtype) != pixels.dtype:
            if copy is False:
                raise ValueError(f"pixels are uint8, and become {np.dtype(dtype)} only in a copy")
            return pixels.astype(dtype)
        return pixels.copy() if copy else pixels

    def __getitem__(self, name):
        """The plane called `name`."""
        return self.planes[name]

    def __repr__(self):
        return f"<spherule.Image {self.width}x{self.height}: {', '.join(self.planes)}>"

    def to_exr(self):
        """The bytes of an OpenEXR file, the same as the command writes."""
        return self._native.to_exr()

    def to_png(self):
        """The bytes of a PNG, the same as a preview of the command: 8-bit sRGB after the view transform."""
        return self._native.to_png()

    def _repr_png_(self):
        return self.to_png()

    def save(self, path):
        """Writes the picture to `path`, which ends in .exr or .png. An existing file is replaced at once or not at all.

        Raises
        ------
        OutputError
            The name has another ending, or the file cannot be written.
        """
        path = os.fspath(path)
        encoders = {".exr": self.to_exr, ".png": self.to_png}
        encode = encoders.get(os.path.splitext(path)[1].lower())
        if encode is None:
            raise OutputError(f"{path}: the name must end in .png or .exr", file=path)
        content = encode()
        temporary = None
        try:
            handle, temporary = tempfile.mkstemp(prefix=".spherule-", dir=os.path.dirname(path) or ".")
            with os.fdopen(handle, "wb") as file:
                file.write(content)
            umask = os.umask(0)
            os.umask(umask)
            os.chmod(temporary, 0o666 & ~umask)
            os.replace(temporary, path)
        except OSError as error:
            if temporary is not None and os.path.exists(temporary):
                os.unlink(temporary)
            raise OutputError(f"{path}: {error.strerror}", file=path) from error


def _grouped(plane, names):
    """Parts of a plane with components of these names: those with a common name before the dot are one array."""
    groups = {}
    for index, name in enumerate(names):
        groups.setdefault(name.split(".")[0], []).append(index)
    parts = {}
    for name, indices in groups.items():
        first, last = indices[0], indices[-1]
        if len(indices) == 1:
            parts[name] = plane[:, :, first]
        elif indices == list(range(first, last + 1)):
            parts[name] = plane[:, :, first : last + 1]
        else:
            parts.update((names[i], plane[:, :, i]) for i in indices)
    return parts
