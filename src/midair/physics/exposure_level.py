"""What sound reaches ears and hands: level of every frame, dose, and how far from linear the sound is.

Levels are in dB re 20 µPa rms, from the linear field of each frame as if it lasted for ever.
"""

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from midair.errors import InputError
from midair.model import Acoustics, Drive, Medium, TransducerArray
from midair.physics.exposure_places import ExposureProfile, Place
from midair.physics.exposure_search import Searches, Workspace, ceiling, drive_parts, point_search, searches_of
from midair.physics.propagation import transfer_matrix
from midair.physics.radiation import radiation_pressure
from midair.progress import passing
from midair.validation import frozen_array

Array = NDArray[np.float64]
Single = NDArray[np.float32]

BLOCK = 256
"""Frames that are worked out at once."""

_SHARE = 16
"""Blocks that one thread goes through before it says so."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Exposure:
    """What a drive exposes people to.

    Attributes
    ----------
    profile : ExposureProfile
        The profile whose places and limits these are.
    level : ndarray, shape (frame, place)
        Highest sound pressure level in the cube of each place, in dB.
    airs : tuple of Acoustics
        The airs in which it was measured.
    air : ndarray of int, shape (frame, place)
        Number of the air that is loudest.
    rate : float
        Frames per second, in Hz.
    repeats : int
        How often all frames are played.
    nonlinearity : float
        sigma of the strongest frame up to the palm; above 1 the linear field is too strong.
    pressure : float
        Highest radiation pressure of up to 256 frames on a palm at the nearest place, at points 5 mm apart, in Pa.
    """

    profile: ExposureProfile
    level: Array
    airs: tuple[Acoustics, ...]
    air: NDArray[np.integer]
    rate: float
    repeats: int
    nonlinearity: float
    pressure: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "level", frozen_array(self.level, "level", ("frame", len(self.profile.places))))

    @property
    def duration(self) -> float:
        """Time that all repeats take together, in s."""
        return len(self.level) * self.repeats / self.rate

    @property
    def peak(self) -> Array:
        """Level of the loudest frame, shape (place,), in dB."""
        return self.level.max(axis=0)

    @property
    def mean(self) -> Array:
        """Level of the mean energy, shape (place,), in dB."""
        return np.asarray(10 * np.log10(np.mean(10 ** (self.level / 10), axis=0)), np.float64)

    @property
    def dose(self) -> Array:
        """Integral of the squared sound pressure over all repeats, shape (place,), in Pa2 s."""
        return np.asarray((20e-6) ** 2 * 10 ** (self.mean / 10) * self.duration, np.float64)

    @property
    def daily(self) -> Array:
        """The level that has the same dose when it lasts for eight hours, shape (place,), in dB."""
        return np.asarray(self.mean + 10 * np.log10(self.duration / 28800), np.float64)

    @property
    def excess(self) -> float:
        """How far the loudest frame is above an enforced limit, in dB; negative when all limits are kept."""
        return max(
            (
                float(peak) - place.limit
                for peak, place in zip(self.peak, self.profile.places, strict=True)
                if place.enforced
            ),
            default=-np.inf,
        )

    @property
    def worst(self) -> tuple[Place, int]:
        """The enforced place that is furthest above its limit, or nearest to it, and its loudest frame.

        Raises
        ------
        InputError
            If the profile enforces nothing.
        """
        margins = [
            (float(self.peak[number]) - place.limit, number)
            for number, place in enumerate(self.profile.places)
            if place.enforced
        ]
        if not margins:
            raise InputError(f"profile {self.profile.name}: expected at least one enforced limit, got none")
        number = max(margins)[1]
        return self.profile.places[number], int(self.level[:, number].argmax())

    @property
    def loudest_air(self) -> Medium:
        """The air in which the worst frame is loudest at the worst place."""
        place, frame = self.worst
        return self.airs[int(self.air[frame, self.profile.places.index(place)])].medium

    @property
    def measured_in(self) -> str:
        """One line: the airs in which it was measured, and the one that was loudest."""
        slow, fast = self.airs[0].medium, self.airs[-1].medium
        if len(self.airs) == 1:
            return str(slow)
        return f"{slow.degrees:.0f} to {fast.degrees:.0f} °C in {len(self.airs)} airs; loudest in {self.loudest_air}"

    @property
    def resolution(self) -> str:
        """One line: how far the truth may be from these levels."""
        bounded = [place.name for place in self.profile.places if place.enforced and place.reach > 0]
        rough = [place.name for place in self.profile.places if not place.enforced and place.reach > 0]
        around = "all around; no search for a gap found 0.5 dB above this"
        said = [f"{', '.join(bounded)}: {around}"] if bounded else []
        said += [f"{', '.join(rough)}: at 27 points, between which a focus falls"] if rough else []
        return "; ".join(said)

    def verdict(self) -> str:
        """One line: whether the profile is kept, and where it is closest to its limit."""
        place, frame = self.worst
        number = self.profile.places.index(place)
        where = " ".join(f"{1e3 * each:.0f}" for each in place.position)
        kept = "kept" if self.excess <= 0 else "exceeded"
        return (
            f"{self.profile.name} is {kept}: {self.peak[number]:.1f} dB at the {place.name} ({where} mm) "
            f"in frame {frame} in air of {self.loudest_air.degrees:.0f} °C, limit {place.limit:g} dB"
        )

    def __repr__(self) -> str:
        return f"<Exposure {len(self.level)} frames, {self.repeats} times, {self.verdict()}>"


def exposure(
    drive: Drive,
    profile: ExposureProfile,
    *,
    repeats: int = 1,
    acoustics: Acoustics | tuple[Acoustics, ...] | None = None,
    steps: int | None = None,
) -> Exposure:
    """What a drive exposes people to at the places of a profile.

    Parameters
    ----------
    drive : Drive
        The drive that is to be played.
    profile : ExposureProfile
        Places and limits.
    repeats : int
        How often it is played.
    acoustics : Acoustics or tuple of Acoustics, optional
        As in `propagate`; of several airs the highest counts, frame by frame.
    steps : int, optional
        Of a turn, to which units round phases; they are not rounded if None.

    Returns
    -------
    Exposure
        Of every frame at every place.
    """
    airs = acoustics if isinstance(acoustics, tuple) else (acoustics or drive.acoustics,)
    # Of a long drive this is all that grows with its length.
    level = np.empty((drive.frames, len(profile.places)))
    loudest = np.empty(level.shape, np.int8)
    searches = searches_of(profile.places, drive.array, airs)
    # NumPy lets go of the interpreter, so that threads use all cores; BLAS threads beside them would only wait.
    cores = os.cpu_count() or 1
    with threadpool_limits(limits=1, user_api="blas"), ThreadPoolExecutor(cores) as threads:
        parts = np.arange(0, drive.frames, BLOCK)
        # Each share has arrays of its own; more shares than cores, so that whoever watches sees how far it is.
        shares = np.array_split(parts, max(cores, len(parts) // _SHARE))
        list(passing(threads.map(partial(_fill, (level, loudest), drive, searches, steps), shares), len(shares)))
    # The palm only advises: the first, the middle and the last air do.
    few = airs[:: max(1, len(airs) // 2)]
    return Exposure(
        profile=profile,
        level=level,
        airs=airs,
        air=loudest,
        rate=drive.rate,
        repeats=repeats,
        nonlinearity=max(_nonlinearity(drive, profile, air, level) for air in few),
        pressure=max(_pressure(drive, profile, air) for air in few),
    )


def greatest_exposure(
    array: TransducerArray, level: float, profile: ExposureProfile, *, rate: float, airs: tuple[Acoustics, ...]
) -> Exposure:
    """The most that any phases at a level can expose people to: all transducers in step, each where it is loudest.

    Parameters
    ----------
    array : TransducerArray
        What radiates.
    level : float
        Level of every transducer, 0 to 1.
    profile : ExposureProfile
        Places and limits.
    rate : float
        Frames per second, in Hz.
    airs : tuple of Acoustics
        As in `propagate`; the loudest counts.

    Returns
    -------
    Exposure
        Of one frame.
    """
    # Phases matter to none of it, so that the airs between the first and the last do not either.
    ceilings = np.array([[ceiling(place, array, (air,)).sum() for place in profile.places] for air in airs])
    loudest = sound_level(level * ceilings.max(axis=0, keepdims=True))
    palm = np.array(profile.nearest[1].position)
    phase = -np.angle(transfer_matrix(palm[None], array, acoustics=airs[0]))
    focus = Drive(phase=phase, level=np.array([level]), rate=rate, array=array, acoustics=airs[0])
    return Exposure(
        profile=profile,
        level=loudest,
        airs=airs,
        air=ceilings.argmax(axis=0)[None],
        rate=rate,
        repeats=1,
        nonlinearity=_nonlinearity(focus, profile, airs[0], loudest),
        pressure=_pressure(focus, profile, airs[0]),
    )


def sound_level(peak: Array) -> Array:
    """Sound pressure level of an amplitude, in dB re 20 µPa rms: 20 lg(p / sqrt(2) / 20 µPa), not below -40 dB."""
    # The floor stands in for silence, which has no level.
    return np.asarray(20 * np.log10(np.maximum(peak / np.sqrt(2) / 20e-6, 1e-2)), np.float64)


def nonlinearity_index(pressure: Array, path: Array, medium: Medium, frequency: float) -> float:
    """How far a beam is distorted: sigma = 1.2 omega / (rho c^3) integral |p| ds; a shock forms at 1 in a plane wave.

    1.2 is the coefficient of nonlinearity of air (Hamilton & Blackstock, Nonlinear Acoustics, chapter 4).

    Parameters
    ----------
    pressure : ndarray, shape (point,)
        Amplitude along the beam, in Pa.
    path : ndarray, shape (point,)
        Distance along the beam, in m.
    medium : Medium
        Density and speed of sound.
    frequency : float
        In Hz.
    """
    integral = float(np.trapezoid(np.abs(pressure), path))
    return 1.2 * 2 * np.pi * frequency / (medium.density * medium.speed**3) * integral


def _nonlinearity(drive: Drive, profile: ExposureProfile, acoustics: Acoustics, level: Array) -> float:
    """Index of the frame that is strongest at the nearest place, the palm, along the line that leads there."""
    number, palm = profile.nearest
    strongest = int(level[:, number].argmax())
    path, matrix = _beam(palm.position, drive.array, acoustics)
    pressure = np.abs(matrix @ _drive(drive, slice(strongest, strongest + 1))[0])
    return nonlinearity_index(pressure, path, acoustics.medium, drive.array.frequency)


@lru_cache(maxsize=16)
def _beam(
    end: tuple[float, float, float], array: TransducerArray, acoustics: Acoustics
) -> tuple[Array, NDArray[np.complex128]]:
    """Distances along the line from the centre of the array to a place, and the transfer matrix there."""
    # Not from 0: a point on a transducer has no finite field.
    share = np.linspace(0.02, 1, 200)
    matrix = transfer_matrix(share[:, None] * np.array(end), array, acoustics=acoustics)
    return share * float(np.linalg.norm(end)), matrix


def _pressure(drive: Drive, profile: ExposureProfile, acoustics: Acoustics) -> float:
    """Highest radiation pressure on the nearest place's level, at points 5 mm apart over 6 cm, in Pa."""
    some = np.unique(np.linspace(0, drive.frames - 1, 256).astype(int))
    space = Workspace()
    parts, strength = drive_parts(drive, some, space)
    loudest = _palm(profile.nearest[1].position, drive.array, acoustics).loudest(parts, space)[0, :, 0]
    # A strength of their own is in the parts of transducers already.
    loudest = loudest * strength[:, 0] if strength.shape[1] == 1 else loudest
    return float(radiation_pressure(loudest.max(initial=0.0), acoustics.medium))


