"""Synthetic pressure signals: the paper's modulated foci (5.2) and binary patterns (5.1), taps, probe signals."""

from collections.abc import Mapping
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from midair.array_types import Array
from midair.errors import InputError, RateError
from midair.model import RATE, PressureFrames, Provenance, SensorGrid, Setting
from midair.validation import one_of, positive, within

Stimulus = Literal["i", "ii", "iii"]


def am_stimulus(
    kind: Stimulus, *, peak: float = 60.0, duration: float = 0.5, rate: float = RATE, sensor: SensorGrid | None = None
) -> PressureFrames:
    """Pressure of the modulated foci of the paper's section 5.2, 0 or more, as an array can present it.

    A modulation of frequency f is the raised sinusoid (1 - cos 2 pi f t) / 2. "i": 100 Hz on the first channel; "ii":
    100 Hz on the first and the last channel; "iii": 25 Hz and 250 Hz in the ratio 3:2 on the first channel. Raises
    InputError if `kind` is unknown and RateError if the rate is too low for the modulation.

    `peak` is in Pa; "iii" reaches it to within 3 %. `duration` is in s; multiples of 40 ms put the modulation on the
    bins of a spectrum. `rate` is in Hz, above twice the highest modulation frequency. The default sensor has 4 x 4
    cells at 11 mm.
    """
    sensor = sensor or SensorGrid()
    one_of(kind, Stimulus, "stimulus")
    # Frequencies in Hz with their shares of the peak.
    parts = {25.0: 0.6, 250.0: 0.4} if kind == "iii" else {100.0: 1.0}
    if rate <= 2 * max(parts):
        raise RateError(f"rate of stimulus {kind}: expected above {2 * max(parts):g} Hz, got {rate:g} Hz")
    frames = max(1, round(positive(duration, "duration", "s") * rate))
    channels = (0, sensor.count - 1) if kind == "ii" else (0,)
    peak = positive(peak, "peak", "Pa")

    time = np.arange(frames) / rate
    wave = np.sum([share * (0.5 - 0.5 * np.cos(2 * np.pi * f * time)) for f, share in parts.items()], axis=0)
    pressure = np.zeros((frames, sensor.count))
    pressure[:, list(channels)] = peak * wave[:, None]
    settings = {"kind": kind, "peak_pa": float(peak), "channels": channels, "frequencies_hz": tuple(parts)}
    return _signal(f"AM {kind}", "AM stimulus", settings, pressure, rate, sensor)


def _signal(
    name: str, stage: str, settings: Mapping[str, Setting], pressure: Array, rate: float, sensor: SensorGrid
) -> PressureFrames:
    source = Provenance(source=f"virtual:{name}", simulated=True)
    shaped = pressure.reshape(-1, *sensor.shape)
    return PressureFrames(pressure=shaped, rate=rate, sensor=sensor, provenance=source.then(stage, settings))


Probe = Literal["25+250 Hz", "noise", "bursts"]


def probe_signal(
    kind: str,
    *,
    peak: float = 20.0,
    duration: float = 0.2,
    rate: float = 8000.0,
    rest: float = 0.1,
    channel: int = 5,
    seed: int = 0,
    sensor: SensorGrid | None = None,
) -> PressureFrames:
    """A vibration of both signs on one cell, with rest before and after it, for measurements of fidelity.

    "25+250 Hz": both in the ratio 3:2. "noise": normal noise from 25 to 460 Hz. "bursts": 200 Hz under Gaussians of 8
    ms standard deviation, 50 ms apart. Each fades in and out over a fifth of `rest`, outside the duration. Raises
    InputError if `kind` is unknown.

    `peak` is the largest pressure in Pa, `duration` the time at full strength and `rest` that before and after it, in
    s, `rate` in Hz. The default sensor has 4 x 4 cells at 11 mm. The result lasts duration + 2 rest.
    """
    sensor = sensor or SensorGrid()
    whole = positive(duration, "duration", "s") + 2 * positive(rest, "rest", "s")
    time = np.arange(round(whole * rate)) / rate - rest
    wave = _probe(kind, time, rate, np.random.default_rng(seed))
    outside = np.maximum(np.maximum(-time, time - duration), 0.0)
    wave = wave * (0.5 + 0.5 * np.cos(np.pi * np.minimum(outside / (0.2 * rest), 1.0)))
    pressure = np.zeros((len(time), sensor.count))
    pressure[:, channel] = positive(peak, "peak", "Pa") * wave / np.abs(wave).max()
    settings = {"kind": kind, "peak_pa": float(peak), "channel": channel, "seed": seed}
    return _signal(kind, "probe", settings, pressure, rate, sensor)


