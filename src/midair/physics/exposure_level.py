"""Sound exposure of ears and hands: level of every frame, dose, and nonlinearity.

Levels are in dB re 20 µPa rms, from the linear field of each frame alone and of moments while frames arrive.
"""

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache
from threading import local

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from midair.array_types import Array
from midair.errors import InputError
from midair.model import Acoustics, Drive, Medium, TransducerArray
from midair.physics.exposure_modes import Workspace, drive_parts
from midair.physics.exposure_places import PUBLISHED_TIME, ExposureProfile, HeatSoFar, Place, palm_warming
from midair.physics.exposure_search import ALLOWANCE, Searches, ceiling, point_search, searches_of
from midair.physics.exposure_time import BLOCK, SoundInTime
from midair.physics.propagation import radiation_pressure, transfer_matrix
from midair.streaming import blocks
from midair.validation import frozen_array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Exposure:
    """Sound levels of a drive at the places of a profile."""

    profile: ExposureProfile
    level: Array
    """Highest sound pressure level in the cube of each place in dB, shape (frame, place).

    At places with an enforced limit it is that of the loudest moment, from the frame alone to the next one alone.
    """
    airs: tuple[Acoustics, ...]
    """The airs (temperature, humidity) for which the levels were computed."""
    air: NDArray[np.integer]
    """Index of the air with the highest level, shape (frame, place)."""
    rate: float
    """Frames per second, in Hz."""
    repeats: int
    """Number of times that all frames are played."""
    nonlinearity: float
    """sigma of the strongest frame up to the palm; above 1 the linear field overestimates."""
    pressure: float
    """Highest radiation pressure of up to 256 frames on the palm, at points 5 mm apart, in Pa."""
    duty: Array
    """Highest mean level of each unit over a minute, shape (unit,), 0 to 1; empty if the frames come later."""
    warming: float
    """Estimated warming of the palm in K; if the frames come later, by a still focus of 5 s."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "level", frozen_array(self.level, "level", ("frame", len(self.profile.places))))

    def weakened(self, factor: float) -> "Exposure":
        """Exposure to the same frames at a part of their level, 0 to 1; pressure and warming go with its square."""
        return replace(
            self,
            level=self.level + 20 * np.log10(max(factor, 1e-9)),
            nonlinearity=self.nonlinearity * factor,
            pressure=self.pressure * factor**2,
            duty=self.duty * factor,
            warming=self.warming * factor**2,
        )

    @property
    def duration(self) -> float:
        """Total time of all repeats, in s."""
        return len(self.level) * self.repeats / self.rate

    @property
    def peak(self) -> Array:
        """Level of the loudest frame, shape (place,), in dB."""
        return self.level.max(axis=0)

    @property
    def mean(self) -> Array:
        """Energy-averaged level, shape (place,), in dB."""
        return np.asarray(10 * np.log10(np.mean(10 ** (self.level / 10), axis=0)), np.float64)

    @property
    def dose(self) -> Array:
        """Integral of the squared sound pressure over all repeats, shape (place,), in Pa2 s."""
        return np.asarray((20e-6) ** 2 * 10 ** (self.mean / 10) * self.duration, np.float64)

    @property
    def daily(self) -> Array:
        """Equivalent level over eight hours with the same dose, shape (place,), in dB."""
        return np.asarray(self.mean + 10 * np.log10(self.duration / 28800), np.float64)

    @property
    def excess(self) -> float:
        """Sound above an enforced limit in dB, negative when all are kept; duty or warming if that is further above."""
        return max(self.sound_excess, self._heat_excess) if self._heat_excess > 0 else self.sound_excess

    @property
    def sound_excess(self) -> float:
        """Sound above an enforced limit in dB, negative when all are kept."""
        return float(self.above.max(initial=-np.inf))

    @property
    def above(self) -> Array:
        """Sound of each frame above the limit of each place in dB, shape (frame, place); -inf if it is not enforced."""
        limits = [place.limit if place.enforced else np.inf for place in self.profile.places]
        return np.asarray(self.level - limits, np.float64)

    @property
    def _heat_excess(self) -> float:
        """Duty is proportional to the level, warming to its square."""
        duty = self.duty.max(initial=0.0) / self.profile.duty
        return 20 * float(np.log10(max(duty, np.sqrt(self.warming / self.profile.warming), 1e-6)))

    @property
    def worst(self) -> tuple[Place, int]:
        """The enforced place with the highest level relative to its limit, and its loudest frame.

        Raises InputError if the profile has no enforced limit.
        """
        if not any(place.enforced for place in self.profile.places):
            raise InputError(f"profile {self.profile.name}: expected at least one enforced limit, got none")
        frame, number = np.unravel_index(self.above.argmax(), self.level.shape)
        return self.profile.places[number], int(frame)

    @property
    def loudest_air(self) -> Medium:
        """The air in which the worst frame is loudest at the worst place."""
        place, frame = self.worst
        return self.airs[int(self.air[frame, self.profile.places.index(place)])].medium

    @property
    def measured_in(self) -> str:
        """One line: the airs of the computation, and the one with the highest level."""
        slow, fast = self.airs[0].medium, self.airs[-1].medium
        if len(self.airs) == 1:
            return str(slow)
        return f"{slow.degrees:.0f} to {fast.degrees:.0f} °C; loudest in {self.loudest_air}"

    @property
    def resolution(self) -> str:
        """One line: accuracy of the levels."""
        bounded = [place.name for place in self.profile.places if place.enforced and place.reach > 0]
        rough = [place.name for place in self.profile.places if not place.enforced and place.reach > 0]
        around = "loudest of the whole volume, at moments at most 0.125 ms apart"
        lines = [f"{', '.join(bounded)}: {around}"] if bounded else []
        lines += [f"{', '.join(rough)}: maximum of 27 points; a focus between them is missed"] if rough else []
        return "; ".join(lines)

    @property
    def heat(self) -> str:
        """One line: mean level of the units and warming of the palm, with their limits."""
        duty = self.duty.max(initial=0.0)
        unit = (
            f"unit {self.duty.argmax()} at {duty:.2g} of full drive over a minute" if duty else "units not known ahead"
        )
        return (
            f"{unit}, limit {self.profile.duty:g} (midair's own); palm warms by {self.warming:.2g} K, limit "
            f"{self.profile.warming:g} K (estimate)"
        )

    def verdict(self) -> str:
        """One line: whether the profile is kept, and the level at the worst place."""
        place, _ = self.worst
        level = f"{self.peak[self.profile.places.index(place)]:.1f} dB at the {place.name}, limit {place.limit:g} dB"
        loud = f"{self.sound_excess:.1f} dB too loud" if self.sound_excess > 0 else "within the limit"
        return f"{loud}: {level}" + (f"; too hot: {self.heat}" if self._heat_excess > 0 else "")

    @property
    def where(self) -> str:
        """One line: position of the worst place, its loudest frame, and the air in which it is loudest."""
        (place, frame), air = self.worst, self.loudest_air
        return f"{1e3 * np.array(place.position)} mm, frame {frame}, in air of {air.degrees:.0f} °C"

    def __repr__(self) -> str:
        return f"<Exposure {len(self.level)} frames, {self.repeats} times, {self.verdict()}>"


_RUN = 8192
"""Frames whose moments are in memory at once."""


def exposure(
    drive: Drive,
    profile: ExposureProfile,
    *,
    repeats: int = 1,
    acoustics: Acoustics | tuple[Acoustics, ...] | None = None,
    steps: int | None = None,
    heat: tuple[Array, float] | None = None,
    earlier: int = 0,
    ends: bool = True,
    alone: bool = False,
) -> Exposure:
    """Compute the sound levels of a drive, played `repeats` times, at the places of a profile, for every frame.

    The acoustics are by default those of the drive; for several airs the highest level of each frame counts. `steps` is
    the number of phase steps per turn to which units round; no rounding if None. `heat` is that of `heat_so_far`, if it
    is known.

    The first `earlier` frames were measured before, and only sound beside others; it is silent before them. Unless the
    drive `ends`, other frames follow without silence between them. With `alone`, each frame is measured as if it
    lasted.
    """
    airs = acoustics if isinstance(acoustics, tuple) else (acoustics or drive.acoustics,)
    level = np.zeros((drive.frames, len(profile.places)))
    loudest = np.zeros(level.shape, np.int8)
    # NumPy releases the interpreter lock, so these threads use all cores; additional BLAS threads would only wait.
    with threadpool_limits(limits=1, user_api="blas"), ThreadPoolExecutor(os.cpu_count()) as threads:
        sound = SoundInTime.of(drive, profile, airs, steps, alone=alone)
        duty, warming = heat or heat_so_far(drive.frames, profile, airs, repeats=repeats).add(drive)
        for run in _runs(drive.frames, sound.lead, earlier, ends=ends, repeats=repeats):
            frames, amplitude, air = sound.measure(run, threads.map)
            # The silence after a drive counts as its last frame.
            frames[frames < 0] = drive.frames - 1
            for place in range(len(profile.places)):
                rising = np.argsort(amplitude[:, place], kind="stable")
                rising = rising[amplitude[rising, place] > level[frames[rising], place]]
                level[frames[rising], place] = amplitude[rising, place]
                loudest[frames[rising], place] = air[rising, place]
    for first in range(0, len(level), _RUN):
        level[first : first + _RUN] = sound_level(level[first : first + _RUN])
    # The palm's limit is not enforced: the first, the middle and the last air suffice. The coldest distorts most.
    few = airs[:: max(1, len(airs) // 2)]
    return Exposure(
        profile=profile,
        level=level[earlier:],
        airs=airs,
        air=loudest[earlier:],
        rate=drive.rate,
        repeats=repeats,
        nonlinearity=_nonlinearity(drive, profile, airs[0], level),
        pressure=max(_pressure(drive, profile, air) for air in few),
        duty=duty,
        warming=warming,
    )


def _runs(frames: int, lead: int, earlier: int, *, ends: bool, repeats: int) -> Iterator[NDArray[np.intp]]:
    """Frames in the order of their sound, -1 for silence; the first `lead` of each run only sound beside others."""
    last = frames + lead * ends
    for first in range(earlier - lead, last - lead, _RUN):
        run = np.arange(first, min(first + _RUN + lead, last))
        run[(run < 0) | (run >= frames)] = -1
        yield run
    if repeats > 1 and lead > 0:
        # The first frames also sound beside the last ones.
        yield np.arange(-lead, lead) % frames


def frames_at_once(drive: Drive, profile: ExposureProfile, airs: tuple[Acoustics, ...]) -> int:
    """Number of earlier frames that must be known to measure a frame at the places with an enforced limit."""
    return SoundInTime.of(drive, profile, airs, None).lead


def heat_so_far(frames: int, profile: ExposureProfile, airs: tuple[Acoustics, ...], *, repeats: int = 1) -> HeatSoFar:
    """Heat of a drive of this number of frames that comes in parts, on the palm of a profile."""
    return HeatSoFar(_palm_points(profile), frames, acoustics=airs[len(airs) // 2], repeats=repeats)


_kept = local()  # A workspace of each thread


def exposure_excess(
    drive: Drive,
    profile: ExposureProfile,
    airs: tuple[Acoustics, ...],
    *,
    steps: int | None = None,
    stride: int = 1,
    above: float = 0.0,
) -> Array:
    """How far the level of each of a few frames is above the enforced limits in dB, shape (frame,), on one core.

    With a `stride`, frames between multiples of it get an upper bound from those beside them, since a field is
    linear in its drive, and all transducers together bound that of the difference. Where it is `above` this many dB, or
    each transducer has a level, the frame itself is measured.
    """
    if not (places := tuple(place for place in profile.places if place.enforced)):
        return np.full(drive.frames, -np.inf)
    searches = searches_of(places, drive.array, airs)
    space = _kept.__dict__.setdefault("space", Workspace())
    parts, strength = drive_parts(drive, slice(None), space, steps=steps)
    numbers = np.arange(drive.frames)
    keys = np.union1d(numbers[:: stride if drive.level.ndim == 1 else 1], numbers[-1])
    found = searches.loudest(np.ascontiguousarray(parts[:, keys]), space).max(axis=0)
    if len(keys) < drive.frames:
        after = np.searchsorted(keys, numbers)
        before = np.maximum(after - 1, 0)
        share = (numbers - keys[before])[:, None] / np.maximum(keys[after] - keys[before], 1)[:, None]
        near = share.astype(np.float32)
        rest = parts[:2] - (1 - near) * parts[:2, keys[before]] - near * parts[:2, keys[after]]
        beside = np.sqrt(rest[0] ** 2 + rest[1] ** 2) @ searches.ceiling
        found = (1 - share) * found[before] + share * found[after] + 10 ** (ALLOWANCE / 20) * beside
    excess = (sound_level(searches.bounded(found, strength)) - [place.limit for place in places]).max(axis=1)
    if len(keys) < drive.frames and (loud := excess > above).any():
        some = replace(drive, phase=drive.phase[loud], level=drive.level[loud])
        excess[loud] = exposure_excess(some, profile, airs, steps=steps)
    return excess


def greatest_exposure(
    array: TransducerArray, level: float, profile: ExposureProfile, *, rate: float, airs: tuple[Acoustics, ...]
) -> Exposure:
    """Upper bound of the exposure for any phases at a level: the sum of all transducers, each where it is loudest.

    Returns an `Exposure` of one frame; `level` is 0 to 1.
    """
    # The bound does not depend on phases, so airs between the first and the last add nothing.
    ceilings = np.array([[ceiling(place, array, (air,)).sum() for place in profile.places] for air in airs])
    loudest = sound_level(level * ceilings.max(axis=0, keepdims=True))
    palm = np.array(profile.nearest[1].position)
    phase = -np.angle(transfer_matrix(palm[None], array, acoustics=airs[0]))
    focus = Drive(phase=phase, level=np.array([level]), rate=rate, array=array, acoustics=airs[0])
    still = replace(focus, rate=1 / PUBLISHED_TIME)
    return Exposure(
        profile=profile,
        level=loudest,
        airs=airs,
        air=ceilings.argmax(axis=0)[None],
        rate=rate,
        repeats=1,
        nonlinearity=_nonlinearity(focus, profile, airs[0], loudest),
        pressure=_pressure(focus, profile, airs[0]),
        duty=np.zeros(0),
        warming=palm_warming(still, _palm_points(profile), acoustics=airs[0]),
    )


UNLIKE = 0.2
"""Relative error of a transducer that is not measured: its phase differs by .2 rad (median of 33 published boards)."""

MEASURED = 0.05
"""The same for a measured array: strengths to 3 % and phases to .03 rad (docs/decisions/0028-measured-array)."""


def level_if_unlike(drive: Drive, profile: ExposureProfile, spread: float = UNLIKE) -> Array:
    """Level in dB at each place that random errors of the transducers alone cause in the loudest frame, (place,).

    `spread` is their rms relative error. Sound that cancels at an ear does so for equal transducers only. The maximum
    over a cube is twice the rms sound, as it is for some fifty independent values with a Rayleigh distribution.
    """
    alone = np.stack([ceiling(place, drive.array, (drive.acoustics,)) for place in profile.places], axis=1) ** 2
    alone = alone.sum(axis=0, keepdims=True) if drive.level.ndim == 1 else alone
    power = [(part.reshape(len(part), -1) ** 2 @ alone).max(axis=0) for part in blocks(drive.level, BLOCK)]
    return sound_level(2 * spread * np.sqrt(np.max(power, axis=0)))


def sound_level(peak: Array) -> Array:
    """Sound pressure level of a peak amplitude, in dB re 20 µPa rms: 20 lg(p / sqrt(2) / 20 µPa), at least -40 dB."""
    # The lower limit represents silence, whose level is minus infinity.
    return np.asarray(20 * np.log10(np.maximum(peak / np.sqrt(2) / 20e-6, 1e-2)), np.float64)


def nonlinearity_index(pressure: Array, path: Array, medium: Medium, frequency: float) -> float:
    """Distortion of a beam: sigma = 1.2 omega / (rho c^3) integral |p| ds; in a plane wave a shock forms at 1.

    1.2 is the coefficient of nonlinearity of air (Hamilton & Blackstock, Nonlinear Acoustics, chapter 4). `pressure` is
    the amplitude along the beam in Pa, `path` the distance in m, `frequency` in Hz.
    """
    integral = float(np.trapezoid(np.abs(pressure), path))
    return 1.2 * 2 * np.pi * frequency / (medium.density * medium.speed**3) * integral


def _nonlinearity(drive: Drive, profile: ExposureProfile, acoustics: Acoustics, level: Array) -> float:
    """Index of the frame that is strongest at the palm, along the line to it."""
    number, palm = profile.nearest
    strongest = int(level[:, number].argmax())
    path, matrix = _beam(palm.position, drive.array, acoustics)
    pressure = np.abs(matrix @ drive.q_of(slice(strongest, strongest + 1))[0])
    return nonlinearity_index(pressure, path, acoustics.medium, drive.array.frequency)


@lru_cache(maxsize=16)
def _beam(
    end: tuple[float, float, float], array: TransducerArray, acoustics: Acoustics
) -> tuple[Array, NDArray[np.complex128]]:
    """Distances along the line from the centre of the array to a place, and the transfer matrix there."""
    # Not from 0: the field at a transducer is infinite.
    share = np.linspace(0.02, 1, 200)
    matrix = transfer_matrix(share[:, None] * np.array(end), array, acoustics=acoustics)
    return share * float(np.linalg.norm(end)), matrix


def _pressure(drive: Drive, profile: ExposureProfile, acoustics: Acoustics) -> float:
    """Highest radiation pressure in the plane of the nearest place, at points 5 mm apart over 6 cm, in Pa."""
    some = np.unique(np.linspace(0, drive.frames - 1, 256).astype(int))
    space = Workspace()
    parts, strength = drive_parts(drive, some, space)
    palm = _palm(profile, drive.array, acoustics)
    loudest = palm.bounded(palm.loudest(parts, space)[0], strength)
    return float(radiation_pressure(loudest.max(initial=0.0), acoustics.medium))


@lru_cache(maxsize=16)
def _palm(profile: ExposureProfile, array: TransducerArray, acoustics: Acoustics) -> Searches:
    return Searches.of(point_search(_palm_points(profile), array, (acoustics,)))


def _palm_points(profile: ExposureProfile) -> Array:
    """Points 5 mm apart over 6 cm in the plane of the nearest place, shape (point, 3), in m."""
    steps = np.arange(-30e-3, 31e-3, 5e-3)
    x, y = np.meshgrid(steps, steps)
    points = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    return np.asarray(points + np.array(profile.nearest[1].position), np.float64)
