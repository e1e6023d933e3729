"""Render MPEG haptics (.hjif, ISO/IEC 23090-31) to waves, one channel of the recording per channel of the file.

Names and structure follow MPEG's public reference software (HapticReferenceSoftware, BSD): perceptions contain
channels, bands, effects, and keyframes at ticks. It renders bands of the types Curve, VectorialWave and Transient;
their sum is multiplied by gain and mixing weight. Curves are linear whatever their curve_type; a transient is a
decaying click. Wavelet bands and effects of a library are left out and reported.
"""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import BrokenFileError
from midair.files.effects.ahap_rendering import CLICK, RATE, frame_times
from midair.files.opened_take import ImportedData, ImportOptions, OpenedTake

Array = NDArray[np.float64]
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
    """Render an MPEG haptics file of up to ten minutes to a recording, 1 being full scale."""
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
    """Wave of a channel."""
    wave = np.zeros(len(time))
    for band, effect in _effects(channel):
        if band["band_type"] == "Transient":
            _add_clicks(wave, time, effect, ticks)
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


def _add_clicks(wave: Array, time: Array, effect: Plain, ticks: float) -> None:
    """Add a decaying click at each keyframe, with its amplitude and frequency."""
    for key in effect["keyframes"]:
        at = (float(effect.get("position", 0)) + float(key["relative_position"])) / ticks
        part = slice(*np.searchsorted(time, [at - 1e-9, at + 7 * CLICK]))
        since = time[part] - at
        click = np.exp(-since / CLICK) * np.sin(2 * np.pi * float(key.get("frequency_modulation", 150.0)) * since)
        wave[part] += float(key.get("amplitude_modulation", 1.0)) * click
