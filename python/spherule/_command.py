"""The command `spherule` of the same installation."""

import json
import os
import shutil
import subprocess
import sys
import sysconfig

from ._errors import Error, InputError, JobError


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


def _run(name, job, path, options):
    """Runs a command that makes the file `path` of a job."""
    arguments = [command(), name, os.fspath(job), "-o", os.fspath(path)]
    for key, value in options.items():
        option = "--" + key.replace("_", "-")
        if value is True:
            arguments.append(option)
        elif value is not None and value is not False:
            arguments.append(f"{option}={value}")
    done = subprocess.run(arguments, capture_output=True, text=True, stdin=subprocess.DEVNULL)
    if done.returncode:
        lines = [line.removeprefix("error: ") for line in done.stderr.splitlines() if line.startswith("error: ")]
        raise JobError("\n".join(lines) or done.stderr.strip() or f"the command ended with code {done.returncode}")
    return os.fspath(path)


def movie(job, path, **options):
    """Writes a movie of the finished pictures of a job.

    Parameters
    ----------
    job : path
        The directory of its images, such as `Job.dir`.
    path : path
        .mp4, .mov, .mkv and .webm need ffmpeg; .gif, .png and .webp do not.
    **options
        Options of `spherule movie`, such as fps=10, width=640 or partial=True.

    Returns
    -------
    str
        The path of the movie.

    Raises
    ------
    JobError
        Frames are missing, or the movie cannot be written.
    """
    return _run("movie", job, path, options)


def sheet(job, path, **options):
    """Writes the finished pictures of a job on one picture; see `movie`.

    Parameters
    ----------
    job : path
        The directory of its images, such as `Job.dir`.
    path : path
        The picture: .png, .pdf or .svg.
    **options
        Options of `spherule sheet`, such as columns=3, letters=True or colorbar="below".

    Returns
    -------
    str
        The path of the picture.

    Raises
    ------
    JobError
        There are no pictures, or the sheet cannot be written.
    """
    return _run("sheet", job, path, options)


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
