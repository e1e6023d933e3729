"""What a measured array will press in time, foreseen and mended before anything is played.

A solver takes each frame as if it stood for ever, and what is made louder beforehand for hold and transducers goes by
their mean. Who knows strength, phase and pole of each transducer knows what will press while they follow:

    q_t = e q_(t-1) + (1 - e) s c_t,  P_t = f w |G q_t|^2,  e = exp(p / R),

at the end of frame t, with c the drive, s and p what was measured, f the radiation pressure of 1 Pa of sound, w the
weights of places all over the square, R the frame rate. P', what the target would press by the same law were the field
to keep its phases, is to be met. No frame can meet so many places; but only what lies in the band is felt, which
several frames share, and

    (|| F (P - P') ||^2 + slow || P - P' ||^2) / 2,  F a low-pass,

becomes small with next to no change of the phases. It is made so in blocks of frames, one after another, the last
frames before a block as they are and the first ones after it as they were solved.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from midair.correct.descent import descend
from midair.correct.envelope_tracking import EnvelopeTracking
from midair.errors import InputError
from midair.lazy_frames import read_frames
from midair.model import AmplitudeFrames, Drive, Provenance, Solution
from midair.physics import SensorModel, TransducerDynamics, Transducers, cell_weights, radiation_pressure
from midair.validation import positive

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Waves = NDArray[np.complex64]


@dataclass(frozen=True, slots=True, kw_only=True)
class EnvelopePrediction:
    """How it is foreseen and mended.

    Attributes
    ----------
    transducers : Transducers
        As they were measured.
    dynamics : TransducerDynamics
        Those that were made up for beforehand.
    places : SensorModel
        Whose cells are to read what they should.
    linear : {"sound", "pressure"}
        What of the target follows its drive: that of which it was made louder beforehand.
    highest : float
        Where the low-pass is half, in Hz.
    slow : float
        Weight of what is not felt.
    even : float
        Pressure of a frame, in parts of the loudest one of its block, up to which fainter ones make larger steps.
    iterations, memory : int
        Steps of the descent, and how many it remembers.
    block, around : int
        Frames of a block, and of its surroundings on either side.
    """

    transducers: Transducers
    dynamics: TransducerDynamics
    places: SensorModel
    linear: Literal["sound", "pressure"] = "sound"
    highest: float = 600.0
    slow: float = 0.05
    even: float = 0.03
    iterations: int = 8
    memory: int = 6
    block: int = 512
    around: int = 12

    def __post_init__(self) -> None:
        for name, unit in (("highest", "Hz"), ("slow", ""), ("even", "")):
            positive(getattr(self, name), f"{name} of the foresight", unit)
        if min(self.iterations, self.memory, self.block, self.around) < 1:
            raise InputError(
                "foresight: expected 1 or more iterations, remembered steps, frames of a block and around it, got "
                f"{self.iterations}, {self.memory}, {self.block} and {self.around}"
            )

    def corrected(self, parts: Iterator[Solution], target: AmplitudeFrames) -> Iterator[Solution]:
        """Solutions of the same frames, block by block, whatever the parts were; only phases differ.

        Errors stay those of the solver, which are of frames that stand for ever. The amplitude of the target may be a
        reel; it is read once.
        """
        stretch, done = None, 0
        for part in chain(parts, [None]):
            if part is not None:
                amplitude = read_frames(target.amplitude, done, done + part.drive.frames)
                stretch = _Stretch.of(self, part, target) if stretch is None else stretch.followed_by(part)
                stretch = stretch.with_target(amplitude)
                done += part.drive.frames
            while stretch is not None and (count := self._next(stretch.open, last=part is None)):
                mended, stretch = stretch.mended(count)
                yield replace(mended, drive=replace(mended.drive, provenance=self._noted(mended.drive)))

    def _next(self, there: int, *, last: bool) -> int:
        """How many frames are the next block; 0 while there are too few."""
        return self.block if there >= self.block + self.around else there * last

    def _noted(self, drive: Drive) -> Provenance:
        return drive.provenance.then(
            "foresee the array", {"highest_hz": self.highest, "slow": self.slow, "iterations": self.iterations}
        )

    def metric(self, part: slice, frames: int, rate: float) -> Single:
        """How differences of so many frames count, of which a part is the block: (F^T F + slow), (frame, frame)."""
        from scipy.signal import firwin

        reach = self.around // 3
        short = 2 * self.highest < 0.9 * rate
        taps = firwin(2 * reach + 1, self.highest, fs=rate, window="hann") if short else np.ones(1)
        passed = np.zeros((frames, frames))
        for by, tap in enumerate(taps, -(len(taps) // 2)):
            passed += tap * np.eye(frames, k=by)
        # Further away from the block there are neighbours that are not known.
        counts, own = np.zeros((frames, 1)), np.zeros(frames)
        counts[max(0, part.start - reach) : part.stop + reach] = 1
        own[part] = self.slow
        return np.asarray(passed.T @ (counts * passed) + np.diag(own), np.float32)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Stretch:
    """Frames that are still to be mended, after the last of those that are.

    Attributes
    ----------
    way : Foresight
        How it is done.
    following : Following
        What the array presses.
    drawn : ndarray, shape (place, point)
        What each place is to read of the target's pressure.
    solution : Solution
        The frames.
    wanted : ndarray, shape (frame, place)
        What is to press at their ends, in Pa.
    sound : ndarray of complex, shape (point,)
        How far the target's sound, or pressure, has followed.
    start : ndarray of complex, shape (transducer,)
        What is radiated before the first frame.
    kept : int
        Frames that are mended.
    """

    way: EnvelopePrediction
    following: EnvelopeTracking
    drawn: Array
    solution: Solution
    wanted: Single
    sound: NDArray[np.complex128]
    start: Waves
    kept: int = 0

    @classmethod
    def of(cls, way: EnvelopePrediction, first: Solution, target: AmplitudeFrames) -> "_Stretch":
        """From silence on."""
        grid, places = target.grid, way.places
        drawn = cell_weights(places, grid, centre=grid.centre, between="lines")
        weights = cell_weights(places, grid, centre=grid.centre, between="waves")
        return cls(
            way=way,
            following=EnvelopeTracking.of(first.drive, way.transducers, grid, weights),
            drawn=drawn,
            solution=first,
            wanted=np.zeros((0, len(drawn)), np.float32),
            sound=np.zeros(grid.count, complex),
            start=np.zeros(first.drive.array.count, np.complex64),
        )

    @property
    def open(self) -> int:
        """Frames that are to be mended."""
        return self.solution.drive.frames - self.kept

    def followed_by(self, part: Solution) -> "_Stretch":
        """With more frames."""
        return replace(self, solution=Solution.joined([self.solution, part]))

    def with_target(self, amplitude: Array) -> "_Stretch":
        """With what is to press of the next frames."""
        drive, dynamics = self.solution.drive, self.way.dynamics
        e = np.exp(complex(-1 / dynamics.time_constant, dynamics.detuning) / drive.rate)
        squared = self.way.linear == "pressure"
        now, sound = self.sound, np.empty_like(amplitude)
        for frame, asked in enumerate(amplitude**2 if squared else amplitude):
            now = asked + (now - asked) * e
            # Of sound that keeps its phase, what is in step with the drive is heard (`physics.playback_response`).
            sound[frame] = np.maximum(now.real, 0)
        sound = np.sqrt(sound) if squared else sound
        pressed = radiation_pressure(sound, drive.acoustics.medium) @ self.drawn.T
        return replace(self, wanted=np.concatenate([self.wanted, pressed.astype(np.float32)]), sound=now)

    def mended(self, count: int) -> "tuple[Solution, _Stretch]":
        """The next so many frames, mended, and what is left."""
        drive, end = self.solution.drive, self.kept + count
        phase = np.array(drive.phase)
        phase[self.kept : end] = self._phases(slice(self.kept, end))
        mended = replace(self.solution, drive=replace(drive, phase=np.mod(phase, 2 * np.pi)))
        # What went by is felt no longer than the low-pass and the transducers remember.
        gone = max(0, end - self.way.around)
        start = self.following.radiated(_told(mended.cut(0, gone).drive), self.start)[-1] if gone else self.start
        left = mended.cut(gone, drive.frames)
        rest = replace(self, solution=left, wanted=self.wanted[gone:], start=start, kept=end - gone)
        return mended.cut(self.kept, end), rest

    def _phases(self, part: slice) -> Array:
        """Of the frames of a block."""
        frames = min(part.stop + self.way.around, self.solution.drive.frames)
        solution, wanted = self.solution.cut(0, frames), self.wanted[:frames]
        metric, told = self.way.metric(part, frames, solution.drive.rate), _told(solution.drive)
        turned = told.copy()

        def cost(turn: Single) -> tuple[float, Single]:
            turned[part] = told[part] * np.exp(1j * turn).astype(np.complex64)
            missed, slope = self.following.missed(turned, self.start, wanted, metric)
            return missed, slope[part]

        loud = wanted[part].sum(axis=1, keepdims=True)
        scale = 1 / (loud / max(float(loud.max()), 1e-30) + np.float32(self.way.even))
        turn = descend(
            cost,
            np.zeros(told[part].shape, np.float32),
            scale=np.asarray(scale, np.float32),
            first=1e-3,
            iterations=self.way.iterations,
            memory=self.way.memory,
        )
        return np.asarray(solution.drive.phase)[part] + turn


def _told(drive: Drive) -> Waves:
    level = np.asarray(drive.level).reshape(drive.frames, -1)
    return np.asarray(level * np.exp(1j * np.asarray(drive.phase)), np.complex64)
