"""Output of the transducers at every moment while an array plays frames.

Phases are rounded and held for a frame, or moved to the next one along ramps like AUTD3's silencer, and each transducer
follows with its own envelope. Each effect can be switched off, so that its share of the error can be measured.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array, Complex
from midair.errors import InputError
from midair.model import Drive
from midair.physics.propagation import quantise_phase
from midair.physics.transducers import Transducers
from midair.streaming import read_frames

Waves = NDArray[np.complexfloating[Any, Any]]
Hold = Literal["step", "ideal"]
Precision = Literal["single", "double"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlaybackChain:
    """Effects between a drive and its sound."""

    phase_bits: int | None = 8
    """Phases are rounded to 2 pi / 2^bits; None for no rounding."""
    hold: Hold = "step"
    """"step": each frame is held until the next. "ideal": band-limited interpolation, without ramps and transducers."""
    phase_ramp: float = 0.0
    """Time in s over which a silencer spreads a step of phase; 0 for none."""
    level_ramp: float = 0.0
    """Time in s over which a silencer spreads a step of level; 0 for none."""
    transducers: Transducers | None = None
    """Envelope and strength of each transducer; None for ideal transducers."""
    precision: Precision = "single"
    """Precision of the field. "single" is accurate to 1e-5 of the largest pressure, and twice as fast."""

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
            raise InputError("hold: expected step with ramps or transducers, got ideal")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TransducerState:
    """State of the transducers between two frames, each shape (transducer,)."""

    phase: Array | None
    level: Array
    q: Complex

    @classmethod
    def silent(cls, count: int) -> "TransducerState":
        """The state before playing; the first phases are reached without a ramp."""
        return cls(phase=None, level=np.zeros(count), q=np.zeros(count, complex))


def radiate(
    drive: Drive, chain: PlaybackChain, steps: int, *, start: TransducerState | None = None, together: int = 1024
) -> Iterator[tuple[Waves, TransducerState]]:
    """Yield the output of each transducer, some frames at a time.

    The envelope is exact for a drive that changes linearly within each step: without ramps it is exact everywhere; with
    ramps of r rad per step the chord of the drive deviates by r^2 / 8 from its arc.

    The chain is one with hold "step". There are `steps` moments per frame, the last one at its end, and about
    `together` per block; before the first frame the state is `start`, silent if None. Each output, complex, shape
    (frames * steps, transducer), is a fraction of full drive, and comes with the state after it.
    """
    exact = np.complex64 if chain.precision == "single" else np.complex128
    moment, block = start or TransducerState.silent(drive.array.count), max(1, together // steps)
    response = _EnvelopeStep.of(chain.transducers, 1 / (drive.rate * steps), drive.array.count)
    for first in range(0, drive.frames, block):
        last = min(first + block, drive.frames)
        phase = read_frames(drive.phase, first, last)
        phase = phase if chain.phase_bits is None else quantise_phase(phase, bits=chain.phase_bits)
        level = np.broadcast_to(read_frames(drive.level, first, last).reshape(len(phase), -1), phase.shape)
        nodes, phase_now, level_now = _command(phase, level, chain, drive.rate, steps, moment, exact)
        q = response.follow(nodes, moment.q)
        moment = TransducerState(phase=phase_now, level=level_now, q=np.asarray(q[-1], np.complex128))
        yield q, moment


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _EnvelopeStep:
    """q after a step = e q + a c0 + b c1, exact while the drive changes linearly from c0 to c1; each (transducer,).

    With r = 1 / (p dt): e = exp(p dt), a = r (e - 1) - e, b = 1 - r (e - 1), times the steady state of the transducer.
    """

    e: Complex
    a: Complex
    b: Complex

    @classmethod
    def of(cls, transducers: Transducers | None, step: float, count: int) -> "_EnvelopeStep":
        if transducers is None:
            nothing = np.zeros(count, complex)
            # Without an envelope the output equals the drive at the end of the step.
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
            # In place and sequential, since each moment starts from the previous one.
            for now in force:
                now += e * q
                q = now
        return force


def _command(
    phase: Array, level: Array, chain: PlaybackChain, rate: float, steps: int, moment: TransducerState, exact: type
) -> tuple[Waves, Array, Array]:
    """Drive at the beginning, between the steps and at the end of each frame, (frame, step + 1, transducer).

    Also returns phase and level at the end.
    """
    if not chain.phase_ramp and not chain.level_ramp:
        command = np.asarray(level * np.exp(1j * phase), exact)
        return np.broadcast_to(command[:, None], (len(command), steps + 1, command.shape[1])), phase[-1], level[-1]
    nodes = np.empty((len(phase), steps + 1, phase.shape[1]), exact)
    time = np.arange(steps + 1) / (rate * steps)
    turned, raised = _ramp(time, chain.phase_ramp), _ramp(time, chain.level_ramp)
    # A silent array has no previous phase.
    now, loud = (phase[0] if moment.phase is None else moment.phase), moment.level
    for frame, (to, louder) in enumerate(zip(phase, level, strict=True)):
        # The silencer takes the shorter way round the circle.
        short = np.mod(to - now + np.pi, 2 * np.pi) - np.pi
        turning, raising = now + turned * short, loud + raised * (louder - loud)
        nodes[frame] = raising * np.exp(1j * turning)
        now, loud = turning[-1], raising[-1]
    return nodes, now, loud


def _ramp(time: Array, length: float) -> Array:
    """Completed fraction of a step, shape (step + 1, 1)."""
    done = np.ones(len(time)) if length == 0 else np.minimum(time / length, 1.0)
    return done[:, None]
