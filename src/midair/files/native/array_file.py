"""Calibrations of arrays, `name.array.h5`: measured properties of the transducers."""

import os
from pathlib import Path

import numpy as np

from midair.errors import UnknownFormatError
from midair.files.native.hdf5 import check_kind, new_file, open_file, read_group, signature, write_group
from midair.files.native.provenance_json import from_json
from midair.model import ArrayCalibration, TransducerArray

ARRAY_SUFFIX = ".array.h5"

_ERRORS = ("strength_uncertainty", "phase_uncertainty", "resonance_uncertainty", "quality_uncertainty")


def save_array_calibration(calibration: ArrayCalibration, path: str | os.PathLike[str]) -> None:
    """Write an array calibration atomically to a ``.array.h5`` file.

    Raises UnknownFormatError or FileError if the name has another suffix, or the file cannot be written.
    """
    if not os.fspath(path).lower().endswith(ARRAY_SUFFIX):
        raise UnknownFormatError(f"{path}: expected a name that ends in {ARRAY_SUFFIX} for an array's calibration")
    array = calibration.array
    values = {
        **signature("array", calibration.provenance),
        "array_name": array.name,
        "array_pressure_pa_m": array.pressure,
        "array_frequency_hz": array.frequency,
        "date": calibration.date,
        "level_uncertainty": calibration.level_uncertainty,
        "transducer": np.arange(array.count),
        "axis": np.arange(3),
        "transducer_position": array.position,
        "transducer_normal": array.normal,
        "transducer_unit": array.unit,
        "response_real": calibration.response.real,
        "response_imag": calibration.response.imag,
        "pole_real": calibration.pole.real,
        "pole_imag": calibration.pole.imag,
        **{name: getattr(calibration, name) for name in _ERRORS},
        "dead": calibration.dead.astype(np.int8),
    }
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
        array=TransducerArray(
            position=values["transducer_position"],
            normal=values["transducer_normal"],
            unit=values["transducer_unit"],
            pressure=values["array_pressure_pa_m"],
            frequency=values["array_frequency_hz"],
            name=values["array_name"],
        ),
        response=values["response_real"] + 1j * values["response_imag"],
        pole=values["pole_real"] + 1j * values["pole_imag"],
        dead=values["dead"].astype(bool),
        level_uncertainty=values["level_uncertainty"],
        date=values["date"],
        provenance=from_json(values["provenance"]),
        **{name: values[name] for name in _ERRORS},
    )
