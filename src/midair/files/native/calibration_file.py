"""Calibrations of sensors (`name.calibration.h5`, or a group of a recording) and of arrays (`name.array.h5`)."""

import os
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from midair.errors import BrokenFileError, UnknownFormatError
from midair.files.native.hdf5 import check_kind, kind_of, new_file, read_group, signature, stored_group, write_group
from midair.files.native.provenance_json import from_json
from midair.files.native.raw_recording import open_file
from midair.files.native.schema import array_from, array_values, sensor_from, sensor_values
from midair.model import ArrayCalibration, Calibration, Crosstalk, Linearity, Measurement

if TYPE_CHECKING:
    import h5py

CALIBRATION_SUFFIX = ".calibration.h5"

MEASUREMENT: Mapping[str, str] = {field.name: field.name for field in fields(Measurement)}
CROSSTALK: Mapping[str, str] = {"crosstalk": "matrix", "crosstalk_uncertainty": "uncertainty"}
LINEARITY: Mapping[str, str] = {
    {"pressure": "level_pressure", "output": "level_output"}.get(field.name, field.name): field.name
    for field in fields(Linearity)
}
"""Mappings of names in the file to attributes."""

Part = TypeVar("Part", Measurement, Crosstalk, Linearity)


def save_calibration(calibration: Calibration, path: str | os.PathLike[str]) -> None:
    """Write a calibration atomically to a ``.calibration.h5`` file.

    Raises UnknownFormatError or FileError if the name has another suffix, or the file cannot be written.
    """
    if not os.fspath(path).lower().endswith(CALIBRATION_SUFFIX):
        raise UnknownFormatError(f"{path}: expected a name that ends in {CALIBRATION_SUFFIX} for a calibration")
    with new_file(path) as file:
        write_group(file, "calibration", calibration_values(calibration))


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
        if (kind := kind_of(file)) == "midair calibration":
            return read_calibration(file, Path(path))
        if kind == "midair recording":
            return read_calibration(stored_group(file, "calibration"), Path(path)) if "calibration" in file else None
        found = kind or "an HDF5 file of another program"
        raise BrokenFileError(f"{path}: expected a midair calibration or recording, got {found}")


def calibration_values(calibration: Calibration) -> dict[str, Any]:
    """Stored values of a calibration."""
    values = {
        **signature("calibration", calibration.provenance),
        **sensor_values(calibration.sensor),
        "unit": calibration.unit,
        "date": calibration.date,
        "frequency": calibration.frequency,
        "response_real": calibration.response.real,
        "response_imag": calibration.response.imag,
        "noise": calibration.noise,
        "version": calibration.version,
        **_stored(calibration.measurement, MEASUREMENT),
        **_stored(calibration.crosstalk, CROSSTALK),
        **_stored(calibration.linearity, LINEARITY),
    }
    if calibration.crosstalk:
        values |= dict.fromkeys(("channel", "pressed"), np.arange(calibration.sensor.count))
    if calibration.linearity:
        values["level"] = np.arange(calibration.linearity.levels)
    return values


def read_calibration(group: "h5py.Group", path: Path) -> Calibration:
    """Read the calibration in a group of the file `path`."""
    values = read_group(group, "calibration", path)
    return Calibration(
        sensor=sensor_from(values),
        frequency=values["frequency"],
        response=values["response_real"] + 1j * values["response_imag"],
        noise=values["noise"],
        unit=values["unit"],
        date=values["date"],
        provenance=from_json(values["provenance"]),
        version=values["version"],
        measurement=_part(Measurement, MEASUREMENT, values, path),
        crosstalk=_part(Crosstalk, CROSSTALK, values, path),
        linearity=_part(Linearity, LINEARITY, values, path),
    )


def _part(part: type[Part], names: Mapping[str, str], values: Mapping[str, Any], path: Path) -> Part | None:
    """An optional part of a calibration; raises BrokenFileError if it is incomplete."""
    present = [name for name in names if name in values]
    if not present:
        return None
    if len(present) < len(names):
        missing = ", ".join(name for name in names if name not in values)
        raise BrokenFileError(f"{path}: expected {missing} beside {present[0]}, found none; the file is damaged")
    return part(**{attribute: values[name] for name, attribute in names.items()})


def _stored(part: object, names: Mapping[str, str]) -> dict[str, Any]:
    return {} if part is None else {name: getattr(part, attribute) for name, attribute in names.items()}


ARRAY_SUFFIX = ".array.h5"

_ERRORS = ("strength_uncertainty", "phase_uncertainty", "resonance_uncertainty", "quality_uncertainty")


def save_array_calibration(calibration: ArrayCalibration, path: str | os.PathLike[str]) -> None:
    """Write an array calibration atomically to a ``.array.h5`` file.

    Raises UnknownFormatError or FileError if the name has another suffix, or the file cannot be written.
    """
    if not os.fspath(path).lower().endswith(ARRAY_SUFFIX):
        raise UnknownFormatError(f"{path}: expected a name that ends in {ARRAY_SUFFIX} for an array's calibration")
    values = {
        **signature("array", calibration.provenance),
        **array_values(calibration.array),
        "date": calibration.date,
        "level_uncertainty": calibration.level_uncertainty,
        "response_real": calibration.response.real,
        "response_imag": calibration.response.imag,
        "pole_real": calibration.pole.real,
        "pole_imag": calibration.pole.imag,
        **{name: getattr(calibration, name) for name in _ERRORS},
        "dead": calibration.dead.astype(np.int8),
    }
    if calibration.reflection_uncertainty:
        both = {"real": calibration.reflection.real, "imag": calibration.reflection.imag}
        values |= {f"reflection_{name}": value for name, value in both.items()}
        values["reflection_uncertainty"] = calibration.reflection_uncertainty
    if calibration.pose_covariance.any():
        values |= {"pose": np.arange(calibration.pose.size), "unit_pose": calibration.pose.ravel()}
        values["unit_pose_covariance"] = calibration.pose_covariance
    with new_file(path) as file:
        write_group(file, "array", values)


def load_array_calibration(path: str | os.PathLike[str]) -> ArrayCalibration:
    """Read an array calibration.

    Raises MissingFileError, BrokenFileError or UnknownFormatError if the file does not exist, is damaged or of another
    type, or was written by a newer midair.
    """
    with open_file(path) as file:
        check_kind(file, "array", Path(path))
        values = read_group(file, "array", Path(path))
    return ArrayCalibration(
        array=array_from(values),
        response=values["response_real"] + 1j * values["response_imag"],
        pole=values["pole_real"] + 1j * values["pole_imag"],
        dead=values["dead"].astype(bool),
        # Without uncertainties there are no poses.
        pose=np.reshape(values.get("unit_pose", []), (-1, 7)),
        pose_covariance=values.get("unit_pose_covariance", np.zeros((0, 0))),
        reflection=values.get("reflection_real", 0.0) + 1j * values.get("reflection_imag", 0.0),
        reflection_uncertainty=values.get("reflection_uncertainty", 0.0),
        level_uncertainty=values["level_uncertainty"],
        date=values["date"],
        provenance=from_json(values["provenance"]),
        **{name: values[name] for name in _ERRORS},
    )
