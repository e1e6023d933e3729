"""Every error that midair raises on purpose, in one tree.

::

    MidairError
    ├── InputError (ValueError)              a value that cannot be used
    │   ├── ShapeError                       wrong number of axes or length of one
    │   ├── NonFiniteError                   NaN or infinity
    │   ├── NegativePressureError            radiation pressure can only push
    │   ├── RateError                        a frame rate that does not fit
    │   ├── BandError                        a frequency band that holds nothing
    │   ├── UnitError                        a quantity in the wrong unit
    │   ├── MismatchError                    two things that do not belong together
    │   └── ExposureError                    a drive above the exposure profile
    ├── FileError
    │   ├── MissingFileError (FileNotFoundError)
    │   ├── UnknownFormatError (ValueError)  no reader or writer for this name
    │   └── BrokenFileError (OSError)        truncated, damaged, or of another kind
    ├── DeviceError
    │   ├── UnknownDeviceError (LookupError)
    │   ├── DeviceStateError (RuntimeError)  called in the wrong order
    │   ├── HeldError                        another program has it
    │   ├── StoppedError                     somebody asked for silence
    │   ├── LinkLostError (ConnectionError)  a unit that no longer answers
    │   ├── SilentFramesError                frames of a drive that did not sound
    │   └── TooHotError                      units of an array that have to cool
    ├── ClusterError (RuntimeError)          a cluster that does not answer or loses its workers
    └── MissingExtraError (ImportError)      an optional package is not installed

A message says what was expected, what came, and what to do.
"""


class MidairError(Exception):
    """Root of every error that midair raises on purpose."""


class InputError(MidairError, ValueError):
    """A value that cannot be used."""


class ShapeError(InputError):
    """An array with the wrong number of axes, or an axis of the wrong length."""


class NonFiniteError(InputError):
    """An array that holds NaN or infinity."""


class NegativePressureError(InputError):
    """Radiation pressure below zero: ultrasound can push, never pull."""


class RateError(InputError):
    """A frame rate that does not fit what is asked."""


class BandError(InputError):
    """A frequency band that is empty, upside down, or holds nothing of the recording."""


class UnitError(InputError):
    """A quantity whose unit does not fit, or that has none."""


class MismatchError(InputError):
    """Two things that do not belong together, such as phases and another array."""


class ExposureError(InputError):
    """A drive that exceeds the exposure profile and that nobody has answered for."""


class FileError(MidairError):
    """A file that cannot be read or written."""


class MissingFileError(FileError, FileNotFoundError):
    """A file that is not there."""


class UnknownFormatError(FileError, ValueError):
    """A file name for which there is no reader or writer."""


class BrokenFileError(FileError, OSError):
    """A file that is truncated, damaged, or not what its name says."""


class DeviceError(MidairError):
    """A sensor or an array that does not do what was asked."""


class UnknownDeviceError(DeviceError, LookupError):
    """A device name that nothing answers to."""


class DeviceStateError(DeviceError, RuntimeError):
    """A device called in the wrong order, such as read before open."""


class HeldError(DeviceError):
    """A device that another program has."""


class StoppedError(DeviceError):
    """An array that plays no more because somebody asked for silence, as `midair stop` does."""


class LinkLostError(DeviceError, ConnectionError):
    """A device that answered and no longer does."""


class SilentFramesError(DeviceError):
    """Frames of a drive that did not sound, though the array was told to play them."""


class TooHotError(DeviceError):
    """Units of an array that report too hot; the array is silent and plays again once they have cooled."""


class ClusterError(MidairError, RuntimeError):
    """A cluster that does not answer, or loses its workers."""


class MissingExtraError(MidairError, ImportError):
    """An optional package that is needed here and not installed."""
