"""The exceptions of the package."""


class Error(Exception):
    """The base of all exceptions of spherule.

    Attributes
    ----------
    file : str or None
        The file that the message is about.
    place : str or None
        The place in it: a byte, the key of a setting, or the name of an argument.
    remedy : str or None
        What to do about it: the part of the message after the last semicolon, if there is one.
    """

    def __init__(self, message, file=None, place=None, remedy=None):
        super().__init__(message)
        self.file = file
        self.place = place
        if remedy is None and "; " in str(message):
            remedy = str(message).rsplit("; ", 1)[1]
        self.remedy = remedy


class InputError(Error):
    """Particles that cannot be read or rendered."""


class ArrayError(InputError, ValueError):
    """An array with a wrong shape, type or value; `place` is the argument."""


class SettingError(Error, ValueError):
    """A setting that does not exist, has a wrong value, or does not go with the particles; `place` is its key."""


class OutputError(Error):
    """A file that cannot be written."""


class JobError(Error):
    """A job that refuses to start or to continue, or that has frames without images."""


class InternalError(Error):
    """A fault of spherule itself. Please report it."""
