"""Render AHAP, Apple's haptic patterns, and .haptic, the clips of Meta Haptics Studio, to waves.

AHAP: one actuator, with one intensity and one sharpness over time. Format: "Representing haptic patterns in AHAP
files" (Apple, Core Haptics). A continuous event of up to 30 s has full intensity and medium sharpness; curves of
intensity (a factor, 0 to 1) and of sharpness (added, -1 to 1) shape it. Apple does not specify
the frequency of a sharpness, which is chosen here: linear from 80 Hz (0) to 230 Hz (1).

Clips: envelopes of amplitude and frequency, and emphasis. Format: that of facebook/haptics-studio (version 1.0.0).
Amplitude and frequency are 0 to 1, linear between their points; an emphasis is a short click with an amplitude and a
frequency of its own. The frequencies of 0 and 1 depend on the device; here they are those of sharpness in AHAP.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from midair.array_types import Array
from midair.errors import BrokenFileError
from midair.files.opened_take import Format, ImportedData, ImportOptions
from midair.files.size_limits import check_memory_for

SHARPNESS = (80.0, 230.0)
"""Frequencies of sharpness 0 and 1, in Hz."""


RATE = 8000.0
"""Default rate of a rendered effect, in Hz."""

CLICK = 8e-3
"""Time constant of a transient, in s."""

LONGEST = 600.0
"""Maximum duration of a rendered effect, in s."""

_CONTROLS = {"HapticIntensityControl": 1.0, "HapticSharpnessControl": 0.0}


def read_ahap(path: Path, given: ImportOptions) -> ImportedData:
    """Render an AHAP file of up to `LONGEST` to a recording of one channel, 1 being full intensity.

    Format: also the class references of CHHapticEvent and CHHapticEventParameter (Apple, Core Haptics). The events
    HapticContinuous and HapticTransient are rendered with their HapticIntensity, HapticSharpness, AttackTime,
    DecayTime, ReleaseTime and Sustained, and dynamic parameters and curves of HapticIntensityControl (a factor) and
    HapticSharpnessControl (added). Apple specifies no shapes: a transient is a decaying click; attack, decay and
    release are linear. Audio events are left out and reported.
    """
    content = json.loads(path.read_text(encoding="utf-8-sig"))
    if not isinstance(content, dict) or not isinstance(content.get("Pattern"), list):
        raise BrokenFileError("expected an AHAP with a Pattern, got none")
    pattern = [entry for entry in content["Pattern"] if isinstance(entry, dict)]
    events = [entry["Event"] for entry in pattern if "Event" in entry]
    haptic = [event for event in events if event.get("EventType") in ("HapticContinuous", "HapticTransient")]
    if not haptic:
        raise BrokenFileError("expected a haptic event in the AHAP, got none")
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
    if (peak := np.abs(wave).max()) > 1:
        report.append(f"Events overlap: together they reach {peak:.3g} of full intensity, which a phone would limit.")
    if len(haptic) < len(events):
        report.append(f"{len(events) - len(haptic)} events of sound were left out.")
    settings = {"events": len(haptic)}
    return ImportedData(samples=wave[:, None], form="AHAP", rate=rate, settings=settings, report=tuple(report))


def frame_times(path: Path, end: float, rate: float) -> Array:
    """Times of the frames of an effect in s, after a check of its duration and of the memory that it needs."""
    if not 0 < end <= LONGEST:
        raise BrokenFileError(f"expected an effect of up to {LONGEST:g} s, got {end:g} s")
    check_memory_for(64 * end * rate, f"{path}, {end:g} s at {rate:g} Hz", "state a lower rate with --rate")
    return np.arange(round(end * rate)) / rate


def _length(event: Mapping[str, Any]) -> float:
    """Duration of an event in s; a transient ends at a thousandth of its peak."""
    if event["EventType"] == "HapticTransient":
        return 7 * CLICK
    return float(event["EventDuration"]) + _parameters(event).get("ReleaseTime", 0.0)


def _parameters(event: Mapping[str, Any]) -> dict[str, float]:
    return {each["ParameterID"]: float(each["ParameterValue"]) for each in event.get("EventParameters", ())}


def _add(wave: Array, time: Array, event: Mapping[str, Any], intensity: Array, sharpness: Array) -> None:
    begin, known = float(event["Time"]), _parameters(event)
    part = slice(*np.searchsorted(time, [begin - 1e-9, begin + _length(event) - 1e-9]))
    since, shape = time[part] - begin, np.ones(len(time[part]))
    if event["EventType"] == "HapticTransient":
        shape = np.exp(-since / CLICK)
    else:
        held = float(event["EventDuration"])
        attack, decay, release = (known.get(name, 0.0) for name in ("AttackTime", "DecayTime", "ReleaseTime"))
        decay *= known.get("Sustained", 1.0) < 0.5
        for length, ramp in ((attack, since), (decay, attack + decay - since), (release, held + release - since)):
            if length > 0:
                shape *= np.clip(ramp / length, 0, 1)
    low, high = SHARPNESS
    sharp = np.clip(known.get("HapticSharpness", 0.5) + sharpness[part], 0, 1)
    turns = np.cumsum(low + (high - low) * sharp) * (time[1] - time[0] if len(time) > 1 else 1.0)
    strength = np.clip(known.get("HapticIntensity", 1.0) * intensity[part], 0, 1)
    wave[part] += strength * shape * np.sin(2 * np.pi * turns)


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


def read_haptic(path: Path, given: ImportOptions) -> ImportedData:
    """Render a clip to a recording of one channel, 1 being full amplitude; an emphasis is added as a decaying click."""
    content = json.loads(path.read_text(encoding="utf-8-sig"))
    try:
        envelopes: dict[str, Any] = content["signals"]["continuous"]["envelopes"]
        at, amplitude = _envelope(envelopes["amplitude"], "amplitude")
        turns, frequency = _envelope(envelopes.get("frequency") or [{"time": 0, "frequency": 0.5}], "frequency")
        clicks = [(float(each["time"]), each["emphasis"]) for each in envelopes["amplitude"] if each.get("emphasis")]
    except (KeyError, TypeError, AttributeError) as wrong:
        raise BrokenFileError("expected a .haptic clip with an envelope of amplitude, got none") from wrong
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
    return ImportedData(
        samples=np.clip(wave, -1, 1)[:, None],
        form=".haptic",
        rate=rate,
        settings={"points": len(at), "emphasis": len(clicks)},
        report=report,
    )


def _envelope(points: list[dict[str, Any]], name: str) -> tuple[Array, Array]:
    """Times in s and values of the points of an envelope, in order of time."""
    values = np.array([[each["time"], each[name]] for each in points], np.float64).reshape(-1, 2)
    if not len(values) or not np.isfinite(values).all() or values.min() < 0:
        raise BrokenFileError(f"expected points of {name} with numbers from 0 on, got others")
    return tuple(values[np.argsort(values[:, 0], kind="stable")].T)


AHAP = Format(name="AHAP", read=read_ahap, memory=4)
HAPTIC = Format(name=".haptic", read=read_haptic, memory=4)
