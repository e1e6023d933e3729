"""Seeded strokes of three objects over the sensor (paper, 5.3).

A stroke is a round contact that slides down one column of the sensor. Under it act

- a load, which the object's weight makes;
- a texture: a random profile that is fixed to the object, so that the cells of a column feel the same profile one after
  another, stretched in time by the speed. Its amplitude spectrum over the spatial frequency k (cycles/m) is
  (k / k0) / (1 + (k / k0)^2)^((1 + fall) / 2);
- slips: the contact as a whole sticks, lets go at random places and rings.

The numbers of the three objects are chosen, not measured: they are the simplest that differ as the paper's Fig. 9 says,
above 300 Hz towel over sponge over brush on both surfaces. Grooves on the sensor multiply texture and slips by 2 at low
frequencies and by 1.2 at high ones, half way at 4500 cycles/m, which is 225 Hz at 5 cm/s.
"""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from midair.dsp import fft_frequencies, resample
from midair.errors import InputError, RateError
from midair.model import PressureFrames, Provenance, SensorGrid
from midair.validation import positive

Array = NDArray[np.float64]
Object = Literal["brush", "sponge", "towel"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Texture:
    """What an object does to a cell while it slides.

    Attributes
    ----------
    load : float
        Even pressure under the contact, in Pa.
    roughness : float
        rms of the texture on a surface without grooves, in Pa.
    grain : float
        k0, where the texture's spectrum is highest, in cycles/m.
    fall : float
        Exponent with which the amplitude falls above k0.
    slips : float
        Mean number of slips for one metre of travel.
    slip : float
        Mean first peak of a slip on a surface without grooves, in Pa.
    ring : float
        Frequency of a slip's ring, in Hz.
    decay : float
        Time constant of a slip's ring, in s.
    """

    load: float
    roughness: float
    grain: float
    fall: float
    slips: float
    slip: float
    ring: float
    decay: float = 4e-3

    @classmethod
    def of(cls, name: Object) -> "Texture":
        """The texture of one of the three objects.

        Raises
        ------
        InputError
            If it is none of them.
        """
        if name == "brush":  # bristles 1 mm apart, smooth tips
            return cls(load=24.0, roughness=4.0, grain=1000.0, fall=2.5, slips=200.0, slip=4.0, ring=60.0)
        if name == "sponge":  # pores of .6 mm
            return cls(load=28.0, roughness=4.5, grain=1600.0, fall=2.0, slips=300.0, slip=4.0, ring=90.0)
        if name == "towel":  # loops of .8 mm with fine fibres
            return cls(load=30.0, roughness=5.5, grain=1200.0, fall=1.0, slips=400.0, slip=4.0, ring=110.0)
        raise InputError(f"object of a stroke: expected one of {', '.join(get_args(Object))}, got {name!r}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """A round contact with a soft edge that slides down a column, in the direction of growing y.

    Attributes
    ----------
    speed : float
        In m/s.
    contact : float
        Diameter at half of the pressure, in m.
    column : int
        Along whose middle it slides.
    edge : float
        Width of the raised-cosine edge of the contact as a cell feels it, in m.
    lead : float
        Free way before the first cell feels it and after the last one has, in m.
    """

    speed: float = 0.05
    contact: float = 0.02
    column: int = 2
    edge: float = 8e-3
    lead: float = 1e-3

    def __post_init__(self) -> None:
        positive(self.speed, "speed of a stroke", "m/s")
        positive(self.contact, "contact of a stroke", "m")

    def passage(self, sensor: SensorGrid) -> Array:
        """When the middle of the contact passes the middle of each row, shape (row,), in s."""
        first = (self.contact + self.edge) / 2 + self.lead
        return (first + sensor.y - sensor.y[0]) / self.speed

    def duration(self, sensor: SensorGrid) -> float:
        """Time from the start to the end of the free way behind the last cell, in s."""
        return float(self.passage(sensor)[[0, -1]].sum())

    def cover(self, sensor: SensorGrid, time: Array) -> Array:
        """How much of each cell's full pressure acts, 0 to 1, shape (time, row, column)."""
        along = (time[:, None] - self.passage(sensor)) * self.speed
        across = sensor.x - sensor.x[self.column]
        outside = np.hypot(along[:, :, None], across) - self.contact / 2
        return 0.5 - 0.5 * np.sin(np.pi * np.clip(outside / self.edge, -0.5, 0.5))


def stroke(
    object: Object,
    *,
    groove: bool = False,
    seed: int = 0,
    rate: float = 1000.0,
    speed: float = 0.05,
    contact: float = 0.02,
    duration: float | None = None,
    column: int = 2,
    sensor: SensorGrid | None = None,
    peak: float | None = None,
) -> PressureFrames:
    """True pressure on the cells while an object slides down one column, before any sensor.

    It is made at 8 kHz and brought to `rate` with what is above half of it removed: the same seed gives the same
    stroke at every rate. The same object on the two surfaces differs by the grooves alone.

    Parameters
    ----------
    object : {"brush", "sponge", "towel"}
        What slides.
    groove : bool
        Whether the sensor's surface has the grooves.
    seed : int
        Seed of the texture and the slips.
    rate : float
        Frames per second, up to 8000 Hz; take 8000 to drive a simulation in time.
    speed : float
        In m/s.
    contact : float
        Diameter of the contact, in m.
    duration : float, optional
        In s: cuts the stroke, or adds silence. By default until the object has left, 1.26 s at the other defaults.
    column : int
        Column of the sensor; 2 lets the object pass channels 2, 6, 10 and 14.
    sensor : SensorGrid, optional
        The cells; 4 x 4 at 11 mm by default.
    peak : float, optional
        Scale the whole stroke to this largest pressure, in Pa. By default it is as strong as the object makes it:
        33 to 50 Pa without, 41 to 71 Pa with grooves.

    Returns
    -------
    PressureFrames
        Simulated, in Pa; 0 where nothing touches. Where a contact goes slack for an instant, the limit to half the rate
        rings below 0, by 2 Pa at most.

    Raises
    ------
    RateError
        If the rate is above 8000 Hz.
    InputError
        If the object, the column or a quantity makes no sense.
    """
    sensor = sensor or SensorGrid()
    fine = 8000.0
    if not 0 < rate <= fine:
        raise RateError(f"rate of a stroke: expected above 0 and up to {fine:g} Hz, got {rate:g} Hz")
    if not 0 <= column < sensor.columns:
        raise InputError(f"column of a stroke: expected 0 to {sensor.columns - 1}, got {column}")
    motion = Motion(speed=speed, contact=contact, column=column)
    texture = Texture.of(object)
    rng = np.random.default_rng([seed, get_args(Object).index(object)])
    pressure = resample(_slide(texture, motion, sensor, fine, groove, rng), fine, rate)
    if peak is not None:
        pressure = pressure * (positive(peak, "peak", "Pa") / pressure.max())
    pressure = _cut(pressure, None if duration is None else round(positive(duration, "duration", "s") * rate))
    settings = {"object": object, "groove": groove, "seed": seed, "speed_m_per_s": speed, "contact_m": contact}
    settings |= {"column": column, "peak_pa": float(pressure.max())}
    notes = {"object": object, "surface": "groove" if groove else "plain"}
    return PressureFrames(
        pressure=pressure,
        rate=rate,
        sensor=sensor,
        provenance=Provenance(source=f"virtual:{object}", simulated=True, notes=notes).then("stroke", settings),
    )


def _slide(
    texture: Texture, motion: Motion, sensor: SensorGrid, rate: float, groove: bool, rng: np.random.Generator
) -> Array:
    """Pressure on each cell at a fine rate, shape (frame, row, column), in Pa."""
    from scipy.fft import irfft, next_fast_len, rfft

    frames = int(np.ceil(motion.duration(sensor) * rate)) + 1
    length = next_fast_len(frames, real=True)
    frequency = fft_frequencies(length, rate)
    profile = _profile(texture, frequency / motion.speed, length, sensor.columns, rng)
    # The same profile reaches one row after another: a delay is a phase, exact between frames, too.
    late = np.exp(-2j * np.pi * frequency[:, None] * motion.passage(sensor))
    slips = rfft(_slips(texture, motion.speed, np.arange(length) / rate, rng))
    spectrum = profile[:, None, :] * late[:, :, None] + slips[:, None, None]
    if groove:
        spectrum *= groove_gain(frequency / motion.speed)[:, None, None]
    vibration = irfft(spectrum, length, axis=0)[:frames]
    # What touches can let go, but not pull.
    return motion.cover(sensor, np.arange(frames) / rate) * np.maximum(texture.load + vibration, 0)


def groove_gain(k: Array) -> Array:
    """What grooves do to the vibration at spatial frequency `k` (cycles/m): 2 far below 4500, 1.2 far above."""
    return 1.2 + 0.8 / (1 + (k / 4500) ** 4)


def _profile(texture: Texture, k: Array, length: int, columns: int, rng: np.random.Generator) -> NDArray[np.complex128]:
    """Spectrum of the texture along each column, shape (bin, column), for an inverse FFT of `length`."""
    shape = (k / texture.grain) / (1 + (k / texture.grain) ** 2) ** ((1 + texture.fall) / 2)
    noise = rng.standard_normal((columns, len(k), 2)) @ np.array([1, 1j])
    return (noise * (texture.roughness * length / 2 * shape / np.sqrt((shape**2).sum()))).T


def _slips(texture: Texture, speed: float, time: Array, rng: np.random.Generator) -> Array:
    """Rings that start at random, their times even in travel and their sizes exponential, shape (time,), in Pa."""
    count = rng.poisson(texture.slips * speed * time[-1])
    starts, sizes = rng.uniform(0, time[-1], count), rng.exponential(texture.slip, count)
    after = np.maximum(time[:, None] - starts, 0)
    rings = np.exp(-after / texture.decay) * np.sin(2 * np.pi * texture.ring * after)
    return rings @ sizes


def _cut(pressure: Array, frames: int | None) -> Array:
    """The first `frames` of it, with silence behind where there are more; all of it for None."""
    if frames is None:
        return pressure
    silence = np.zeros((max(0, frames - len(pressure)), *pressure.shape[1:]))
    return np.concatenate([pressure[: max(frames, 1)], silence])
