"""Render jobs."""

import os
import tempfile

from . import _arrays, _spherule
from ._command import json_lines
from ._errors import JobError, SettingError
from ._settings import settings_text


class Job:
    """A render job, the same as of the command: images, plan and ledger in the directory of the output.

    Several processes may run the same job; they share its frames.

    Parameters
    ----------
    manifest : dict or path
        The sections of a manifest, with `input.path` and `output.path` relative to the current directory, the file of a
        manifest, or the directory of a job.
    settings : dict, optional
        Settings that replace those of the manifest.
    """

    def __init__(self, manifest, *, settings=None):
        self._base = os.getcwd()
        self._dir = None
        if isinstance(manifest, (str, os.PathLike)):
            path = os.path.abspath(manifest)
            self._file = os.path.join(path, "job.toml") if os.path.isdir(path) else path
            self._text = settings_text(settings or {})
        else:
            self._file = None
            if not hasattr(manifest, "items"):
                raise SettingError(f"manifest: expected a dict or a path, found {type(manifest).__name__}")
            self._text = settings_text({**manifest, **(settings or {})})

    def run(self, *, progress=None, mode="resume", threads=None):
        """Renders the frames that are not done yet.

        Parameters
        ----------
        progress : callable, optional
            Is called with a dict for each event, from several threads: `event` is "stage", "done", "failed" or "note",
            with `frame` and `stage`, `outputs`, `reason` or `text`. An exception in it ends the run.
        mode : str
            "resume", "force" (start over) or "keep_done" (keep finished frames although settings have changed).
        threads : int, optional
            Number of threads; by default one for each processor.

        Returns
        -------
        dict
            `dir`, and of all frames of the job `total`, `done`, `pending` and `failed` (a list of numbers).

        Raises
        ------
        KeyboardInterrupt
            After the first Ctrl-C, frames in progress are finished and recorded; after the second, they are dropped.
        JobError, SettingError, InputError, OutputError
            The job cannot start or continue.
        """
        if mode not in ("resume", "force", "keep_done"):
            raise JobError(f"mode: {mode!r} is unknown; choose resume, force or keep_done", place="mode")
        if progress is not None and not callable(progress):
            raise JobError(f"progress: expected a callable, found {type(progress).__name__}", place="progress")
        result = _spherule.run_job(
            self._file,
            self._text,
            base=self._base,
            mode=mode,
            progress=progress,
            threads=_arrays.threads_of(threads),
        )
        result["dir"] = os.fspath(result["dir"])
        self._dir = result["dir"]
        return result

    def check(self):
        """What `run` would do, without writing anything: the dict of `spherule check --json`.

        Raises
        ------
        JobError
            The check itself fails; problems of the job are in the dict.
        """
        if self._file is not None:
            return self._checked(self._file)
        with tempfile.TemporaryDirectory() as empty:
            path = os.path.join(empty, "job.toml")
            _spherule.write_manifest(path, self._text, base=self._base)
            return self._checked(path, lambda text: _without(empty, self._base, text))

    def _checked(self, path, shown=str):
        return json_lines("check", "--json", path, error=JobError, shown=shown)[0][0]

    @property
    def dir(self):
        """The directory of the images."""
        if self._dir is None:
            self._dir = os.fspath(_spherule.job_dir(self._file, self._text, base=self._base))
        return self._dir

    def status(self):
        """The state of the job and of its workers: the dict of `spherule status --json`."""
        return json_lines("status", "--json", self.dir, error=JobError)[0][0]

    def verify(self):
        """Checks all images against the ledger: the dicts of `spherule verify --json`, one for each frame."""
        return json_lines("verify", "--json", self.dir, error=JobError)[0]


def _without(directory, base, text):
    """`text` about a manifest in `directory`, in which paths are relative to `base` or absolute."""
    text = text.replace(os.path.join(directory, "job.toml") + ": ", "")
    depth = os.path.realpath(directory).count(os.sep)
    to_base = os.path.relpath(base, os.path.realpath(directory))
    text = text.replace(os.path.join(directory, to_base) + os.sep, "")
    return text.replace(directory + (os.sep + os.pardir) * depth, "")
