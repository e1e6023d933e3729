"""Synthetic strokes of three objects over the sensor (paper, 5.3), and the recordings of the package.

A stroke is a round contact that slides down one column of the sensor. The pressure under it has three parts:

- a constant load, from the weight of the object;
- a texture: a random profile fixed to the object, so that the cells of a column measure the same profile one after
  another, stretched in time by the speed. Its amplitude spectrum over the spatial frequency k (cycles/m) is
  (k / k0) / (1 + (k / k0)^2)^((1 + fall) / 2);
- slips: the whole contact sticks, releases at random places and rings.

The parameters of the three objects are chosen, not measured: they are the simplest that reproduce the order in the
paper's Fig. 9, above 300 Hz towel over sponge over brush on both surfaces. Grooves on the sensor multiply texture and
slips by 2 at low frequencies and by 1.2 at high ones, with the midpoint at 4500 cycles/m, or 225 Hz at 5 cm/s.

The package holds real recordings whose licence permits redistribution, and synthetic ones.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.dsp import fast_length, fft_frequencies, resample
from midair.errors import InputError, RateError
from midair.files import open_take, read_toml
from midair.model import RATE, PressureFrames, Provenance, Recording, SensorGrid
from midair.recordings import resample as resample_recording
from midair.validation import one_of, positive, within

Object = Literal["brush", "sponge", "towel"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Texture:
    """Model of an object's surface."""

    load: float
    """Constant pressure under the contact, in Pa."""
    roughness: float
    """Rms of the texture on a surface without grooves, in Pa."""
    grain: float
    """k0, the spatial frequency of the texture's spectral peak, in cycles/m."""
    fall: float
    """Exponent of the decrease of amplitude above k0."""
    slips: float
    """Mean number of slips per metre of travel."""
    slip: float
    """Mean first peak of a slip on a surface without grooves, in Pa."""
    ring: float
    """Frequency of a slip's ringing, in Hz."""
    decay: float = 4e-3
    """Time constant of a slip's ringing, in s."""

    @classmethod
    def of(cls, name: Object) -> "Texture":
        """The texture of one of the three objects; raises InputError for an unknown name."""
        if name == "brush":  # bristles 1 mm apart, smooth tips
            return cls(load=24.0, roughness=4.0, grain=1000.0, fall=2.5, slips=200.0, slip=4.0, ring=60.0)
        if name == "sponge":  # pores of .6 mm
            return cls(load=28.0, roughness=4.5, grain=1600.0, fall=2.0, slips=300.0, slip=4.0, ring=90.0)
        if name == "towel":  # loops of .8 mm with fine fibres
            return cls(load=30.0, roughness=5.5, grain=1200.0, fall=1.0, slips=400.0, slip=4.0, ring=110.0)
        raise InputError(f"object of a stroke: expected one of {', '.join(get_args(Object))}, got {name!r}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """A round contact with a soft edge that slides down a column, in the direction of increasing y."""

    speed: float = 0.05
    """In m/s."""
    contact: float = 0.02
    """Diameter at half of the pressure, in m."""
    column: int = 2
    """Column along whose centre it slides."""
    edge: float = 8e-3
    """Width of the raised-cosine edge of the contact, in m."""
    lead: float = 1e-3
    """Distance without contact before the first and after the last cell, in m."""

    def __post_init__(self) -> None:
        positive(self.speed, "speed of a stroke", "m/s")
        positive(self.contact, "contact of a stroke", "m")

    def passage(self, sensor: SensorGrid) -> Array:
        """Time at which the centre of the contact passes the centre of each row, shape (row,), in s."""
        return ((self.contact + self.edge) / 2 + self.lead + sensor.y - sensor.y[0]) / self.speed

    def duration(self, sensor: SensorGrid) -> float:
        """Time from the start until the contact has left the last cell and its lead, in s."""
        return float(self.passage(sensor)[[0, -1]].sum())

    def cover(self, sensor: SensorGrid, time: Array) -> Array:
        """Share of each cell's full pressure that acts, 0 to 1, shape (time, row, column)."""
        along = (time[:, None] - self.passage(sensor)) * self.speed
        across = sensor.x - sensor.x[self.column]
        outside = np.hypot(along[:, :, None], across) - self.contact / 2
        return 0.5 - 0.5 * np.sin(np.pi * np.clip(outside / self.edge, -0.5, 0.5))


def stroke(
    object: Object,
    *,
    groove: bool = False,
    seed: int = 0,
    rate: float = RATE,
    speed: float = 0.05,
    contact: float = 0.02,
    duration: float | None = None,
    column: int = 2,
    sensor: SensorGrid | None = None,
    peak: float | None = None,
) -> PressureFrames:
    """Pressure on the cells while an object slides down one column, without any sensor model.

    It is generated at 8 kHz and resampled to `rate`: the same seed gives the same stroke at every rate. The strokes of
    an object on the two surfaces differ only by the grooves. Raises RateError if the rate is above 8000 Hz; InputError
    if the object is unknown, or the column or a quantity is out of range.

    The surface of the sensor is plain or has grooves (`groove`). `rate` is in Hz, up to 8000; use 8000 as input of a
    simulation in time. `speed` is in m/s, `contact` the diameter of the contact in m. `duration`, in s, cuts the stroke
    or appends silence; by default it ends when the object has left, after 1.26 s at the other defaults. On `column` 2
    the object passes channels 2, 6, 10 and 14. The default sensor has 4 x 4 cells at 11 mm. `peak` is the largest
    pressure after scaling, in Pa; by default the object's own, 33 to 50 Pa without, 41 to 71 Pa with grooves.

    The pressure is 0 without contact. Where the contact releases for an instant, the band limit causes ringing down to
    -2 Pa at most.
    """
    sensor = sensor or SensorGrid()
    fine = 8000.0
    if not 0 < rate <= fine:
        raise RateError(f"rate of a stroke: expected above 0 and up to {fine:g} Hz, got {rate:g} Hz")
    within(column, "column of a stroke", 0, sensor.columns - 1)
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
    frames = int(np.ceil(motion.duration(sensor) * rate)) + 1
    length = fast_length(frames)
    frequency = fft_frequencies(length, rate)
    profile = _profile(texture, frequency / motion.speed, length, sensor.columns, rng)
    # The same profile reaches one row after another: phase factors give exact delays, also between frames.
    late = np.exp(-2j * np.pi * frequency[:, None] * motion.passage(sensor))
    slips = np.fft.rfft(_slips(texture, motion.speed, np.arange(length) / rate, rng))
    spectrum = profile[:, None, :] * late[:, :, None] + slips[:, None, None]
    if groove:
        spectrum *= groove_gain(frequency / motion.speed)[:, None, None]
    vibration = np.fft.irfft(spectrum, length, axis=0)[:frames]
    # A contact cannot pull: pressure is never negative.
    return motion.cover(sensor, np.arange(frames) / rate) * np.maximum(texture.load + vibration, 0)


def groove_gain(k: Array) -> Array:
    """Gain of the grooves for vibration at spatial frequency `k` (cycles/m): 2 far below 4500, 1.2 far above."""
    return 1.2 + 0.8 / (1 + (k / 4500) ** 4)


def _profile(texture: Texture, k: Array, length: int, columns: int, rng: np.random.Generator) -> NDArray[np.complex128]:
    """Spectrum of the texture along each column, shape (bin, column), for an inverse FFT of `length`."""
    shape = (k / texture.grain) / (1 + (k / texture.grain) ** 2) ** ((1 + texture.fall) / 2)
    noise = rng.standard_normal((columns, len(k), 2)) @ np.array([1, 1j])
    return (noise * (texture.roughness * length / 2 * shape / np.sqrt((shape**2).sum()))).T


def _slips(texture: Texture, speed: float, time: Array, rng: np.random.Generator) -> Array:
    """Ringing of slips at random times, uniform in travel, with exponential sizes, shape (time,), in Pa."""
    count = rng.poisson(texture.slips * speed * time[-1])
    starts, sizes = rng.uniform(0, time[-1], count), rng.exponential(texture.slip, count)
    after = np.maximum(time[:, None] - starts, 0)
    rings = np.exp(-after / texture.decay) * np.sin(2 * np.pi * texture.ring * after)
    return rings @ sizes


def _cut(pressure: Array, frames: int | None) -> Array:
    """The first `frames` frames, padded with silence if there are fewer; all of them for None."""
    if frames is None:
        return pressure
    silence = np.zeros((max(0, frames - len(pressure)), *pressure.shape[1:]))
    return np.concatenate([pressure[: max(frames, 1)], silence])


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """A recording that is part of the package."""

    name: str
    """Argument of `sample`."""
    what: str
    """Description in one line."""
    licence: str
    """SPDX identifier; the text is beside the file."""
    source: str
    """Repository, commit and paper."""
    file: str = ""
    """Path below the folder of the samples; empty for a synthetic recording."""
    stroke: Object | None = None
    """Object of a synthetic recording."""
    peak: float | None = None
    """Largest pressure in Pa; None for the default of the object. For a real recording it is the largest change of any
    channel, chosen so that it can be felt, not measured."""
    faster: float = 1.0
    """Factor by which it is faster than the original."""
    notes: Mapping[str, str] = field(default_factory=dict[str, str])
    """Further notes for the provenance, besides licence and source."""

    @property
    def ready(self) -> bool:
        """True if the recording is in Pa and can be solved directly."""
        return self.peak is not None or self.stroke is not None


STORED = read_toml(Path(__file__).with_name("gallery.toml"), "a gallery")
"""The tables ``sample``, ``touch`` and ``drawn`` of the gallery."""

SAMPLES: Mapping[str, Sample] = {name: Sample(name=name, **about) for name, about in STORED["sample"].items()}
"""By name."""


def samples() -> tuple[Sample, ...]:
    """Every sample that is part of the package."""
    return tuple(SAMPLES.values())


def sample(name: str) -> Recording:
    """Load or generate a sample by name; its provenance contains source and licence.

    Raises InputError if the name is unknown.
    """
    about = _sample_named(name)
    if about.stroke is None:
        return _with_notes(_read(about), about)
    made = stroke(about.stroke, peak=about.peak)
    found = Recording(samples=made.pressure, rate=made.rate, sensor=made.sensor, unit="Pa", provenance=made.provenance)
    return _with_notes(found, about)


def with_credits(name: str, recording: Recording) -> Recording:
    """A recording read from `sample_path(name)`, with licence and source added to its provenance."""
    return _with_notes(recording, _sample_named(name))


def _with_notes(recording: Recording, about: Sample) -> Recording:
    notes = {"licence": about.licence, "origin": about.source, **about.notes}
    return replace(recording, provenance=replace(recording.provenance, notes={**recording.provenance.notes, **notes}))


def _read(about: Sample) -> Recording:
    """Read a real sample, and apply its speed and level if it has them."""
    found = open_take(sample_path(about.name), **_OPENED.get(about.name, {})).recording
    if about.peak is None:
        return found
    life = found.provenance.then("faster", {"times": about.faster, "from_hz": found.rate})
    quick = resample_recording(replace(found, rate=about.faster * found.rate, provenance=life), RATE)
    change = np.asarray(quick.samples) - np.median(quick.samples, axis=0)
    scale = about.peak / float(np.abs(change).max())
    life = quick.provenance.then("level", {"pa_per_count": scale, "peak_pa": about.peak})
    return replace(quick, samples=scale * change, unit="Pa", provenance=life)


_OPENED: Mapping[str, Mapping[str, Any]] = {"connect": {"unit": "count"}}
"""Options that `open_take` needs for a sample."""


def _sample_named(name: str) -> Sample:
    one_of(name, SAMPLES, "sample")
    return SAMPLES[name]


def sample_path(name: str) -> Path:
    """The original file of a sample, byte by byte as its authors published it.

    Raises InputError if the name is unknown, or the sample is synthetic.
    """
    if not _sample_named(name).file:
        raise InputError(f"sample: expected one that has a file, got {name!r}, which is made by sample()")
    return Path(str(files("midair.datasets").joinpath("samples", *SAMPLES[name].file.split("/"))))
