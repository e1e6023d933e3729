"""Recordings of a sensor together with a reference of the pressure, and signals to excite both: noise and sweeps."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.dsp import Band, check_band
from midair.errors import InputError, MismatchError, ShapeError
from midair.model import RATE, Recording, SensorGrid
from midair.validation import frozen_array, positive, within


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reference:
    """Pressure measured by a force cell, a reference microphone or a pistonphone."""

    pressure: Array
    """In Pa, shape (frame,)."""
    rate: float
    """In Hz."""
    uncertainty: float = 0.0
    """Relative standard uncertainty (k = 1) of the sensitivity: half of the value on a certificate with k = 2."""
    name: str = "reference"
    """Name of the instrument."""
    own_clock: bool = True
    """False for a channel of the device that records the sensor."""
    simulated: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "pressure", frozen_array(self.pressure, "reference", ("frame",)))
        object.__setattr__(self, "rate", positive(self.rate, "rate of the reference", "Hz"))
        within(self.uncertainty, "uncertainty of the reference", 0, 1, advice="0.01 is 1 %")

    @classmethod
    def read(
        cls,
        recording: Recording,
        *,
        sensitivity: float,
        channel: int = 0,
        uncertainty: float = 0.0,
        name: str = "",
        own_clock: bool = True,
    ) -> "Reference":
        """Read the pressure from one channel of a recording; `sensitivity` is in the recording's unit per Pa.

        A force cell of S unit/N with a contact area of A m2 has a sensitivity of S A. The others are fields.
        """
        if not 0 <= channel < recording.sensor.count:
            raise ShapeError(f"reference channel: expected 0 to {recording.sensor.count - 1}, got {channel}")
        if not (np.isfinite(sensitivity) and sensitivity != 0):
            raise InputError(f"sensitivity of the reference: expected a number other than 0, got {sensitivity:g}")
        return cls(
            pressure=recording.samples.reshape(recording.frames, -1)[:, channel] / sensitivity,
            rate=recording.rate,
            uncertainty=uncertainty,
            name=name or recording.sensor.name,
            own_clock=own_clock,
            simulated=recording.provenance.simulated,
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReferencedTake:
    """A recording of a sensor, and of the reference at the same times."""

    recording: Recording
    reference: Reference
    """Pressure with as many frames at the same rate."""
    cell: int | None = None
    """Channel whose cell was pressed; None for the same pressure on all cells, as in a coupler."""

    def __post_init__(self) -> None:
        have = (len(self.reference.pressure), self.reference.rate)
        want = (self.recording.frames, self.recording.rate)
        if have != want:
            raise MismatchError(
                f"reference: expected {want[0]} frames at {want[1]:g} Hz like the recording's, got {have[0]} at "
                f"{have[1]:g} Hz; align, cut and resample it first"
            )
        cells = self.recording.sensor.count
        if self.cell is not None and not 0 <= self.cell < cells:
            raise ShapeError(f"cell: expected 0 to {cells - 1}, or none for all of them, got {self.cell}")

    @property
    def level(self) -> float:
        """Rms of the reference without its mean, in Pa."""
        return float(self.reference.pressure.std())

    def presses(self) -> NDArray[np.bool_]:
        """Mask of the channels whose cells the take presses, shape (channel,)."""
        channels = np.arange(self.recording.sensor.count)
        return np.full(len(channels), True) if self.cell is None else channels == self.cell


def split_channel(recording: Recording, channel: int) -> tuple[Recording, Recording]:
    """Split one channel, such as a reference on a spare input, off a recording; return the rest and the reference.

    Channels count row by row from 0. The cells of the other channels are a square if their number is one, otherwise
    one row. Raises ShapeError if the channel does not exist.
    """
    count = recording.sensor.count - 1
    if not 0 <= channel <= count or count < 1:
        raise ShapeError(f"reference channel: expected 0 to {count} of two channels or more, got {channel}")
    side = round(np.sqrt(count))
    shape = (side, side) if side * side == count else (1, count)
    grid = replace(recording.sensor, rows=shape[0], columns=shape[1])
    flat = recording.samples.reshape(recording.frames, -1)
    rest = np.delete(flat, channel, axis=1).reshape(-1, *grid.shape)
    alone = SensorGrid(rows=1, columns=1, pitch=grid.pitch, name=f"channel {channel} of {recording.sensor.name}")
    return (
        replace(recording, samples=rest, sensor=grid),
        replace(recording, samples=flat[:, channel].reshape(-1, 1, 1), sensor=alone),
    )


def check_alike(takes: Sequence[ReferencedTake]) -> None:
    """Raise an error if there are no takes, or takes of different sensors, units or rates."""
    if not takes:
        raise InputError("takes: expected one recording or more, got none")
    first = takes[0].recording
    for take in takes[1:]:
        if source_of(take.recording) != source_of(first):
            raise MismatchError(f"takes: expected all of sensor {spelled(first)}, got one of {spelled(take.recording)}")


def source_of(recording: Recording) -> tuple[SensorGrid, str, float]:
    """Facts that all recordings of one measurement share: sensor, unit and rate."""
    return recording.sensor, recording.unit, recording.rate


def spelled(recording: Recording) -> str:
    """Sensor, unit and rate as text."""
    return f"{recording.sensor.name!r} {recording.sensor.shape} in {recording.unit} at {recording.rate:g} Hz"


def noise_signal(
    rms: float, duration: float, *, rate: float = RATE, band: Band = (5.0, 490.0), rng: np.random.Generator
) -> Array:
    """Generate Gaussian noise with a flat spectrum within a band and zero outside, shape (frame,).

    `rms` has any unit. Bins of 1 Hz need a `duration` of 12 s or more, and longer signals reduce the uncertainty. The
    band (low, high) in Hz is wider than the band to be calibrated.
    """
    low, high = check_band(band, rate)
    frames = _frames(duration, rate)
    spectrum = np.fft.rfft(rng.standard_normal(frames))
    frequency = np.fft.rfftfreq(frames, 1 / rate)
    signal = np.fft.irfft(np.where((frequency >= low) & (frequency <= high), spectrum, 0), frames)
    return positive(rms, "rms") * signal / signal.std()


def sweep_signal(
    rms: float, duration: float, *, rate: float = RATE, band: Band = (10.0, 490.0), silence: float = 0.5
) -> Array:
    """Generate a sine with exponentially rising frequency between two silences, shape (frame,).

    phase = 2 pi f_1 L (e^(t / L) - 1), L = duration / ln(f_2 / f_1) (Farina, AES 108, 2000). The silences separate the
    response of the sensor from the transients at the ends of the recording.

    `rms` is that of the sine, in any unit; `band` is (f_1, f_2) in Hz, f_1 above 0. The first and last twentieth of the
    `duration` in s fade in and out; each `silence` comes in addition.
    """
    low, high = check_band(band, rate)
    if low <= 0:
        raise InputError(f"band of the sweep: expected to begin above 0 Hz, got {low:g} Hz")
    frames = _frames(duration, rate)
    time = np.arange(frames) / rate
    scale = frames / rate / np.log(high / low)
    fade = np.clip(np.minimum(np.arange(frames), np.arange(frames)[::-1]) / max(frames / 20, 1), 0, 1)
    tone = np.sin(2 * np.pi * low * scale * np.expm1(time / scale)) * np.sin(np.pi / 2 * fade) ** 2
    return np.pad(np.sqrt(2) * positive(rms, "rms") * tone, round(silence * rate))


def _frames(duration: float, rate: float) -> int:
    return max(2, round(positive(duration, "duration", "s") * positive(rate, "rate", "Hz")))
