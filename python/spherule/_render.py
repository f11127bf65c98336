"""Renders arrays."""

import os

from . import _arrays, _spherule
from ._errors import ArrayError
from ._frames import Cell, Frame
from ._image import Image
from ._settings import merged, settings_text


def render(
    positions,
    *,
    look=None,
    radius=None,
    attributes=None,
    camera=None,
    settings=None,
    time=None,
    size=None,
    samples=None,
    color=None,
    channels=None,
    up=None,
    cell=None,
    frame=0,
    name="memory",
    threads=None,
):
    """Renders particles to a picture.

    The interpreter is free for other threads meanwhile, and Ctrl-C stops. Arrays must not be written to meanwhile:
    the picture would be undefined.

    Parameters
    ----------
    positions : array (N, 3) or Frame
        World positions. Those in float32 that are C-contiguous and near zero are used without a copy. All others are
        converted to float32 relative to a common origin, which is subtracted in float64.
    look : str, optional
        "auto" (the default), "plain", "studio", "water", "whitted" or "none"; see the manual's page on defaults.
    radius : float, array (N,) or str, optional
        Radii of the spheres, in units of the positions; by default from the spacing of the particles. "vdw" and
        "covalent" are those of chemical elements, by the attribute `element`.
    attributes : dict of str to array, optional
        Other numbers of the particles, (N,) or (N, components), for colours, channels and motion.
    camera : dict, optional
        Keys of the section `camera` of a manifest, such as {"mode": "fixed", "eye": [5, 5, 3], "look_at": [0, 0, 0]}.
    settings : dict, optional
        Any sections of a manifest, such as {"render": {"surface": "smooth"}, "environment.type": "studio"}.
        Paths in it are relative to the current directory.
    time : float, optional
        Simulation time, for overlays and the header of the EXR.
    size : (int, int), optional
        Width and height in pixels.
    samples : int, optional
        Samples per pixel.
    color : optional
        `material.color`: linear RGB, the name of an attribute, a dict such as {"attribute": "velocity", "map":
        "viridis"}, or an array (N, 3) with a colour for each particle: linear, or sRGB if it is uint8.
    channels : list of str, optional
        `output.channels`, such as ["Z", "N", "id"].
    up : str, optional
        The up axis, such as "y", "z" or "-x".
    cell : Cell or array, optional
        The simulation cell: edges (3, 3), one in each row, or the three lengths of a box. It is drawn if the particles
        fill it.
    frame : int
        Number of the frame, for moving cameras and overlays.
    name : str
        Name of the particles, in messages and overlays.
    threads : int, optional
        Number of threads; by default one for each processor.

    Returns
    -------
    Image

    Raises
    ------
    ArrayError
        An array has a wrong shape, type or value.
    SettingError
        A setting does not exist, has a wrong value, or does not go with the particles.
    InputError
        The particles cannot be rendered.
    """
    if isinstance(positions, Frame):
        given = positions
        positions = given.positions
        attributes = given.attributes if attributes is None else attributes
        time = given.time if time is None else time
        up = given.up if up is None else up
        frame = given.number if frame == 0 else frame
        name = given.name if name == "memory" else name
        cell = given.cell if cell is None else cell
    positions = _arrays.positions_of(positions)
    count = len(positions)
    common, radii = (radius, None) if isinstance(radius, str) else _arrays.radius_of(radius, count)
    attributes = _arrays.attributes_of(attributes, count)
    color = _arrays.color_of(color, attributes, count)
    if radii is not None:
        if any(known.lower() == "radius" for known, _ in attributes):
            raise ArrayError("radius: attributes have radii too; give one of them", place="radius")
        attributes.append(("radius", radii))
    if time is not None and not isinstance(time, (int, float)):
        time = float(time)
    image = {"samples": samples}
    if size is not None:
        try:
            image["width"], image["height"] = size
        except (TypeError, ValueError):
            raise ArrayError(f"size: expected (width, height), found {size!r}", place="size") from None
    sections = merged(
        settings,
        input={"radius": common, "up": up},
        camera=camera,
        image=image,
        material={"color": color},
        output={"channels": channels},
    )
    if look is not None:
        sections["look"] = look
    text = settings_text(sections)
    native = _spherule.render(
        positions,
        attributes,
        text,
        base=os.getcwd(),
        frame=frame,
        name=name,
        time=time,
        cell=_cell(cell),
        threads=_arrays.threads_of(threads),
    )
    return Image(native)


def _cell(cell):
    """Corner, edges and periodic edges for the native module."""
    if cell is None:
        return None
    if not isinstance(cell, Cell):
        cell = Cell(cell)
    origin = [float(value) for value in cell.origin]
    return origin, cell.vectors.tolist(), [bool(value) for value in cell.periodic]
