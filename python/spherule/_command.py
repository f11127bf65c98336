"""The command `spherule` of the same installation."""

import json
import os
import shutil
import subprocess
import sys
import sysconfig

from ._errors import Error, InputError


def command():
    """The path of the command `spherule` that was installed with this package.

    Raises
    ------
    Error
        It is not there.
    """
    name = "spherule.exe" if os.name == "nt" else "spherule"
    schemes = [None, sysconfig.get_preferred_scheme("user")]
    paths = [sysconfig.get_path("scripts", scheme) if scheme else sysconfig.get_path("scripts") for scheme in schemes]
    for path in [*paths, os.path.dirname(sys.executable)]:
        found = os.path.join(path, name)
        if os.access(found, os.X_OK):
            return found
    found = shutil.which(name)
    if found is None:
        raise Error("the command spherule is not installed; install the package from its wheel")
    return found


def json_lines(*arguments, error=InputError, shown=str):
    """The JSON objects that the command prints, one for each line, and its exit code. `shown` changes its texts."""
    done = subprocess.run([command(), *arguments], capture_output=True, text=True, stdin=subprocess.DEVNULL)
    if not done.stdout.strip():
        message = shown(done.stderr).strip().removeprefix("error: ") or f"the command ended with code {done.returncode}"
        raise error(message)
    decoder, objects, text = json.JSONDecoder(), [], shown(done.stdout).strip()
    while text:
        value, end = decoder.raw_decode(text)
        objects.append(value)
        text = text[end:].lstrip()
    return objects, done.returncode


def inspect(path):
    """What is in a particle file: counts, bounds and attributes, as `spherule inspect --json` prints it.

    Parameters
    ----------
    path : path
        One file with one time step.

    Returns
    -------
    dict

    Raises
    ------
    InputError
        The file cannot be read, or it has several time steps.
    """
    path = os.fspath(path)
    objects, _ = json_lines("inspect", "--json", "--", path)
    if len(objects) != 1:
        raise InputError(f"{path}: {len(objects)} time steps or files; inspect one at a time", file=path)
    if "error" in objects[0]:
        raise InputError(objects[0]["error"], file=path)
    return objects[0]
