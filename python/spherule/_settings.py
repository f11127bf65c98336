"""Settings as dicts: the sections and keys of a manifest."""

import json
import os

import numpy as np

from ._errors import SettingError


def _plain(value):
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    raise SettingError(f"settings: expected numbers, text, lists and dicts, found {type(value).__name__}")


def settings_text(settings):
    """`settings` for the native module."""
    if not hasattr(settings, "items"):
        raise SettingError(f"settings: expected a dict, found {type(settings).__name__}")
    try:
        return json.dumps(dict(settings), default=_plain, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise SettingError(f"settings: {error}") from None


def merged(settings, **sections):
    """`settings` with the keys of `sections`, which take precedence, and which may be None."""
    if settings is not None and not hasattr(settings, "items"):
        raise SettingError(f"settings: expected a dict, found {type(settings).__name__}")
    result = {key: value for key, value in (settings or {}).items()}
    for key, value in result.items():
        if not isinstance(key, str):
            raise SettingError(f"settings: expected text as keys, found {key!r}")
        if key.split(".")[0] == "input" and (key == "input.path" or "path" in (value if hasattr(value, "items") else {})):
            raise SettingError("input.path: the particles are in memory; leave it out", place="input.path")
    for section, keys in sections.items():
        if keys is None:
            continue
        if not hasattr(keys, "items"):
            raise SettingError(f"{section}: expected a dict, found {type(keys).__name__}", place=section)
        for key, value in keys.items():
            if value is not None:
                result[f"{section}.{key}"] = value
    return result
