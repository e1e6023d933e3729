"""MPEG haptics, the JSON interchange form `.hjif` (ISO/IEC 23090-31): one channel a cell, its samples as a curve.

The standard describes effects for actuators, in parts of full scale, at whole ticks. Its modality "Pressure" and a
curve of one keyframe a frame, joined by straight lines, keep the waveform of every cell; runs of one value need but
their ends. What the standard has no place for is told.
The names follow the files that MPEG's public reference software writes (HapticReferenceSoftware, BSD).
"""

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.files.atomic import whole_file
from midair.files.loss import Loss, calibration_lost
from midair.model import Calibration, Recording
from midair.version import __version__

VERSION = "2023"
"""Edition of the standard that the file names."""

_STEPS = 32767  # of the amplitude, each way


def write_hjif(recording: Recording, path: Path, calibration: Calibration | None) -> tuple[Loss, ...]:
    """Write the change of every cell from its median as a curve of -1 to 1, 1 being the largest change of any cell.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    still = np.median(recording.samples, axis=0)
    change = recording.samples - still
    peak = float(np.abs(change).max())
    rounded = np.round(change / (peak or 1.0) * _STEPS) / _STEPS
    timescale, ticks = _ticks(recording)
    cells = rounded.reshape(recording.frames, -1).T
    plain: dict[str, Any] = {
        "version": VERSION,
        "profile": "Main",
        "level": 1,
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "description": _description(recording, peak),
        "timescale": timescale,
        "avatars": [{"id": 0, "lod": 0, "type": "Pressure"}],
        "perceptions": [
            {
                "id": 0,
                "avatar_id": 0,
                "description": recording.sensor.name,
                "perception_modality": "Pressure",
                "unit_exponent": -3,
                "perception_unit_exponent": 0,
                "reference_devices": [],
                "effect_library": [],
                "channels": [_channel(recording, i, cell, ticks) for i, cell in enumerate(cells)],
            }
        ],
        "syncs": [{"timestamp": 0, "timescale": timescale}],
    }
    with whole_file(path) as partial, partial.open("w", encoding="ascii", newline="\n") as file:
        json.dump(plain, file, allow_nan=False, separators=(",", ":"))
    return (*_losses(recording, peak, bool(np.any(still)), timescale), *calibration_lost(calibration, "MPEG haptics"))


def _channel(recording: Recording, number: int, cell: NDArray[np.float64], ticks: list[int]) -> dict[str, Any]:
    row, column = divmod(number, recording.sensor.columns)
    x, y = recording.sensor.channel_position(number)
    # Six digits tell the 32767 steps apart.
    values = cell.round(6).tolist()
    keyframes = [{"relative_position": ticks[i], "amplitude_modulation": values[i]} for i in _turns(cell)]
    effect = {"effect_type": "Basis", "position": 0, "phase": 0.0, "base_signal": "Sine", "keyframes": keyframes}
    return {
        "id": number,
        "description": f"row {row}, column {column}: x {x * 1e3:.6g} mm, y {y * 1e3:.6g} mm",
        "gain": 1.0,
        "mixing_weight": 1.0,
        "body_part_mask": 0,
        "frequency_sampling": max(1, round(recording.rate)),
        "sample_count": recording.frames,
        "bands": [
            {
                "band_type": "Curve",
                "curve_type": "Linear",
                "block_length": 0.0,
                "lower_frequency_limit": 0,
                "upper_frequency_limit": max(1, int(recording.rate / 2)),
                "effects": [effect],
            }
        ],
    }


def _turns(cell: NDArray[np.float64]) -> list[int]:
    """The frames of a cell without those inside a run of the same value, which a straight line gives back."""
    steady = np.zeros(len(cell), bool)
    steady[1:-1] = (cell[1:-1] == cell[:-2]) & (cell[1:-1] == cell[2:])
    return np.flatnonzero(~steady).tolist()


def _ticks(recording: Recording) -> tuple[int, list[int]]:
    """Ticks per second, so that frames fall on ticks where they can, and the tick of each frame."""
    whole = round(recording.rate)
    timescale = whole if whole == recording.rate else 1_000_000
    return timescale, np.round(recording.time * timescale).astype(np.int64).tolist()


def _description(recording: Recording, peak: float) -> str:
    life = recording.provenance
    simulated = "SIMULATED; " if life.simulated else ""
    return f"{simulated}{life.source}; 1 stands for {peak:.6g} {recording.unit}; made by midair {__version__}"


def _losses(recording: Recording, peak: float, shifted: bool, timescale: int) -> tuple[Loss, ...]:
    steps = f"{peak / _STEPS:.3g} {recording.unit}"
    found = [
        Loss(
            what="scale",
            text=f"Samples are parts of the largest change, {peak:.6g} {recording.unit}, in steps of {steps}.",
        ),
        Loss(
            what="sensor", text="Places of the cells are text: an actuator a channel is assumed, no field between them."
        ),
        Loss(what="provenance", text="The steps and notes of the provenance were left out."),
    ]
    if shifted:
        found.append(Loss(what="band", text="The median of each channel was taken away: only changes are kept."))
    if timescale != recording.rate:
        found.append(Loss(what="rate", text=f"Frames were moved to the nearest of {timescale} ticks a second."))
    return tuple(found)
