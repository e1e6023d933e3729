"""Predict the pressure over time of an array, and correct the phases before anything is played.

A solver assumes a steady state in each frame, and precompensation of hold and transducers uses their mean. With the
measured strength, phase and pole of each transducer, the pressure at the end of frame t is

    q_t = e q_(t-1) + (1 - e) s c_t,  P_t = f w |G q_t|^2,  e = exp(p / R),

with c the drive, s and p measured, f the radiation pressure of 1 Pa of sound, w the weights of places all over the
square, R the frame rate. The target P' is the pressure of the target by the same law if the field kept its phases. No
frame can reach the target at so many places; but only the error in the band is felt, which several frames share, and

    (|| F (P - P') ||^2 + slow || P - P' ||^2) / 2,  F a low-pass,

becomes small with very small phase changes. At points beside the square that are to stay silent, P' is 0. The cost is
minimised in blocks of frames, one after another, with the last frames before a block fixed and the first ones after it
as they were solved.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import Any, Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from midair.array_types import Array, Complex, Single
from midair.model import AmplitudeFrames, Drive, Setting, Solution
from midair.physics import (
    SensorModel,
    TransducerDynamics,
    Transducers,
    cell_weights,
    middle_of,
    palm_matrix,
    radiation_pressure,
)
from midair.solvers import LBFGS
from midair.streaming import read_frames

Waves = NDArray[np.complex64]

HIGHEST = 600.0
"""Frequency at which the low-pass is one half, in Hz."""

SLOW = 0.05
"""Weight of the error outside the low-pass."""

EVEN = 0.03
"""Pressure of a frame, relative to the loudest of its block, up to which fainter frames make larger steps."""

AROUND = 12
"""Frames of the surroundings of a block on either side."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EnvelopeTracking:
    """Map from phases to the pressure at the end of each frame, in single precision."""

    G: Waves  # Field of each transducer at full drive in Pa, shape (transducer, point)
    back: Waves  # Conjugate transpose of the field, shape (point, transducer)
    weights: Single  # Radiation pressure at each place of 1 Pa of sound at each point, in Pa, shape (point, place)
    stays: Waves  # Remainder of a transducer's output after one frame, shape (transducer,)
    comes: Waves  # Output after one frame of a drive of 1, shape (transducer,)

    @classmethod
    def of(
        cls, drive: Drive, transducers: Transducers, points: Array, weights: Array, middle: Array
    ) -> "EnvelopeTracking":
        """Make it for a drive's array and air, these transducers, and weights (place, point) of places at points.

        An echo is that of a palm in the `middle` (3,).
        """
        how: Any = {"reflection": drive.array.reflection, "middle": middle, "acoustics": drive.acoustics}
        G = palm_matrix(points, drive.array.nominal, **how)
        unit = float(radiation_pressure(np.ones(1), drive.acoustics.medium)[0])
        stays = np.exp(transducers.pole / drive.rate)
        return cls(
            G=np.ascontiguousarray(G.T, np.complex64),
            back=np.ascontiguousarray(G.conj(), np.complex64),
            weights=np.ascontiguousarray(unit * weights.T, np.float32),
            stays=stays.astype(np.complex64),
            comes=((1 - stays) * transducers.response).astype(np.complex64),
        )

    def radiated(self, command: Waves, start: Waves) -> Waves:
        """Output of each transducer at the end of each frame, (frame, transducer); `start` before the first."""
        q, now = self.comes * command, start
        for frame in q:
            frame += self.stays * now
            now = frame
        return q

    def cost(self, command: Waves, start: Waves, wanted: Single, metric: Single) -> tuple[float, Single]:
        """The cost ``sum((P - P') * metric (P - P')) / 2``, and its gradient by the phases, (frame, transducer).

        `command` (frame, transducer) is c as a fraction of full drive; `start` (transducer,) the output before the
        first frame; `wanted` (frame, place) P' in Pa; `metric` (frame, frame) the symmetric weights.
        """
        y = self.radiated(command, start) @ self.G
        missed = (y.real**2 + y.imag**2) @ self.weights - wanted
        felt = metric @ missed
        # Backward in time, with the slope of the cost by the output in each frame.
        slope: Any = ((2 * (felt @ self.weights.T)) * y) @ self.back
        later, stays = np.zeros_like(start), self.stays.conj()
        for frame in slope[::-1]:
            frame += stays * later
            later = frame
        slope *= self.comes.conj()
        turned = slope.imag * command.real - slope.real * command.imag
        return 0.5 * float(np.vdot(missed.astype(np.float64), felt)), turned