@lru_cache(maxsize=16)
def _palm(middle: tuple[float, float, float], array: TransducerArray, acoustics: Acoustics) -> Searches:
    """The search of a square on the level of a place."""
    steps = np.arange(-30e-3, 31e-3, 5e-3)
    x, y = np.meshgrid(steps, steps)
    points = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1) + np.array(middle)
    return Searches.of(point_search(points, array, (acoustics,)))


def _fill(
    told: tuple[Array, NDArray[np.int8]], drive: Drive, searches: Searches, steps: int | None, blocks: NDArray[np.intp]
) -> None:
    """Fill in the level of the frames of some blocks at each place, in dB, and which air is loudest."""
    level, loudest = told
    space = Workspace()
    alone = np.stack([each.ceiling for each in searches.each], axis=1)
    left_out = np.array([each.left_out for each in searches.each])
    # Small parts stay in the cache, and a whole drive at all points would not fit into memory.
    for first in blocks:
        frames = slice(first, first + BLOCK)
        parts, strength = drive_parts(drive, frames, space, searches.order, steps=steps)
        most = strength * alone.sum(axis=0) if strength.shape[1] == 1 else strength @ alone
        found = searches.loudest(parts, space)
        # A strength that all transducers share is put on at the end, where there is one number a frame.
        found = (
            strength * (found + left_out)
            if strength.shape[1] == 1
            else found + strength.max(axis=1, keepdims=True) * left_out
        )
        level[frames] = sound_level(np.minimum(found.max(axis=0), most))
        loudest[frames] = found.argmax(axis=0)


def _drive(drive: Drive, frames: slice) -> NDArray[np.complex128]:
    phase = np.asarray(drive.phase[frames])
    level = np.asarray(drive.level[frames]).reshape(len(phase), -1)
    return np.asarray(level * np.exp(1j * phase), np.complex128)
