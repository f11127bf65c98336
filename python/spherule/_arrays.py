"""Checks and converts arrays to what the native module takes."""

import math

import numpy as np

from ._errors import ArrayError

_ROWS = 1 << 20
_TYPES = ("f4", "f8", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8")


def _numbers(name, array):
    """`array` as numbers of a supported type in the order of this machine."""
    try:
        if isinstance(array, np.ma.MaskedArray):
            array = array.astype(np.float64).filled(np.nan)
        array = np.asarray(array)
    except (ValueError, TypeError) as error:
        raise ArrayError(f"{name}: {error}", place=name) from None
    if array.dtype.kind == "b":
        return array.astype(np.uint8)
    if array.dtype == np.float16:
        return array.astype(np.float32)
    native = array.dtype.newbyteorder("=")
    if array.dtype.kind not in "fiu" or native.str[1:] not in _TYPES:
        raise ArrayError(
            f"{name}: expected real numbers, found the type {array.dtype}; convert them with .astype(numpy.float32)",
            place=name,
        )
    return array.astype(native, copy=False)


def _check_finite(name, array):
    for first in range(0, len(array), _ROWS):
        part = array[first : first + _ROWS]
        finite = np.isfinite(part)
        if not finite.all():
            row = first + int(np.argwhere(~finite)[0][0])
            raise ArrayError(
                f"{name}: particle {row} is not finite; "
                f"leave such particles out: keep = numpy.isfinite({name}).reshape(len({name}), -1).all(axis=1)",
                place=name,
            )


def positions_of(positions):
    """Positions as float32 or float64 `(N, 3)`, C-contiguous and aligned; the same array if it is that already."""
    array = _numbers("positions", positions)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ArrayError(
            f"positions: expected the shape (N, 3), found {array.shape}; stack the coordinates with numpy.column_stack",
            place="positions",
        )
    if array.dtype.kind != "f":
        array = array.astype(np.float64)
    array = np.require(array, requirements=["C", "A"])
    _check_finite("positions", array)
    return array


def attributes_of(attributes, count):
    """Attributes as a list of names and arrays."""
    if attributes is None:
        return []
    if not hasattr(attributes, "items"):
        raise ArrayError(
            f"attributes: expected a dict of arrays, found {type(attributes).__name__}", place="attributes"
        )
    return [(_name(name), _attribute(name, array, count)) for name, array in attributes.items()]


def _name(name):
    if not isinstance(name, str) or not name:
        raise ArrayError(f"attributes: expected names as keys, found {name!r}", place="attributes")
    return name


def _attribute(name, array, count):
    place = f"attributes[{name!r}]"
    array = _numbers(place, array)
    if array.ndim not in (1, 2) or (array.ndim == 2 and array.shape[1] == 0):
        raise ArrayError(f"{place}: expected the shape (N,) or (N, components), found {array.shape}", place=place)
    if len(array) != count:
        raise ArrayError(f"{place}: {len(array)} values for {count} particles", place=place)
    return np.require(array, requirements=["C", "A"])


def radius_of(radius, count):
    """A common radius and an array of radii; one of them is None, or both."""
    if radius is None or (isinstance(radius, str) and radius == "auto"):
        return None, None
    if isinstance(radius, str):
        raise ArrayError(f"radius: expected a number or an array, found {radius!r}", place="radius")
    array = _numbers("radius", radius)
    if array.ndim > 1 or (array.ndim == 1 and len(array) != count):
        raise ArrayError(
            f"radius: expected one number or the shape ({count},), found the shape {array.shape}", place="radius"
        )
    if array.ndim == 0:
        value = float(array)
        if not (value > 0 and math.isfinite(value)):
            raise ArrayError(f"radius: expected a positive number, found {value}", place="radius")
        return value, None
    _check_finite("radius", array)
    if len(array) and array.min() <= 0:
        row = int(np.argmin(array))
        raise ArrayError(f"radius: {array[row]} of particle {row} is not positive", place="radius")
    return None, np.ascontiguousarray(array, dtype=np.float32)


def color_of(color, attributes, count):
    """The setting `material.color`. An array with a colour for each particle is added to `attributes`."""
    if isinstance(color, str):
        return color if color in ("auto", "elements") else {"attribute": color}
    if color is None or hasattr(color, "items"):
        return color
    array = _numbers("color", color)
    if array.ndim == 1:
        return array.tolist()
    if array.shape not in ((count, 3), (count, 4)):
        raise ArrayError(
            f"color: expected three numbers or the shape ({count}, 3), found the shape {array.shape}; numbers for a "
            f"colour map are an attribute",
            place="color",
        )
    known = [name.lower() for name, _ in attributes]
    if "cd" in known:
        raise ArrayError("color: attributes have colours `Cd` too; give one of them", place="color")
    attributes.append(("Cd", np.require(array, requirements=["C", "A"])))
    return {"attribute": "Cd"}


def cell_vectors_of(vectors):
    """The edges of a cell, float64 (3, 3)."""
    array = _numbers("cell", vectors).astype(np.float64)
    if array.shape == (3,):
        array = np.diag(array)
    if array.shape != (3, 3):
        raise ArrayError(
            f"cell: expected the edges, of the shape (3, 3), or three lengths, found the shape {array.shape}",
            place="cell",
        )
    _check_finite("cell", array)
    return array


def threads_of(threads):
    """A number of threads, or None."""
    if threads is None:
        return None
    if isinstance(threads, bool) or not isinstance(threads, (int, np.integer)) or not 1 <= threads <= 1024:
        raise ArrayError(f"threads: expected an integer from 1 to 1024, found {threads!r}", place="threads")
    return int(threads)
