"""Write and render MPEG haptics, `.hjif` (ISO/IEC 23090-31, JSON): one channel per cell, with its samples as a curve.

The standard describes effects for actuators, relative to full scale, at integer ticks. Its modality "Pressure" and a
linear curve with one keyframe per frame keep the waveform of every cell; runs of equal values need only their ends.
Losses are reported. The names follow the files of MPEG's public reference software (HapticReferenceSoftware, BSD).
"""

import json
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import BrokenFileError
from midair.files.atomic import atomic_file
from midair.files.effects.ahap_file import CLICK, RATE, frame_times
from midair.files.opened_take import FormatLoss, ImportedData, ImportOptions, Lost, OpenedTake, calibration_lost
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
    # Ticks per second, chosen so that frames fall on ticks if possible.
    timescale = round(recording.rate) if recording.rate == round(recording.rate) else 1_000_000
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


def _description(recording: Recording, peak: float) -> str:
    life = recording.provenance
    simulated = "SIMULATED; " if life.simulated else ""
    return f"{simulated}{life.source}; 1 stands for {peak:.6g} {recording.unit}; made by midair {__version__}"


def _losses(recording: Recording, peak: float, shifted: bool, timescale: int) -> tuple[FormatLoss, ...]:
    steps = f"{peak / _STEPS:.3g} {recording.unit}"
    found: list[tuple[Lost, str]] = [
        ("scale", f"Samples are relative to the largest change, {peak:.6g} {recording.unit}, in steps of {steps}."),
        ("sensor", "Positions of the cells are only text: the format has one actuator per channel."),
        ("provenance", "The steps and notes of the provenance were left out."),
    ]
    if shifted:
        found.append(("band", "The median of each channel was subtracted: only changes are kept."))
    if timescale != recording.rate:
        found.append(("rate", f"Frames were moved to the nearest of {timescale} ticks a second."))
    return tuple(FormatLoss(what=what, text=text) for what, text in found)


Plain = Mapping[str, Any]


def _base(signal: str, turns: Array) -> Array:
    """A base signal after `turns` periods of the effect; a sine if the name is unknown."""
    if signal == "Square":
        return np.where(turns % 1 < 0.5, 1.0, -1.0)
    if signal == "Triangle":
        return 1 - 4 * np.abs((turns + 0.25) % 1 - 0.5)
    if signal in ("SawToothUp", "SawToothDown"):
        return (2 * (turns % 1) - 1) * (1 if signal == "SawToothUp" else -1)
    return np.sin(2 * np.pi * turns)


def read_hjif(path: Path, given: ImportOptions) -> OpenedTake:
    """Render an MPEG haptics file of up to ten minutes to a recording with its channels, 1 being full scale.

    Perceptions contain channels, bands, effects, and keyframes at ticks. Bands of the types Curve, VectorialWave and
    Transient are rendered; their sum is multiplied by gain and mixing weight. Curves are linear whatever their
    curve_type; a transient is a decaying click. Wavelet bands and effects of a library are left out and reported.
    """
    content = json.loads(path.read_text(encoding="utf-8-sig"))
    if not isinstance(content, dict) or not isinstance(content.get("perceptions"), list):
        raise BrokenFileError(f"{path}: expected MPEG haptics with perceptions, got none")
    ticks = float(content.get("timescale", 1000))
    channels = [channel for perception in content["perceptions"] for channel in perception["channels"]]
    keys = [at for channel in channels for at in _ends(channel, ticks)]
    left_out = sorted({kind for channel in channels for kind in _left_out(channel)})
    if not keys:
        got = ", ".join(left_out) or "none"
        raise BrokenFileError(f"{path}: expected bands of the kinds Curve, VectorialWave or Transient, got {got}")
    sampled = {channel.get("frequency_sampling") for channel in channels} - {None, 0}
    rate = given.rate or (float(sampled.pop()) if len(sampled) == 1 else RATE)
    time = frame_times(path, max(keys) + 1 / rate, rate, channels=len(channels))
    samples = np.stack([_rendered(channel, time, ticks) for channel in channels], axis=1)
    report = [f"Rendered at {rate:g} Hz; curves on straight lines."]
    report += [f"Left out: {', '.join(left_out)}."] if left_out else []
    found = ImportedData(samples=samples, form="MPEG haptics", rate=rate, settings={}, report=tuple(report))
    return found.resolve(given, path)


