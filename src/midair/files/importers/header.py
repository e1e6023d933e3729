"""JSON header in one line, for formats that cannot store rate, unit, sensor and provenance."""

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import BrokenFileError
from midair.files.native.hdf5 import check_format, signature
from midair.files.native.provenance_json import from_plain, to_plain
from midair.files.opened_take import ImportOptions, OpenedTake
from midair.files.text_files import json_of
from midair.model import Recording, SensorGrid


def header_of(recording: Recording, *, scale_exponent: int | None = None) -> str:
    """All data of a recording except its samples, as one line of ASCII; full scale is 2^scale_exponent."""
    sensor = recording.sensor
    plain: dict[str, Any] = {
        **signature("recording", recording.provenance),
        "frames": recording.frames,
        "rate_hz": recording.rate,
        "unit": recording.unit,
        "sensor": {"rows": sensor.rows, "columns": sensor.columns, "pitch_m": sensor.pitch, "name": sensor.name},
        "provenance": to_plain(recording.provenance),
    }
    if scale_exponent is not None:
        plain["scale_exponent"] = scale_exponent
    return json.dumps(plain, allow_nan=False)


def own_take(text: str, samples: NDArray[np.float64], given: ImportOptions, path: Path) -> OpenedTake:
    """Recording of a header and samples of shape (frame, ...), in parts of full scale if the header states that.

    Raises BrokenFileError if the header is invalid or the number of samples wrong, UnknownFormatError if it is of a
    newer midair, MismatchError if an option contradicts it.
    """
    header = json_of(text)
    if not isinstance(header, dict) or header.get("kind") != "midair recording":
        raise BrokenFileError(f"{path}: expected the header of a midair recording, got {text[:60]!r}")
    check_format(header.get("format"), path)
    part = header["sensor"]
    if not isinstance(part["name"], str):
        raise BrokenFileError(f"{path}: expected text as the sensor's name, got {part['name']!r}")
    sensor = SensorGrid(rows=part["rows"], columns=part["columns"], pitch=part["pitch_m"], name=part["name"])
    expected = header["frames"] * sensor.count
    if samples.size != expected or not samples.size:
        raise BrokenFileError(
            f"{path}: expected {header['frames']} frames of {sensor.count} channels, got {samples.size} samples "
            f"instead of {expected}; the file was truncated or edited, copy it again"
        )
    recording = Recording(
        samples=np.ldexp(samples, header.get("scale_exponent", 0)).reshape(-1, *sensor.shape),
        rate=header["rate_hz"],
        sensor=sensor,
        unit=header["unit"],
        provenance=from_plain(header["provenance"]),
    )
    given.check(recording, path)
    return OpenedTake(recording=recording)
