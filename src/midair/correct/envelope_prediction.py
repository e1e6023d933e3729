"""Predict the pressure over time of a measured array, and correct the phases before anything is played.

A solver assumes a steady state in each frame, and precompensation of hold and transducers uses their mean. With the
measured strength, phase and pole of each transducer, the pressure at the end of frame t is

    q_t = e q_(t-1) + (1 - e) s c_t,  P_t = f w |G q_t|^2,  e = exp(p / R),

with c the drive, s and p measured, f the radiation pressure of 1 Pa of sound, w the weights of places all over the
square, R the frame rate. The target P' is the pressure of the target by the same law if the field kept its phases. No
frame can reach the target at so many places; but only the error in the band is felt, which several frames share, and

    (|| F (P - P') ||^2 + slow || P - P' ||^2) / 2,  F a low-pass,

becomes small with very small phase changes. It is minimised in blocks of frames, one after another, with the last
frames before a block fixed and the first ones after it as they were solved.
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
from midair.model import AmplitudeFrames, Drive, Provenance, Solution
from midair.physics import SensorModel, TransducerDynamics, Transducers, cell_weights, radiation_pressure
from midair.streaming import read_frames
from midair.validation import positive

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Waves = NDArray[np.complex64]


@dataclass(frozen=True, slots=True, kw_only=True)
class EnvelopePrediction:
    """Settings of the prediction and correction."""

    transducers: Transducers
    """The measured transducers."""
    dynamics: TransducerDynamics
    """The dynamics that precompensation assumed."""
    places: SensorModel
    """Cells whose pressure is to match the target."""
    linear: Literal["sound", "pressure"] = "sound"
    """The quantity that precompensation treated as linear in the drive."""
    highest: float = 600.0
    """Frequency at which the low-pass is one half, in Hz."""
    slow: float = 0.05
    """Weight of the error outside the low-pass."""
    even: float = 0.03
    """Pressure of a frame, relative to the loudest of its block, up to which fainter frames make larger steps."""
    iterations: int = 8
    """Steps of the descent."""
    memory: int = 6
    """Pairs that the descent keeps."""
    block: int = 512
    """Frames of a block."""
    around: int = 12
    """Frames of its surroundings on either side."""

    def __post_init__(self) -> None:
        for name, unit in (("highest", "Hz"), ("slow", ""), ("even", "")):
            positive(getattr(self, name), f"{name} of the envelope prediction", unit)
        if min(self.iterations, self.memory, self.block, self.around) < 1:
            raise InputError(
                "envelope prediction: expected 1 or more for iterations, memory, block and around, got "
                f"{self.iterations}, {self.memory}, {self.block} and {self.around}"
            )

    def corrected(self, parts: Iterator[Solution], target: AmplitudeFrames) -> Iterator[Solution]:
        """Yield solutions of the same frames, block by block, with corrected phases.

        The errors stay those of the solver, which are of steady states. `target` may have lazy frames; they are read
        once.
        """
        pending, done = None, 0
        for part in chain(parts, [None]):
            if part is not None:
                amplitude = read_frames(target.amplitude, done, done + part.drive.frames)
                pending = _PendingFrames.of(self, part, target) if pending is None else pending.followed_by(part)
                pending = pending.with_target(amplitude)
                done += part.drive.frames
            while pending is not None and (count := self._next(pending.open, last=part is None)):
                corrected, pending = pending.corrected(count)
                yield replace(corrected, drive=replace(corrected.drive, provenance=self._noted(corrected.drive)))

    def _next(self, count: int, *, last: bool) -> int:
        """Number of frames of the next block; 0 while there are too few."""
        return self.block if count >= self.block + self.around else count * last

    def _noted(self, drive: Drive) -> Provenance:
        return drive.provenance.then(
            "foresee the array", {"highest_hz": self.highest, "slow": self.slow, "iterations": self.iterations}
        )

    def metric(self, part: slice, frames: int, rate: float) -> Single:
        """The matrix (F^T F + slow), (frame, frame), for frames of which `part` is the block."""
        from scipy.signal import firwin

        reach = self.around // 3
        short = 2 * self.highest < 0.9 * rate
        taps = firwin(2 * reach + 1, self.highest, fs=rate, window="hann") if short else np.ones(1)
        passed = np.zeros((frames, frames))
        for by, tap in enumerate(taps, -(len(taps) // 2)):
            passed += tap * np.eye(frames, k=by)
        # Further away from the block the neighbours of frames are unknown.
        counts, own = np.zeros((frames, 1)), np.zeros(frames)
        counts[max(0, part.start - reach) : part.stop + reach] = 1
        own[part] = self.slow
        return np.asarray(passed.T @ (counts * passed) + np.diag(own), np.float32)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _PendingFrames:
    """Frames to be corrected, preceded by the last corrected ones."""

    settings: EnvelopePrediction
    tracking: EnvelopeTracking
    target_weights: Array  # Weights from the target's pressure to each place, shape (place, point)
    solution: Solution
    wanted: Single  # Target pressure at the ends of frames in Pa, shape (frame, place)
    sound: NDArray[np.complex128]  # Envelope of the target's sound, or pressure, shape (point,)
    start: Waves  # Output of the transducers before the first frame, shape (transducer,)
    kept: int = 0  # Number of frames that are already corrected

    @classmethod
    def of(cls, settings: EnvelopePrediction, first: Solution, target: AmplitudeFrames) -> "_PendingFrames":
        """Start from silence."""
        grid, places = target.grid, settings.places
        target_weights = cell_weights(places, grid, centre=grid.centre, between="lines")
        weights = cell_weights(places, grid, centre=grid.centre, between="waves")
        return cls(
            settings=settings,
            tracking=EnvelopeTracking.of(first.drive, settings.transducers, grid, weights),
            target_weights=target_weights,
            solution=first,
            wanted=np.zeros((0, len(target_weights)), np.float32),
            sound=np.zeros(grid.count, complex),
            start=np.zeros(first.drive.array.count, np.complex64),
        )

    @property
    def open(self) -> int:
        """Number of frames to be corrected."""
        return self.solution.drive.frames - self.kept

    def followed_by(self, part: Solution) -> "_PendingFrames":
        """Append frames."""
        return replace(self, solution=Solution.joined([self.solution, part]))

    def with_target(self, amplitude: Array) -> "_PendingFrames":
        """Append the target pressure of the next frames."""
        drive, dynamics = self.solution.drive, self.settings.dynamics
        e = np.exp(complex(-1 / dynamics.time_constant, dynamics.detuning) / drive.rate)
        squared = self.settings.linear == "pressure"
        now, sound = self.sound, np.empty_like(amplitude)
        for frame, asked in enumerate(amplitude**2 if squared else amplitude):
            now = asked + (now - asked) * e
            # For sound of constant phase the component in phase with the drive counts (`physics.playback_response`).
            sound[frame] = np.maximum(now.real, 0)
        sound = np.sqrt(sound) if squared else sound
        pressed = radiation_pressure(sound, drive.acoustics.medium) @ self.target_weights.T
        return replace(self, wanted=np.concatenate([self.wanted, pressed.astype(np.float32)]), sound=now)

    def corrected(self, count: int) -> "tuple[Solution, _PendingFrames]":
        """The next `count` frames, corrected, and the rest."""
        drive, end = self.solution.drive, self.kept + count
        phase = np.array(drive.phase)
        phase[self.kept : end] = self._phases(slice(self.kept, end))
        corrected = replace(self.solution, drive=replace(drive, phase=np.mod(phase, 2 * np.pi)))
        # Earlier frames matter only as long as the responses of the low-pass and the transducers last.
        gone = max(0, end - self.settings.around)
        start = self.tracking.radiated(_command(corrected.cut(0, gone).drive), self.start)[-1] if gone else self.start
        left = corrected.cut(gone, drive.frames)
        rest = replace(self, solution=left, wanted=self.wanted[gone:], start=start, kept=end - gone)
        return corrected.cut(self.kept, end), rest

    def _phases(self, part: slice) -> Array:
        """Corrected phases of the frames of a block."""
        frames = min(part.stop + self.settings.around, self.solution.drive.frames)
        solution, wanted = self.solution.cut(0, frames), self.wanted[:frames]
        metric, command = self.settings.metric(part, frames, solution.drive.rate), _command(solution.drive)
        turned = command.copy()

        def cost(turn: Single) -> tuple[float, Single]:
            turned[part] = command[part] * np.exp(1j * turn).astype(np.complex64)
            missed, slope = self.tracking.cost(turned, self.start, wanted, metric)
            return missed, slope[part]

        loud = wanted[part].sum(axis=1, keepdims=True)
        scale = 1 / (loud / max(float(loud.max()), 1e-30) + np.float32(self.settings.even))
        turn = descend(
            cost,
            np.zeros(command[part].shape, np.float32),
            scale=np.asarray(scale, np.float32),
            first=1e-3,
            iterations=self.settings.iterations,
            memory=self.settings.memory,
        )
        return np.asarray(solution.drive.phase)[part] + turn


def _command(drive: Drive) -> Waves:
    level = np.asarray(drive.level).reshape(drive.frames, -1)
    return np.asarray(level * np.exp(1j * np.asarray(drive.phase)), np.complex64)
