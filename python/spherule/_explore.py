"""A page on which the view and the settings of pictures are found."""

import html
import json
import os
import shutil
import subprocess
import tempfile
import urllib.error
import urllib.request
import weakref

import numpy as np

from ._command import command
from ._errors import Error, InputError, SettingError
from ._frames import Frame, write_spf


class Explorer:
    """A page in a browser or in a notebook, with its pictures. Made by `explore`; ends with `close`, with a `with`
    block, or with the program."""

    def __init__(self, inputs, directory, settings, height):
        self._height = height
        arguments = [command(), "explore", *inputs, "--no-browser"]
        for key, value in settings.items():
            arguments += ["--set", f"{key}={_toml(value)}"]
        # A pipe that nobody reads would stop the command
        self._messages = tempfile.TemporaryFile("w+")
        self._process = subprocess.Popen(
            arguments, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=self._messages, text=True)
        self._end = weakref.finalize(self, _close, self._process, directory)
        #: The address of the page, which contains its secret token.
        self.url = self._process.stdout.readline().strip()
        if not self.url:
            self.close()
            self._messages.seek(0)
            message = self._messages.read()
            lines = [line.removeprefix("error: ") for line in message.splitlines() if line.startswith("error: ")]
            raise InputError("\n".join(lines) or "the page has not started")

    @property
    def settings(self):
        """What was chosen on the page: a dictionary of dotted keys, as `render` and `Job` take them."""
        found = self._chosen()
        return {own["key"]: own["value"] for own in found["settings"]} if found else {}

    @property
    def camera(self):
        """The view of the last picture: eye, look_at, up and fov, as `render` takes them; None before it."""
        found = self._chosen()
        view = found and found["view"]
        if not view:
            return None
        keys = ["eye", "look_at", "up", "projection", "height" if view["projection"] == "orthographic" else "fov"]
        return {"mode": "fixed", **{key: view[key] for key in keys}}

    @property
    def frame(self):
        """Number of the frame that is shown; None before the first picture."""
        found = self._chosen()
        return found and found["frame"]

    def close(self):
        """Ends the page and removes its temporary files. Jobs that it has started go on."""
        self._end()

    def _chosen(self):
        try:
            with urllib.request.urlopen(self.url + "chosen", timeout=30) as answer:
                return json.load(answer)
        except (urllib.error.URLError, OSError):
            raise Error("the page has ended; call explore again") from None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def __repr__(self):
        return f"Explorer({self.url!r})"

    def _repr_html_(self):
        return (f'<iframe src="{html.escape(self.url)}" width="100%" height="{self._height}" '
                'style="border: 0" title="spherule explore"></iframe>')


def explore(data, *, attributes=None, radius=None, settings=None, height=720):
    """Opens a page on which the camera, colours and other settings are found with the mouse.

    In a notebook, the value of the cell is the page; elsewhere, open `url`. The page is served to this machine only.

    Parameters
    ----------
    data : array (N, 3), Frame or path
        Positions; or files: a directory, a pattern or a manifest, as the command takes them.
    attributes : dict of arrays, optional
        Values of the particles, by name.
    radius : float or array (N,), optional
        Radii, in units of the positions.
    settings : dict, optional
        Keys of the manifest with which the page begins, such as {"image.width": 960}.
    height : int
        Height of the page in a notebook, pixels.

    Returns
    -------
    Explorer
        `settings` and `camera` are what was found.

    Raises
    ------
    InputError
        The particles cannot be used, or the files are not there.
    """
    directory = None
    if isinstance(data, (str, os.PathLike, Frame)) and (attributes is not None or radius is not None):
        raise SettingError("attributes and radius belong to arrays; files and frames have their own")
    if isinstance(data, (str, os.PathLike)):
        inputs = [os.fspath(data)]
    else:
        directory = tempfile.mkdtemp(prefix="spherule-")
        path = os.path.join(directory, "particles.spf")
        try:
            if isinstance(data, Frame):
                own = {"radius": data.radius, "attributes": data.attributes, "time": data.time}
                write_spf(path, data.positions, **own)
            else:
                write_spf(path, data, radius=radius, attributes=attributes)
        except BaseException:
            shutil.rmtree(directory, ignore_errors=True)
            raise
        inputs = [path]
    return Explorer(inputs, directory, settings or {}, height)


def _toml(value):
    """A value in TOML: that of JSON, but for tables."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(str(key))} = {_toml(own)}" for key, own in value.items()) + " }"
    if isinstance(value, (list, tuple, np.ndarray)):
        return "[" + ", ".join(_toml(own) for own in value) + "]"
    if isinstance(value, np.generic):
        value = value.item()
    return json.dumps(value)


def _close(process, directory):
    process.terminate()
    try:
        process.wait(10)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    process.stdout.close()
    if directory:
        shutil.rmtree(directory, ignore_errors=True)
