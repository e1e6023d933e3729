"""What the transducers radiate, moment by moment, while an array plays frames.

Phases are rounded and held for a frame, or moved to the next one along ramps, as AUTD3's silencer does; and each
transducer follows with its own envelope. Every part can be left out, so that its share of the loss can be told.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.lazy_frames import read_frames
from midair.model import Drive
from midair.physics.propagation import quantise_phase
from midair.physics.transducers import Transducers

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Waves = NDArray[np.complexfloating[Any, Any]]
Hold = Literal["step", "ideal"]
Precision = Literal["single", "double"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlaybackChain:
    """What stands between a drive and its sound.

    Attributes
    ----------
    phase_bits : int or None
        Phases are rounded to 2 pi / 2^bits; None leaves them as they are.
    hold : {"step", "ideal"}
        "step": each frame stands until the next. "ideal": the pressure moves from frame to frame as a band-limited
        signal, as if there were no time between frames; then there can be no ramps and no transducers that follow.
    phase_ramp, level_ramp : float
        Over how long a silencer spreads a step of phase or level, in s; 0 for at once.
    transducers : Transducers or None
        Each one's envelope and strength; None for such that follow at once and are as strong as the model says.
    precision : {"single", "double"}
        Precision of the field. Single is true to 1e-5 of the largest pressure, and twice as fast.
    """

    phase_bits: int | None = 8
    hold: Hold = "step"
    phase_ramp: float = 0.0
    level_ramp: float = 0.0
    transducers: Transducers | None = None
    precision: Precision = "single"

    def __post_init__(self) -> None:
        if self.hold not in get_args(Hold) or self.precision not in get_args(Precision):
            raise InputError(
                f"chain: expected hold step or ideal and precision single or double, got {self.hold!r} and "
                f"{self.precision!r}"
            )
        if self.phase_bits is not None and not 1 <= self.phase_bits <= 16:
            raise InputError(f"phase bits: expected 1 to 16, or None for no rounding, got {self.phase_bits}")
        if not all(0 <= ramp < np.inf for ramp in (self.phase_ramp, self.level_ramp)):
            raise InputError(f"ramps: expected 0 s or more, got {self.phase_ramp:g} and {self.level_ramp:g} s")
        if self.hold == "ideal" and (self.phase_ramp or self.level_ramp or self.transducers is not None):
            raise InputError("hold: expected no ramps and no transducers with an ideal hold; choose step to have them")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Moment:
    """Where the transducers are between two frames, each shape (transducer,)."""

    phase: Array | None
    level: Array
    q: Complex

    @classmethod
    def silent(cls, count: int) -> "Moment":
        """Nothing sounds, and the first phases will be there at once."""
        return cls(phase=None, level=np.zeros(count), q=np.zeros(count, complex))


def radiate(
    drive: Drive, chain: PlaybackChain, steps: int, *, start: Moment | None = None, together: int = 1024
) -> Iterator[tuple[Waves, Moment]]:
    """What each transducer radiates, some frames at a time.

    The envelope is exact for a drive that changes linearly within each step: without ramps it is exact everywhere; with
    ramps of r rad a step the drive's chord is (r^2 / 8) away from its arc.

    Parameters
    ----------
    drive : Drive
        What the array is told.
    chain : PlaybackChain
        With steps that are held.
    steps : int
        Moments a frame; the last one is at the frame's end.
    start : Moment, optional
        Where the transducers are before the first frame; silent if None.
    together : int
        About how many moments at once.

    Yields
    ------
    q : ndarray of complex, shape (frames * steps, transducer)
        What they radiate, as a part of full drive.
    moment : Moment
        After them.
    """
    exact = np.complex64 if chain.precision == "single" else np.complex128
    moment, block = start or Moment.silent(drive.array.count), max(1, together // steps)
    pull = _Pull.of(chain.transducers, 1 / (drive.rate * steps), drive.array.count)
    for first in range(0, drive.frames, block):
        last = min(first + block, drive.frames)
        phase = read_frames(drive.phase, first, last)
        phase = phase if chain.phase_bits is None else quantise_phase(phase, bits=chain.phase_bits)
        level = np.broadcast_to(read_frames(drive.level, first, last).reshape(len(phase), -1), phase.shape)
        nodes, phase_now, level_now = _command(phase, level, chain, drive.rate, steps, moment, exact)
        q = pull.follow(nodes, moment.q)
        moment = Moment(phase=phase_now, level=level_now, q=np.asarray(q[-1], np.complex128))
        yield q, moment


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Pull:
    """q after a step = e q + a c0 + b c1, exact while the drive goes straight from c0 to c1; each (transducer,).

    With r = 1 / (p dt): e = exp(p dt), a = r (e - 1) - e, b = 1 - r (e - 1), times what the transducer settles at.
    """

    e: Complex
    a: Complex
    b: Complex

    @classmethod
    def of(cls, transducers: Transducers | None, step: float, count: int) -> "_Pull":
        if transducers is None:
            nothing = np.zeros(count, complex)
            # Without an envelope a transducer is where its drive is at the end of the step.
            return cls(e=nothing, a=nothing, b=np.ones(count, complex))
        e = np.exp(transducers.pole * step)
        moved = (e - 1) / (transducers.pole * step)
        return cls(e=e, a=transducers.response * (moved - e), b=transducers.response * (1 - moved))

    def follow(self, nodes: Waves, start: Complex) -> Waves:
        """The q at the end of each step, (frame * step, transducer), for a drive of (frame, step + 1, transducer)."""
        kind = nodes.dtype
        e, q = self.e.astype(kind), start.astype(kind)
        force = nodes[:, :-1] * self.a.astype(kind) + nodes[:, 1:] * self.b.astype(kind)
        force = force.reshape(-1, nodes.shape[2])
        if e.any():
            # In place and in turn, since each moment starts where the one before it ended.
            for now in force:
                now += e * q
                q = now
        return force


def _command(
    phase: Array, level: Array, chain: PlaybackChain, rate: float, steps: int, moment: Moment, exact: type
) -> tuple[Waves, Array, Array]:
    """What the transducers are told at the beginning, between the steps, and at the end of each frame.

    Returns (frame, step + 1, transducer), and phase and level at the end.
    """
    if not chain.phase_ramp and not chain.level_ramp:
        told = np.asarray(level * np.exp(1j * phase), exact)
        return np.broadcast_to(told[:, None], (len(told), steps + 1, told.shape[1])), phase[-1], level[-1]
    nodes = np.empty((len(phase), steps + 1, phase.shape[1]), exact)
    time = np.arange(steps + 1) / (rate * steps)
    turned, raised = _ramp(time, chain.phase_ramp), _ramp(time, chain.level_ramp)
    # An array that was silent has no phase to turn from.
    now, loud = (phase[0] if moment.phase is None else moment.phase), moment.level
    for frame, (to, louder) in enumerate(zip(phase, level, strict=True)):
        # The silencer turns the short way round the circle.
        short = np.mod(to - now + np.pi, 2 * np.pi) - np.pi
        turning, raising = now + turned * short, loud + raised * (louder - loud)
        nodes[frame] = raising * np.exp(1j * turning)
        now, loud = turning[-1], raising[-1]
    return nodes, now, loud


def _ramp(time: Array, length: float) -> Array:
    """Part of a step that is done, shape (step + 1, 1)."""
    done = np.ones(len(time)) if length == 0 else np.minimum(time / length, 1.0)
    return done[:, None]
