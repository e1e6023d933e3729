"""Write and render .haptic, the clips of Meta Haptics Studio: envelopes of amplitude and frequency, and emphasis.

Format: the clips of facebook/haptics-studio (version 1.0.0). Amplitude and frequency are 0 to 1, linear between their
points; an emphasis is a short click with an amplitude and a frequency of its own. The frequencies of 0 and 1 depend on
the device; here they are those of sharpness in AHAP.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np

from midair.array_types import Array
from midair.errors import BrokenFileError
from midair.files.atomic import atomic_file
from midair.files.effects.ahap_file import CLICK, RATE, SHARPNESS, clip_losses, envelope, frame_times
from midair.files.opened_take import FormatLoss, ImportedData, ImportOptions, OpenedTake, calibration_lost
from midair.model import Calibration, Recording


def write_haptic(recording: Recording, path: Path, calibration: Calibration | None) -> tuple[FormatLoss, ...]:
    """Write the combined amplitude and frequency of all cells."""
    time, amplitude, frequency = envelope(recording)
    low, high = SHARPNESS
    scaled = np.clip((frequency - low) / (high - low), 0, 1)
    told = "SIMULATED: no sensor was involved" if recording.provenance.simulated else ""
    content = {
        "version": {"major": 1, "minor": 0, "patch": 0},
        "metadata": {"editor": "midair", "source": "", "project": path.stem, "tags": [], "description": told},
        "signals": {
            "continuous": {
                "envelopes": {
                    "amplitude": _points(time, "amplitude", amplitude),
                    "frequency": _points(time, "frequency", scaled),
                }
            }
        },
    }
    with atomic_file(path) as partial, partial.open("w", encoding="utf-8", newline="\n") as file:
        json.dump(content, file, allow_nan=False)
    return (*clip_losses(recording, "frequency", "amplitude"), *calibration_lost(calibration, ".haptic"))


def _points(time: Array, name: str, values: Array) -> list[dict[str, float]]:
    return [{"time": round(float(t), 6), name: round(float(v), 4)} for t, v in zip(time, values, strict=True)]


def read_haptic(path: Path, given: ImportOptions) -> OpenedTake:
    """Render a clip to a recording of one channel, 1 being full amplitude; an emphasis is added as a decaying click."""
    content = json.loads(path.read_text(encoding="utf-8-sig"))
    try:
        envelopes: dict[str, Any] = content["signals"]["continuous"]["envelopes"]
        at, amplitude = _envelope(path, envelopes["amplitude"], "amplitude")
        turns, frequency = _envelope(path, envelopes.get("frequency") or [{"time": 0, "frequency": 0.5}], "frequency")
        clicks = [(float(each["time"]), each["emphasis"]) for each in envelopes["amplitude"] if each.get("emphasis")]
    except (KeyError, TypeError, AttributeError) as wrong:
        raise BrokenFileError(f"{path}: expected a .haptic clip with an envelope of amplitude, got none") from wrong
    rate, (low, high) = given.rate or RATE, SHARPNESS
    time = frame_times(path, float(at[-1]) + (7 * CLICK if clicks else 0.0), rate)
    carrier = low + (high - low) * np.clip(np.interp(time, turns, frequency), 0, 1)
    wave = np.clip(np.interp(time, at, amplitude, right=0.0), 0, 1) * np.sin(2 * np.pi * np.cumsum(carrier) / rate)
    for begin, emphasis in clicks:
        since = time[(part := slice(*np.searchsorted(time, [begin - 1e-9, begin + 7 * CLICK])))] - begin
        pitch, strength = (np.clip(float(emphasis[name]), 0, 1) for name in ("frequency", "amplitude"))
        wave[part] += strength * np.exp(-since / CLICK) * np.sin(2 * np.pi * (low + (high - low) * pitch) * since)
    report = (
        f"Rendered at {rate:g} Hz; frequency 0 to 1 was taken as {low:g} to {high:g} Hz, which depends on the device.",
    )
    found = ImportedData(
        samples=np.clip(wave, -1, 1)[:, None],
        form=".haptic",
        rate=rate,
        settings={"points": len(at), "emphasis": len(clicks)},
        report=report,
    )
    return found.resolve(given, path)


def _envelope(path: Path, points: list[dict[str, Any]], name: str) -> tuple[Array, Array]:
    """Times in s and values of the points of an envelope, in order of time."""
    values = np.array([[each["time"], each[name]] for each in points], np.float64).reshape(-1, 2)
    if not len(values) or not np.isfinite(values).all() or values.min() < 0:
        raise BrokenFileError(f"{path}: expected points of {name} with numbers from 0 on, got others")
    return tuple(values[np.argsort(values[:, 0], kind="stable")].T)
