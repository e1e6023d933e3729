"""Write MPEG haptics as `.hjif` (ISO/IEC 23090-31, JSON): one channel per cell, with its samples as a curve.

The standard describes effects for actuators, relative to full scale, at integer ticks. Its modality "Pressure" and a
linear curve with one keyframe per frame keep the waveform of every cell; runs of equal values need only their ends.
Losses are reported. The names follow the files of MPEG's public reference software (HapticReferenceSoftware, BSD).
"""

import json
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.files.atomic import atomic_file
from midair.files.file_format import FormatLoss, calibration_lost
from midair.model import Calibration, Recording
from midair.streaming import block_ranges, medians, moments, read_frames
from midair.version import __version__

VERSION = "2023"
"""Edition of the standard, as written in the file."""

_STEPS = 32767  # amplitude steps of each sign
_LATER = "written later"


def write_hjif(recording: Recording, path: Path, calibration: Calibration | None) -> tuple[FormatLoss, ...]:
    """Write the deviation of every cell from its median as a curve from -1 to 1, relative to the largest deviation."""
    still, found = medians(recording.samples), moments(recording.samples)
    peak = float(np.maximum(found.greatest - still, still - found.least).max())
    timescale = _timescale(recording.rate)
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
                "channels": [_LATER],
            }
        ],
        "syncs": [{"timestamp": 0, "timescale": timescale}],
    }
    with atomic_file(path) as partial, partial.open("w", encoding="ascii", newline="\n") as file:
        before, after = _split_json(plain)
        file.write(before)
        for number in range(recording.sensor.count):
            file.write("," if number else "")
            file.writelines(_channel(recording, number, still.ravel()[number], peak or 1.0, timescale))
        file.write(after)
    return (*_losses(recording, peak, bool(np.any(still)), timescale), *calibration_lost(calibration, "MPEG haptics"))


def _split_json(plain: dict[str, Any]) -> tuple[str, str]:
    """JSON before and after a list whose members are streamed, because they may exceed the memory."""
    before, _, after = json.dumps(plain, allow_nan=False, separators=(",", ":")).partition(json.dumps(_LATER))
    return before, after


def _channel(recording: Recording, number: int, still: float, peak: float, timescale: int) -> Iterator[str]:
    """JSON of a channel, in pieces."""
    before, after = _split_json(_frame(recording, number))
    yield before
    comma = ""
    for first, last in block_ranges(recording.samples.shape):
        # One more frame on both sides, to detect whether the first and the last are inside a run.
        begin, end = max(0, first - 1), min(recording.frames, last + 1)
        cell = read_frames(recording.samples, begin, end).reshape(end - begin, -1)[:, number]
        steps = np.round((cell - still) / peak * _STEPS) / _STEPS
        turns = np.arange(begin, end)[_key_frames(steps)]
        turns = turns[(turns >= first) & (turns < last)]
        # Six digits resolve the 32767 steps.
        values = steps[turns - begin].round(6).tolist()
        ticks = np.round(turns / recording.rate * timescale).astype(np.int64).tolist()
        frames = [
            {"relative_position": tick, "amplitude_modulation": value}
            for tick, value in zip(ticks, values, strict=True)
        ]
        if frames:
            yield comma + json.dumps(frames, allow_nan=False, separators=(",", ":"))[1:-1]
            comma = ","
    yield after


def _frame(recording: Recording, number: int) -> dict[str, Any]:
    """A channel without its keyframes."""
    row, column = divmod(number, recording.sensor.columns)
    x, y = recording.sensor.channel_position(number)
    effect = {"effect_type": "Basis", "position": 0, "phase": 0.0, "base_signal": "Sine", "keyframes": [_LATER]}
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


def _key_frames(cell: NDArray[np.float64]) -> NDArray[np.bool_]:
    """True for frames that are not inside a run of equal values, which linear interpolation restores."""
    steady = np.zeros(len(cell), bool)
    steady[1:-1] = (cell[1:-1] == cell[:-2]) & (cell[1:-1] == cell[2:])
    return ~steady


def _timescale(rate: float) -> int:
    """Ticks per second, chosen so that frames fall on ticks if possible."""
    whole = round(rate)
    return whole if whole == rate else 1_000_000


def _description(recording: Recording, peak: float) -> str:
    life = recording.provenance
    simulated = "SIMULATED; " if life.simulated else ""
    return f"{simulated}{life.source}; 1 stands for {peak:.6g} {recording.unit}; made by midair {__version__}"


def _losses(recording: Recording, peak: float, shifted: bool, timescale: int) -> tuple[FormatLoss, ...]:
    steps = f"{peak / _STEPS:.3g} {recording.unit}"
    found = [
        FormatLoss(
            what="scale",
            text=f"Samples are relative to the largest change, {peak:.6g} {recording.unit}, in steps of {steps}.",
        ),
        FormatLoss(
            what="sensor",
            text="Positions of the cells are only text: the format has one actuator per channel.",
        ),
        FormatLoss(what="provenance", text="The steps and notes of the provenance were left out."),
    ]
    if shifted:
        found.append(FormatLoss(what="band", text="The median of each channel was subtracted: only changes are kept."))
    if timescale != recording.rate:
        found.append(FormatLoss(what="rate", text=f"Frames were moved to the nearest of {timescale} ticks a second."))
    return tuple(found)