def _effects(channel: Plain) -> Iterator[tuple[Plain, Plain]]:
    """Each band that can be rendered, with each of its effects that has keyframes."""
    for band in channel.get("bands", ()):
        if band["band_type"] in ("Curve", "VectorialWave", "Transient"):
            for effect in band.get("effects", ()):
                if effect.get("keyframes"):
                    yield band, effect


def _left_out(channel: Plain) -> Iterator[str]:
    for band in channel.get("bands", ()):
        if band["band_type"] not in ("Curve", "VectorialWave", "Transient"):
            yield f"bands of the kind {band['band_type']}"
        elif any(not effect.get("keyframes") for effect in band.get("effects", ())):
            yield "effects without keyframes"


def _ends(channel: Plain, ticks: float) -> Iterator[float]:
    """End of each effect, in s."""
    for band, effect in _effects(channel):
        last = max(float(key.get("relative_position", 0)) for key in effect["keyframes"])
        yield (float(effect.get("position", 0)) + last) / ticks + (7 * CLICK if band["band_type"] == "Transient" else 0)


def _rendered(channel: Plain, time: Array, ticks: float) -> Array:
    wave = np.zeros(len(time))
    for band, effect in _effects(channel):
        if band["band_type"] == "Transient":
            for key in effect["keyframes"]:
                at = (float(effect.get("position", 0)) + float(key["relative_position"])) / ticks
                part = slice(*np.searchsorted(time, [at - 1e-9, at + 7 * CLICK]))
                since = time[part] - at
                click = np.exp(-since / CLICK) * np.sin(
                    2 * np.pi * float(key.get("frequency_modulation", 150.0)) * since
                )
                wave[part] += float(key.get("amplitude_modulation", 1.0)) * click
        else:
            _add_wave(wave, time, band, effect, ticks)
    return float(channel.get("gain", 1.0)) * float(channel.get("mixing_weight", 1.0)) * wave


def _line(effect: Plain, name: str, ticks: float) -> tuple[Array, Array]:
    """Times and values of the keyframes that have the key `name`."""
    points = [(float(key["relative_position"]) / ticks, float(key[name])) for key in effect["keyframes"] if name in key]
    return np.array([at for at, _ in points]), np.array([value for _, value in points])


def _add_wave(wave: Array, time: Array, band: Plain, effect: Plain, ticks: float) -> None:
    """Add a curve (its keyframes) or a vectorial wave (a base signal with their amplitude and frequency)."""
    begin = float(effect.get("position", 0)) / ticks
    at, amplitude = _line(effect, "amplitude_modulation", ticks)
    if not len(at):
        return
    part = slice(*np.searchsorted(time, [begin + at[0] - 1e-9, begin + at[-1] + 1e-9]))
    since = time[part] - begin
    level = np.interp(since, at, amplitude)
    if band["band_type"] == "Curve":
        wave[part] += level
        return
    low, high = (float(band.get(f"{end}_frequency_limit", 0)) for end in ("lower", "upper"))
    when, hertz = _line(effect, "frequency_modulation", ticks)
    frequency = np.interp(since, when, hertz) if len(when) else np.full(len(since), (low + high) / 2)
    step = time[1] - time[0] if len(time) > 1 else 1.0
    turns = np.concatenate([[0.0], np.cumsum(frequency)[:-1]]) * step + float(effect.get("phase", 0.0)) / (2 * np.pi)
    wave[part] += level * _base(effect.get("base_signal", "Sine"), turns)
