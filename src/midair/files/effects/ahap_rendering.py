"""Render AHAP, Apple's haptic patterns, to the wave of one actuator.

Format: "Representing haptic patterns in AHAP files" and the class references of CHHapticEvent and
CHHapticEventParameter (Apple, Core Haptics). It renders the events HapticContinuous and HapticTransient with their
HapticIntensity, HapticSharpness, AttackTime, DecayTime, ReleaseTime and Sustained, and dynamic parameters and curves of
HapticIntensityControl (a factor) and HapticSharpnessControl (added). Apple specifies no frequencies and no shapes: here
sharpness 0 to 1 is 80 to 230 Hz, as in `ahap_file`; a transient is a decaying click; attack, decay and release are
linear. Audio events are left out and reported.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import BrokenFileError
from midair.files.effects.ahap_file import SHARPNESS
from midair.files.opened_take import ImportedData, ImportOptions, OpenedTake
from midair.files.size_limits import check_memory_for

Array = NDArray[np.float64]

RATE = 8000.0
"""Default rate of a rendered effect, in Hz."""

CLICK = 8e-3
"""Time constant of a transient, in s."""

LONGEST = 600.0
"""Maximum duration of a rendered effect, in s."""

_CONTROLS = {"HapticIntensityControl": 1.0, "HapticSharpnessControl": 0.0}


def read_ahap(path: Path, given: ImportOptions) -> OpenedTake:
    """Render an AHAP file of up to `LONGEST` to a recording of one channel, 1 being full intensity."""
    pattern = _pattern(path)
    events = [entry["Event"] for entry in pattern if "Event" in entry]
    haptic = [event for event in events if event.get("EventType") in ("HapticContinuous", "HapticTransient")]
    if not haptic:
        raise BrokenFileError(f"{path}: expected a haptic event in the AHAP, got none")
    rate = given.rate or RATE
    end = max(float(event["Time"]) + _length(event) for event in haptic)
    time = frame_times(path, end, rate)
    intensity, sharpness = (_control(pattern, name, time) for name in _CONTROLS)
    wave = np.zeros(len(time))
    for event in haptic:
        _add(wave, time, event, intensity, sharpness)
    low, high = SHARPNESS
    report = [
        f"Rendered at {rate:g} Hz; sharpness 0 to 1 was taken as {low:g} to {high:g} Hz, which Apple does not state."
    ]
    if len(haptic) < len(events):
        report.append(f"{len(events) - len(haptic)} events of sound were left out.")
    found = ImportedData(
        samples=wave[:, None], form="AHAP", rate=rate, settings={"events": len(haptic)}, report=tuple(report)
    )
    return found.resolve(given, path)


def frame_times(path: Path, end: float, rate: float, *, channels: int = 1) -> Array:
    """Times of the frames of an effect in s, after a check of its duration and of the memory that it needs."""
    if not 0 < end <= LONGEST:
        raise BrokenFileError(f"{path}: expected an effect of up to {LONGEST:g} s, got {end:g} s")
    check_memory_for(
        8 * (2 * channels + 6) * end * rate, f"{path}, {end:g} s at {rate:g} Hz", "state a lower rate with --rate"
    )
    return np.arange(round(end * rate)) / rate


def _pattern(path: Path) -> Sequence[Mapping[str, Any]]:
    content = json.loads(path.read_text(encoding="utf-8-sig"))
    pattern = content.get("Pattern") if isinstance(content, dict) else None
    if not isinstance(pattern, list):
        raise BrokenFileError(f"{path}: expected an AHAP with a Pattern, got none")
    return [entry for entry in pattern if isinstance(entry, dict)]


def _parameter(event: Mapping[str, Any], name: str, otherwise: float) -> float:
    """Value of an event parameter."""
    for each in event.get("EventParameters", ()):
        if each["ParameterID"] == name:
            return float(each["ParameterValue"])
    return otherwise


def _length(event: Mapping[str, Any]) -> float:
    """Duration of an event in s; a transient ends at a thousandth of its peak."""
    if event["EventType"] == "HapticTransient":
        return 7 * CLICK
    return float(event["EventDuration"]) + _parameter(event, "ReleaseTime", 0.0)


def _add(wave: Array, time: Array, event: Mapping[str, Any], intensity: Array, sharpness: Array) -> None:
    """Add one event to the wave."""
    begin = float(event["Time"])
    part = slice(int(np.searchsorted(time, begin - 1e-9)), int(np.searchsorted(time, begin + _length(event) - 1e-9)))
    since = time[part] - begin
    low, high = SHARPNESS
    sharp = np.clip(_parameter(event, "HapticSharpness", 0.5) + sharpness[part], 0, 1)
    step = time[1] - time[0] if len(time) > 1 else 1.0
    turns = np.cumsum(low + (high - low) * sharp) * step
    strength = _parameter(event, "HapticIntensity", 1.0) * intensity[part]
    wave[part] += np.clip(strength, 0, 1) * _shape(event, since) * np.sin(2 * np.pi * turns)


def _shape(event: Mapping[str, Any], since: Array) -> Array:
    """Envelope of an event, 0 to 1."""
    if event["EventType"] == "HapticTransient":
        return np.exp(-since / CLICK)
    held = float(event["EventDuration"])
    attack, decay, release = (_parameter(event, name, 0.0) for name in ("AttackTime", "DecayTime", "ReleaseTime"))
    shape = np.ones(len(since))
    if attack > 0:
        shape *= np.clip(since / attack, 0, 1)
    if decay > 0 and _parameter(event, "Sustained", 1.0) < 0.5:
        shape *= np.clip(1 - (since - attack) / decay, 0, 1)
    if release > 0:
        shape *= np.clip(1 - (since - held) / release, 0, 1)
    return shape


def _control(pattern: Sequence[Mapping[str, Any]], name: str, time: Array) -> Array:
    """A dynamic parameter over time: steps and linear curves; each value holds until the next."""
    values = np.full(len(time), _CONTROLS[name])
    stretches: list[tuple[float, list[tuple[float, float]]]] = []
    for entry in pattern:
        step, curve = entry.get("Parameter"), entry.get("ParameterCurve")
        if step is not None and step["ParameterID"] == name:
            stretches.append((float(step["Time"]), [(0.0, float(step["ParameterValue"]))]))
        if curve is not None and curve["ParameterID"] == name:
            points = [(float(p["Time"]), float(p["ParameterValue"])) for p in curve["ParameterCurveControlPoints"]]
            stretches.append((float(curve["Time"]), sorted(points)))
    # Each stretch holds until the first that comes after it in this order.
    ordered = sorted((stretch for stretch in stretches if stretch[1]), key=lambda stretch: stretch[0])
    first = np.searchsorted(time, [begin + points[0][0] - 1e-9 for begin, points in ordered])
    last = np.minimum.accumulate(np.r_[first[1:], len(time)][::-1])[::-1]
    for (begin, points), part in zip(ordered, map(slice, first, last), strict=True):
        at, value = np.array(points).T
        values[part] = np.interp(time[part] - begin, at, value)
    return values
