"""Write AHAP, Apple's haptic patterns: one actuator, with one intensity and one sharpness over time.

Format: "Representing haptic patterns in AHAP files" (Apple, Core Haptics). A continuous event of up to 30 s has full
intensity and medium sharpness; curves of intensity (a factor, 0 to 1) and of sharpness (added, -1 to 1) shape it. Apple
does not specify two things, which are chosen here: curves have at most 16 points, reportedly the most that Core Haptics
plays; and sharpness maps the spectral centroid linearly from 80 Hz (0) to 230 Hz (1).
"""

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.files.atomic import atomic_file
from midair.files.file_format import FormatLoss, calibration_lost
from midair.model import Calibration, Recording
from midair.streaming import medians, read_frames, with_cache

Array = NDArray[np.float64]

STEP = 0.025
"""Time between two points of a curve, in s."""

LONGEST = 30.0
"""Maximum duration of a continuous event, in s."""

POINTS = 16
"""Maximum number of points of a curve."""

SHARPNESS = (80.0, 230.0)
"""Frequencies of sharpness 0 and 1, in Hz."""


def write_ahap(recording: Recording, path: Path, calibration: Calibration | None) -> tuple[FormatLoss, ...]:
    """Write the combined intensity and sharpness of all cells."""
    time, intensity, frequency = envelope(recording)
    low, high = SHARPNESS
    sharpness = np.clip((frequency - low) / (high - low), 0, 1)
    pattern = [
        *(_event(start, min(LONGEST, recording.duration - start)) for start in _starts(recording.duration)),
        *_curves("HapticIntensityControl", time, intensity),
        # This curve is added to the 0.5 of the events.
        *_curves("HapticSharpnessControl", time, sharpness - 0.5),
    ]
    with atomic_file(path) as partial, partial.open("w", encoding="ascii", newline="\n") as file:
        json.dump({"Version": 1.0, "Pattern": pattern}, file, allow_nan=False, indent=1)
    return (*_losses(recording), *calibration_lost(calibration, "AHAP"))


def envelope(recording: Recording) -> tuple[Array, Array, Array]:
    """Time (s), intensity (0 to 1) and frequency (Hz) of a recording every `STEP`, each of shape (point,).

    Intensity is the rms over all cells of the deviation from their medians in a Hann window of two steps, relative to
    its maximum; frequency is the spectral centroid of the same windows, 0 for silence.
    """
    still = medians(recording.samples).ravel()
    count = max(2, int(np.ceil(recording.duration / STEP)) + 1)
    time = np.linspace(0, recording.duration, count)
    half = max(2, round(STEP * recording.rate))
    window = np.hanning(2 * half + 1)[:, None]
    samples = with_cache(recording.samples)
    bins = np.fft.rfftfreq(2 * half + 1, 1 / recording.rate)
    power, frequency = np.zeros(count), np.zeros(count)
    for i, centre in enumerate(np.round(time * recording.rate).astype(int)):
        first, last = max(0, centre - half), min(recording.frames, centre + half + 1)
        # Zero padding on both sides for the windows of the first and the last point.
        change = np.zeros((2 * half + 1, len(still)))
        if first < last:
            there = slice(first - centre + half, last - centre + half)
            change[there] = read_frames(samples, first, last).reshape(last - first, -1) - still
        spectrum = (np.abs(np.fft.rfft(change * window, axis=0)) ** 2).sum(axis=1)
        power[i] = spectrum.sum()
        frequency[i] = spectrum @ bins / power[i] if power[i] else 0.0
    rms = np.sqrt(power)
    return time, rms / (rms.max() or 1.0), frequency


def _starts(duration: float) -> Array:
    return np.arange(0.0, duration, LONGEST)


def _event(start: float, duration: float) -> dict[str, Any]:
    parameters = [
        {"ParameterID": "HapticIntensity", "ParameterValue": 1.0},
        {"ParameterID": "HapticSharpness", "ParameterValue": 0.5},
    ]
    event = {
        "Time": round(float(start), 6),
        "EventType": "HapticContinuous",
        "EventDuration": round(float(duration), 6),
        "EventParameters": parameters,
    }
    return {"Event": event}


def _curves(name: str, time: Array, values: Array) -> list[dict[str, Any]]:
    """Curves of up to `POINTS` points; each starts with the last point of the previous one."""
    edges = [*range(0, len(time) - 1, POINTS - 1), len(time) - 1]
    curves: list[dict[str, Any]] = []
    for first, last in pairwise(edges):
        points = [
            {"Time": round(float(time[i] - time[first]), 6), "ParameterValue": round(float(values[i]), 4)}
            for i in range(first, last + 1)
        ]
        curve = {"ParameterID": name, "Time": round(float(time[first]), 6), "ParameterCurveControlPoints": points}
        curves.append({"ParameterCurve": curve})
    return curves


def _losses(recording: Recording) -> tuple[FormatLoss, ...]:
    low, high = SHARPNESS
    rows, columns = recording.sensor.shape
    found = [
        FormatLoss(
            what="channels", text=f"{rows} x {columns} cells became one actuator: the position of the pressure is lost."
        ),
        FormatLoss(what="waveform", text=f"The waveform became an intensity and a sharpness every {STEP * 1e3:g} ms."),
        FormatLoss(
            what="band", text=f"Sharpness maps {low:g} to {high:g} Hz; frequencies outside are moved to these limits."
        ),
        FormatLoss(what="scale", text="Intensity is relative to the recording's maximum: the absolute level is lost."),
        FormatLoss(what="provenance", text="Sensor and provenance were left out."),
    ]
    if recording.provenance.simulated:
        found.append(FormatLoss(what="provenance", text="The file cannot state that this recording is SIMULATED."))
    if recording.duration > LONGEST:
        parts = len(_starts(recording.duration))
        found.append(
            FormatLoss(what="length", text=f"{recording.duration:g} s became {parts} events of up to {LONGEST:g} s.")
        )
    return tuple(found)
