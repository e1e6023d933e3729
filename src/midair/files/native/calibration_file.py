"""Calibrations of sensors (`name.calibration.h5`, or a group of a recording) and of arrays (`name.array.h5`)."""

import os
from pathlib import Path

import numpy as np

from midair.errors import BrokenFileError, UnknownFormatError
from midair.files.native.hdf5 import kind_of, new_file, read_group, read_part, write_group
from midair.files.native.raw_recording import open_file
from midair.files.native.schema import built, stored_values
from midair.model import ArrayCalibration, Calibration
from midair.validation import checked_call

CALIBRATION_SUFFIX = ".calibration.h5"


def save_calibration(calibration: Calibration, path: str | os.PathLike[str]) -> None:
    """Write a calibration atomically to a ``.calibration.h5`` file.

    Raises UnknownFormatError or FileError if the name has another suffix, or the file cannot be written.
    """
    if not os.fspath(path).lower().endswith(CALIBRATION_SUFFIX):
        raise UnknownFormatError(f"{path}: expected a name that ends in {CALIBRATION_SUFFIX} for a calibration")
    with new_file(path) as file:
        write_group(file, "calibration", stored_values("calibration", calibration))


@checked_call
def load_calibration(path: str | os.PathLike[str]) -> Calibration | None:
    """Read a calibration; None if `path` is a recording that has none.

    Raises MissingFileError, BrokenFileError or UnknownFormatError if the file does not exist, is damaged or of another
    type, or was written by a newer midair.

    Parameters
    ----------
    path : str or PathLike
        An HDF5 file of midair: a calibration or a recording.
    """
    with open_file(path) as file:
        if (kind := kind_of(file)) not in ("midair calibration", "midair recording"):
            found = kind or "an HDF5 file of another program"
            raise BrokenFileError(f"expected a midair calibration or recording, got {found}")
        return read_part(file, "calibration", Calibration, Path(path))


ARRAY_SUFFIX = ".array.h5"


def save_array_calibration(calibration: ArrayCalibration, path: str | os.PathLike[str]) -> None:
    """Write an array calibration atomically to a ``.array.h5`` file.

    Raises UnknownFormatError or FileError if the name has another suffix, or the file cannot be written.
    """
    if not os.fspath(path).lower().endswith(ARRAY_SUFFIX):
        raise UnknownFormatError(f"{path}: expected a name that ends in {ARRAY_SUFFIX} for an array's calibration")
    values = stored_values("array", calibration)
    if calibration.pose_covariance.any():
        values |= {"unit_pose": calibration.pose.ravel(), "unit_pose_covariance": calibration.pose_covariance}
    with new_file(path) as file:
        write_group(file, "array", values)


def load_array_calibration(path: str | os.PathLike[str]) -> ArrayCalibration:
    """Read an array calibration.

    Raises MissingFileError, BrokenFileError or UnknownFormatError if the file does not exist, is damaged or of another
    type, or was written by a newer midair.
    """
    with open_file(path) as file:
        values = read_group(file, "array", Path(path))
        # Without uncertainties there are no poses.
        pose = np.reshape(values.get("unit_pose", []), (-1, 7))
        covariance = values.get("unit_pose_covariance", np.zeros((0, 0)))
        return built(ArrayCalibration, "array", values, pose=pose, pose_covariance=covariance)