def _probe(kind: str, time: NDArray[np.float64], rate: float, rng: np.random.Generator) -> NDArray[np.float64]:
    if kind == "25+250 Hz":
        return 0.6 * np.sin(2 * np.pi * 25 * time) + 0.4 * np.sin(2 * np.pi * 250 * time)
    if kind == "bursts":
        # Time from the nearest burst.
        after = np.mod(time + 25e-3, 50e-3) - 25e-3
        return np.exp(-((after / 8e-3) ** 2) / 2) * np.sin(2 * np.pi * 200 * after)
    if kind == "noise":
        spectrum = np.fft.rfft(rng.standard_normal(len(time)))
        frequency = np.fft.rfftfreq(len(time), 1 / rate)
        spectrum[(frequency < 25) | (frequency > 460)] = 0
        return np.asarray(np.fft.irfft(spectrum, len(time)), np.float64)
    raise InputError(f"probe: expected one of {', '.join(get_args(Probe))}, got {kind!r}")


def taps(
    *,
    every: float = 1.0,
    quiet: float = 1.0,
    peak: float = 30.0,
    spread: float = 0.25,
    rate: float = RATE,
    seed: int = 0,
    sensor: SensorGrid | None = None,
) -> PressureFrames:
    """A half sine of 20 ms on each cell, row by row, with random strengths; the neighbouring cells get a part of it.

    `every` is the time between two taps, with a random delay of 0.2 to 0.4 of it, and `quiet` that before the first, in
    s. `peak` is the upper limit of the peak pressure of a tap in Pa; the lower limit is a third of it. `spread` is the
    share of the pressure on the cells beside a tapped one, its square that on the diagonal ones. `rate` is in Hz. The
    default sensor has 4 x 4 cells at 11 mm.
    """
    sensor, rng = sensor or SensorGrid(), np.random.default_rng(seed)
    every, rate = positive(every, "time between taps", "s"), positive(rate, "rate", "Hz")
    push = np.sin(np.pi * np.arange(round(0.02 * rate)) / (0.02 * rate))
    pressure = np.zeros((round((quiet + every * sensor.count) * rate) + len(push), *sensor.shape))
    rows, columns = np.mgrid[: sensor.rows, : sensor.columns]
    for cell in range(sensor.count):
        row, column = divmod(cell, sensor.columns)
        away = np.abs(rows - row) + np.abs(columns - column)
        begin = round((quiet + every * (cell + rng.uniform(0.2, 0.4))) * rate)
        strength = positive(peak, "peak", "Pa") * rng.uniform(1 / 3, 1)
        pressure[begin : begin + len(push)] += strength * push[:, None, None] * np.where(away < 3, spread**away, 0)
    settings = {"every_s": every, "quiet_s": quiet, "peak_pa": float(peak), "spread": float(spread), "seed": seed}
    return _signal("taps", "taps", settings, pressure, rate, sensor)


def binary_patterns(count: int | None = None, *, seed: int = 0, channels: int = 16) -> NDArray[np.int64]:
    """Binary patterns, shape (pattern,), in a random order, so that the first few are a representative sample of all.

    Bit k is 1 if channel k of at most 16 is loud. Patterns are unique, and none is 0; there are 2^channels - 1, all if
    `count` is None. Raises InputError if `count` exceeds that number, or `channels` is out of range.
    """
    within(channels, "channels", 1, 16)
    every = 2**channels - 1
    if count is not None:
        within(count, "count of patterns", 1, every)
    return np.random.default_rng(seed).permutation(np.arange(1, every + 1))[:count]


def channel_amplitudes(patterns: ArrayLike, sensor: SensorGrid | None = None) -> NDArray[np.float64]:
    """Amplitude, 0 or 1, of each channel in each pattern, shape (pattern, channel); bit k of a pattern is channel k."""
    bits = np.asarray(patterns, np.int64)[:, None] >> np.arange((sensor or SensorGrid()).count)
    return (bits & 1).astype(np.float64)