@dataclass(frozen=True, slots=True, kw_only=True)
class EnvelopePrediction:
    """Settings of the prediction and correction."""

    transducers: Transducers
    """The transducers, as measured or as the settings assume them."""
    dynamics: TransducerDynamics
    """The dynamics that precompensation assumed."""
    places: SensorModel
    """Cells whose pressure is to match the target."""
    silent: Array = field(default_factory=lambda: np.empty((0, 3)))
    """Points whose pressure is to stay 0, shape (point, 3), in m."""
    linear: Literal["sound", "pressure"] = "sound"
    """The quantity that precompensation treated as linear in the drive."""
    iterations: int = 8
    """Steps of the descent."""
    block: int = 512
    """Frames of a block."""

    def corrected(self, parts: Iterator[Solution], target: AmplitudeFrames) -> Iterator[Solution]:
        """Yield solutions of the same frames, block by block, with corrected phases.

        The errors stay those of the solver, which are of steady states. `target` may have lazy frames; they are read
        once.
        """
        pending, done = None, 0
        settings: dict[str, Setting] = {"highest_hz": HIGHEST, "slow": SLOW, "iterations": self.iterations}
        for part in chain(parts, [None]):
            if part is not None:
                amplitude = read_frames(target.amplitude, done, done + part.drive.frames)
                if pending is None:
                    pending = _PendingFrames.of(self, part, target)
                else:
                    pending = replace(pending, solution=Solution.joined([pending.solution, part]))
                pending = pending.with_target(amplitude)
                done += part.drive.frames
            while pending is not None and (count := self._next(pending.open, last=part is None)):
                corrected, pending = pending.corrected(count)
                noted = corrected.drive.provenance.then("foresee the array", settings)
                yield replace(corrected, drive=replace(corrected.drive, provenance=noted))

    def _next(self, count: int, *, last: bool) -> int:
        """Number of frames of the next block; 0 while there are too few."""
        return self.block if count >= self.block + AROUND else count * last

    def metric(self, part: slice, frames: int, rate: float) -> Single:
        """The matrix (F^T F + slow), (frame, frame), for frames of which `part` is the block."""
        reach = AROUND // 3
        short = 0.9 * rate > 2 * HIGHEST
        taps = scipy.signal.firwin(2 * reach + 1, HIGHEST, fs=rate, window="hann") if short else np.ones(1)
        passed = np.zeros((frames, frames))
        for by, tap in enumerate(taps, -(len(taps) // 2)):
            passed += tap * np.eye(frames, k=by)
        # Further away from the block the neighbours of frames are unknown.
        counts, own = np.zeros((frames, 1)), np.zeros(frames)
        counts[max(0, part.start - reach) : part.stop + reach] = 1
        own[part] = SLOW
        return np.asarray(passed.T @ (counts * passed) + np.diag(own), np.float32)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _PendingFrames:
    """Frames to be corrected, preceded by the last corrected ones."""

    settings: EnvelopePrediction
    tracking: EnvelopeTracking
    target_weights: Array  # Weights from the target's pressure to each place, shape (place, point)
    solution: Solution
    wanted: Single  # Target pressure at the ends of frames in Pa, shape (frame, place)
    sound: Complex  # Envelope of the target's sound, or pressure, shape (point,)
    start: Waves  # Output of the transducers before the first frame, shape (transducer,)
    kept: int = 0  # Number of frames that are already corrected

    @classmethod
    def of(cls, settings: EnvelopePrediction, first: Solution, target: AmplitudeFrames) -> "_PendingFrames":
        """Start from silence."""
        grid, places = target.grid, settings.places
        target_weights = cell_weights(places, grid, centre=grid.centre, between="lines")
        on_grid = cell_weights(places, grid, centre=grid.centre, between="waves")
        weights = scipy.linalg.block_diag(on_grid, np.eye(len(settings.silent)))
        points = np.concatenate([grid.position, settings.silent])
        return cls(
            settings=settings,
            tracking=EnvelopeTracking.of(first.drive, settings.transducers, points, weights, middle_of(grid)),
            target_weights=target_weights,
            solution=first,
            wanted=np.zeros((0, len(weights)), np.float32),
            sound=np.zeros(grid.count, complex),
            start=np.zeros(first.drive.array.count, np.complex64),
        )

    @property
    def open(self) -> int:
        """Number of frames to be corrected."""
        return self.solution.drive.frames - self.kept

    def with_target(self, amplitude: Array) -> "_PendingFrames":
        """Append the target pressure of the next frames."""
        drive, dynamics = self.solution.drive, self.settings.dynamics
        e = np.exp(dynamics.pole / drive.rate)
        squared = self.settings.linear == "pressure"
        now, sound = self.sound, np.empty_like(amplitude)
        for frame, asked in enumerate(amplitude**2 if squared else amplitude):
            now = asked + (now - asked) * e
            # For sound of constant phase the component in phase with the drive counts (`physics.playback_response`).
            sound[frame] = np.maximum(now.real, 0)
        sound = np.sqrt(sound) if squared else sound
        pressed = radiation_pressure(sound, drive.acoustics.medium) @ self.target_weights.T
        wanted = np.pad(pressed.astype(np.float32), ((0, 0), (0, len(self.settings.silent))))
        return replace(self, wanted=np.concatenate([self.wanted, wanted]), sound=now)

    def corrected(self, count: int) -> "tuple[Solution, _PendingFrames]":
        """The next `count` frames, corrected, and the rest."""
        drive, end = self.solution.drive, self.kept + count
        phase = np.array(drive.phase)
        phase[self.kept : end] = self._phases(slice(self.kept, end))
        corrected = replace(self.solution, drive=replace(drive, phase=np.mod(phase, 2 * np.pi)))
        # Earlier frames matter only as long as the responses of the low-pass and the transducers last.
        gone = max(0, end - AROUND)
        start = self.start
        if gone:
            start = self.tracking.radiated(corrected.cut(0, gone).drive.q.astype(np.complex64), start)[-1]
        left = corrected.cut(gone, drive.frames)
        rest = replace(self, solution=left, wanted=self.wanted[gone:], start=start, kept=end - gone)
        return corrected.cut(self.kept, end), rest

    def _phases(self, part: slice) -> Array:
        frames = min(part.stop + AROUND, self.solution.drive.frames)
        solution, wanted = self.solution.cut(0, frames), self.wanted[:frames]
        metric = self.settings.metric(part, frames, solution.drive.rate)
        command = solution.drive.q.astype(np.complex64)
        turned = command.copy()
        # Phases are in units of the root of their relative inverse curvature, so that fainter frames turn further.
        loud = wanted[part].sum(axis=1, keepdims=True)
        unit = np.sqrt(1 / (loud / max(float(loud.max()), 1e-30) + np.float32(EVEN)))

        def cost(rows: Single) -> tuple[Single, Single]:
            turned[part] = command[part] * np.exp(1j * unit * rows.reshape(-1, command.shape[1])).astype(np.complex64)
            missed, slope = self.tracking.cost(turned, self.start, wanted, metric)
            return np.array([missed], np.float32), (unit * slope[part]).reshape(1, -1)

        descent = LBFGS(memory=6, grow=np.inf)
        state = descent.begin(cost, np.zeros((1, command[part].size), np.float32), np.ones(1, np.float32))
        size = float(np.sqrt(np.mean((unit * state.gradient.reshape(len(unit), -1)) ** 2)))
        if size > 0:
            # The first step turns by a thousandth of a radian (root mean square).
            state.scale = np.array([1e-3 / size], np.float32)
            descent.step(cost, state)
            # Without a positive curvature along it, the full step is tried, and then shorter ones.
            state.scale = np.where(state.pairs[0][2] > 0, state.scale, np.float32(1))
            for _ in range(self.settings.iterations):
                descent.step(cost, state)
        return np.asarray(solution.drive.phase)[part] + unit * state.x.reshape(len(unit), -1)
