"""All errors that midair raises on purpose, in one tree: each states what was expected, what came, and what to do."""

from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from typing import Any


def did_you_mean(word: str, names: Iterable[str]) -> str:
    """End of a message with the name most like a word; empty if none is."""
    return "".join(f"; did you mean {name}?" for name in get_close_matches(word, names, n=1, cutoff=0.75))


class MidairError(Exception):
    """Root of every error that midair raises on purpose."""


class InputError(MidairError, ValueError):
    """A value that cannot be used.

    `parameters` correct the input, each as it is typed in Python; the message ends with this advice. `setting` is the
    name of the setting that is out of range, with which the message then begins. Several errors become one in a line.
    """

    def __init__(self, *args: object, parameters: Mapping[str, str] | None = None, setting: str = "") -> None:
        super().__init__(*args)
        self.parameters, self.setting = dict(parameters or {}), setting

    def __str__(self) -> str:
        return self.message({})

    def message(self, typed: Mapping[str, str]) -> str:
        """The message with parameters as they are typed elsewhere, such as options of a command."""
        advice = [typed.get(name, python) for name, python in self.parameters.items()]
        several = "; ".join(each.message(typed) for each in self.args if isinstance(each, InputError))
        return (several or super().__str__()) + (f"; give {', or '.join(advice)}" if advice else "")


class ShapeError(InputError):
    """An array with the wrong number of axes, or an axis of the wrong length."""


class NonFiniteError(InputError):
    """An array that holds NaN or infinity."""


class NegativePressureError(InputError):
    """Radiation pressure below zero: ultrasound can push, never pull."""


class RateError(InputError):
    """A frame rate that does not suit the operation."""


class BandError(InputError):
    """A frequency band that is empty, reversed, or outside the recording's spectrum."""


class UnitError(InputError):
    """A quantity whose unit is wrong or missing."""


class MismatchError(InputError):
    """Two objects that do not belong together, such as phases and another array."""


class ExposureError(InputError):
    """A drive above the exposure profile without an override; `exposure` is its `Exposure`, None if it is not known."""

    exposure: Any = None


class FileError(MidairError):
    """A file that cannot be read or written."""


class MissingFileError(FileError, FileNotFoundError):
    """A file that does not exist."""


class UnknownFormatError(FileError, ValueError):
    """A file name for which no reader or writer exists."""


class BrokenFileError(FileError, OSError):
    """A file that is truncated, damaged, or of another type than its name indicates."""


class DeviceError(MidairError):
    """A sensor or an array that failed to carry out a command."""


class UnknownDeviceError(DeviceError, LookupError):
    """A device name that is not registered."""


class DeviceStateError(DeviceError, RuntimeError):
    """A device whose methods were called in the wrong order, such as read before open."""


class HeldError(DeviceError):
    """A device that another program is using."""


class StoppedError(DeviceError):
    """Playback that a stop request has ended, such as `midair stop`."""


class LinkLostError(DeviceError, ConnectionError):
    """A device that answered before and no longer does."""


class SilentFramesError(DeviceError):
    """Frames of a drive that the array did not play."""


class TooHotError(DeviceError):
    """Array units above their temperature limit; the array stays silent until they have cooled."""


class ClusterError(MidairError, RuntimeError):
    """A cluster that does not answer, or has lost its workers."""


class MissingExtraError(MidairError, ImportError):
    """An optional package that is required here and not installed."""
