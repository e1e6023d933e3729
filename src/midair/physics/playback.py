"""Radiation pressure at every moment while an array plays frames: the square of p = G q.

Transducers differ in resonance, quality factor and strength; their envelope follows a change of the drive. Near
resonance a transducer follows dq/dt = p (q - s c), with c the drive, p = -1/tau + j dw its pole and s c its steady
state (see `TransducerDynamics`). In its manufacturer's circuit, inductance L and resistance R in series, tau = 2 L / R,
and the driving force does not depend on R. So a transducer of pole p has the steady state s = p0 / p relative to a
nominal one of pole p0 and strength 1: another resonance means another amplitude and phase.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array, Complex
from midair.dsp import resample
from midair.errors import InputError, RateError, ShapeError
from midair.model import Acoustics, ArrayCalibration, Drive, Medium
from midair.physics.propagation import Precision, quantise_phase, radiation_pressure
from midair.streaming import read_frames
from midair.validation import frozen_array, one_of, positive, within


@dataclass(frozen=True, slots=True, kw_only=True)
class TransducerDynamics:
    """Envelope of one transducer after a change of its drive, as that of a resonant circuit.

    Near resonance the Butterworth-Van Dyke circuit of the T4010A1 (39.80 kHz, Q about 23.5) responds to a change of the
    complex drive with one exponential: q(t + dt) = c + (q(t) - c) exp((-1/tau + j dw) dt), with c the drive, tau the
    time constant and dw the detuning between drive and resonance.
    """

    time_constant: float = 188e-6
    """tau in s; 2 Q / omega_0."""
    detuning: float = 2 * np.pi * 205
    """dw, resonance minus drive frequency, in rad/s."""

    def __post_init__(self) -> None:
        positive(self.time_constant, "time constant", "s")

    @property
    def pole(self) -> complex:
        """-1 / tau + j dw, in rad/s."""
        return complex(-1 / self.time_constant, self.detuning)


def envelope(
    q: Complex, rate: float, substeps: int, dynamics: TransducerDynamics, *, start: Complex | None = None
) -> Complex:
    """Output of the transducers while the drive steps from frame to frame, shape (frame * substeps, transducer).

    `q`, complex of shape (frame, transducer), is held for one frame each, at `rate` frames per second. There are
    `substeps` samples per frame, the last one at its end; the result is exact at each, for any number. `start`, shape
    (transducer,), is the envelope before the first frame; 0 if None.
    """
    if substeps < 1:
        raise InputError(f"substeps: expected 1 or more per frame, got {substeps}")
    step = 1 / (rate * substeps)
    decay = np.exp(dynamics.pole * step * np.arange(1, substeps + 1))
    out = np.empty((len(q), substeps, q.shape[1]), complex)
    now = np.zeros(q.shape[1], complex) if start is None else start
    for frame, drive in enumerate(q):
        out[frame] = drive + (now - drive) * decay[:, None]
        now = out[frame, -1]
    return out.reshape(-1, q.shape[1])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Transducers:
    """Dynamics and strength of each transducer of an array."""

    pole: Complex
    """-1 / time constant + j detuning in rad/s, shape (transducer,)."""
    response: Complex
    """Complex steady state at full drive, over that of the field model, shape (transducer,)."""

    def __post_init__(self) -> None:
        pole: Complex = frozen_array(self.pole, "pole of the transducers", ("transducer",), np.complex128)
        if pole.real.max() >= 0:
            raise InputError(
                f"pole of the transducers: expected a real part below 0 rad/s (a decay), got {pole.real.max():g}"
            )
        response = frozen_array(self.response, "response of the transducers", (len(pole),), np.complex128)
        object.__setattr__(self, "pole", pole)
        object.__setattr__(self, "response", response)

    @property
    def count(self) -> int:
        """Number of transducers."""
        return len(self.pole)

    @classmethod
    def alike(cls, count: int, dynamics: TransducerDynamics | None = None) -> "Transducers":
        """`count` transducers of the same dynamics, with the strength of the field model."""
        return cls(pole=np.full(count, (dynamics or TransducerDynamics()).pole), response=np.ones(count, complex))

    @classmethod
    def varied(
        cls,
        count: int,
        dynamics: TransducerDynamics | None = None,
        *,
        seed: int,
        gain: float = 1.0,
        gain_spread: float = 0.0,
        resonance_spread: float = 0.0,
        quality_spread: float = 0.0,
    ) -> "Transducers":
        """`count` transducers with random differences, as in real arrays.

        `dynamics` are the mean ones, the default ones if None, and `gain` is the mean strength relative to the field
        model. The spreads are standard deviations: of the strengths and of the quality factors as a fraction of their
        means, and of the resonance frequencies in Hz. Quality factors below a fifth of the mean are clipped.
        """
        if min(gain, gain_spread, resonance_spread, quality_spread) < 0:
            raise InputError(
                "spread of the transducers: expected gain and spreads of 0 or more, got "
                f"{gain:g}, {gain_spread:g}, {resonance_spread:g} Hz and {quality_spread:g}"
            )
        rng = np.random.default_rng(seed)
        # A value below 0 would be a transducer of the opposite sign.
        strength = np.clip(gain * (1 + gain_spread * rng.standard_normal(count)), 0, None)
        resonance = resonance_spread * rng.standard_normal(count)
        quality = np.clip(1 + quality_spread * rng.standard_normal(count), 0.2, None)
        nominal = (dynamics or TransducerDynamics()).pole
        pole = nominal.real / quality + 1j * (nominal.imag + 2 * np.pi * resonance)
        return cls(pole=pole, response=strength * nominal / pole)

    @classmethod
    def measured(cls, calibration: ArrayCalibration) -> "Transducers":
        """The measured transducers; a dead one is silent."""
        return cls(pole=calibration.pole, response=calibration.response)


Waves = NDArray[np.complexfloating[Any, Any]]
Hold = Literal["step", "ideal"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlaybackChain:
    """Effects between a drive and its sound.

    Phases are rounded and held for a frame, or moved to the next one along ramps like AUTD3's silencer, and each
    transducer follows with its own envelope. Each effect can be switched off, to measure its share of the error.
    """

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
        one_of(self.hold, Hold, "chain: hold")
        one_of(self.precision, Precision, "chain: precision")
        if self.phase_bits is not None:
            within(self.phase_bits, "phase bits", 1, 16, advice="None does not round")
        within(self.phase_ramp, "phase ramp", 0, unit="s")
        within(self.level_ramp, "level ramp", 0, unit="s")
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


def simulate(
    drive: Drive,
    G: Complex,
    *,
    chain: PlaybackChain | None = None,
    rate: float,
    acoustics: Acoustics | None = None,
    weights: Array | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Array:
    """Radiation pressure in Pa at points, or on cells, at every moment while an array plays a drive.

    Raises RateError if the rate is not a whole multiple of the drive's; ShapeError if G, the weights or the chain's
    transducers do not match the drive's array or the points.

    The array is silent before the drive. `G`, shape (point, transducer), comes from `transfer_matrix`, in Pa. `chain`
    holds the simulated effects; if None, 8-bit phases that are held, and ideal transducers. The medium of `acoustics`
    determines the radiation pressure; if None, that of the drive. `weights`, shape (cell, point), are cells that
    average over the points, from `cell_weights`; `progress` is called with (frames done, frames in total). Returns
    shape (frame * rate / drive.rate, point) or (..., cell): step i is at the end of the i-th interval of 1 / rate; with
    an ideal hold at its beginning.
    """
    chain, acoustics = chain or PlaybackChain(), acoustics or drive.acoustics
    steps = steps_per_frame(drive.rate, rate)
    _check(drive, G, chain, weights)
    spread = Spread.of(G, acoustics.medium, weights, chain.precision)
    if chain.hold == "ideal":
        # Band-limited interpolation can give negative values, which radiation pressure cannot have.
        still = np.concatenate([spread.pressure(q) for q, _ in radiate(drive, chain, 1)])
        return np.maximum(resample(still, drive.rate, rate), 0.0)
    out = np.empty((drive.frames * steps, spread.width))
    done = 0
    for q, _ in radiate(drive, chain, steps):
        out[done : done + len(q)] = spread.pressure(q)
        done += len(q)
        if progress is not None:
            progress(done // steps, drive.frames)
    return out


def playback_response(
    frequency: Array, rate: float, *, dynamics: TransducerDynamics | None = None, ramp: float = 0.0
) -> Complex:
    """Transfer function of playback for a small change of pressure: hold, ramps and envelope, with their delays.

    sinc(f / R) sinc(f T) exp(-j pi f (1 / R + T)) H(f), H = (h(f) + h*(-f)) / 2 with h = p / (p - 2 pi j f) and p = -1
    / tau + j dw. Without detuning H is 1 / (1 + 2 pi j f tau). It applies to the amplitude of sound of constant phase;
    and to pressure, which is quadratic in amplitude, for small relative changes.

    f is `frequency` and R the `rate` of frames, both in Hz; T is `ramp`, the time over which a silencer spreads each
    step, in s. The `dynamics` are the default ones if None.
    """
    dynamics, f = dynamics or TransducerDynamics(), np.asarray(frequency, float)
    pole = dynamics.pole
    follows = (pole / (pole - 2j * np.pi * f) + np.conj(pole / (pole + 2j * np.pi * f))) / 2
    held = np.sinc(f / rate) * np.sinc(f * ramp) * np.exp(-1j * np.pi * f * (1 / rate + ramp))
    return np.asarray(held * follows, np.complex128)


def steps_per_frame(drive_rate: float, rate: float) -> int:
    """Number of moments at `rate` per frame. Raises RateError if it is not a whole number, 1 or more."""
    steps = rate / drive_rate
    if steps < 1 or abs(steps - round(steps)) > 1e-6:
        raise RateError(
            f"drive: expected a frame rate of which {rate:g} Hz is a whole multiple, got {drive_rate:g} Hz; "
            "solve it at 1000 Hz"
        )
    return round(steps)


def check_frame_rate(rate: float, frequency: float = 40e3) -> int:
    """Periods of the ultrasound per frame: an array can change frames only after whole periods.

    Raises RateError if `rate` is not `frequency` over a whole number; the message names the nearest valid rates.
    """
    periods = frequency / positive(rate, "frame rate", "Hz")
    if periods >= 1 and abs(periods - round(periods)) <= 1e-6 * periods:
        return round(periods)
    near = sorted({frequency / n for n in (max(1, int(periods)), int(periods) + 1)})
    raise RateError(
        f"frame rate: expected {frequency:g} Hz over a whole number, got {rate:g} Hz; "
        f"choose {' or '.join(f'{fits:.6g}' for fits in near)} Hz"
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Spread:
    """Linear map from drives to the radiation pressure at points, or on cells."""

    G: Waves
    """Transposed transfer matrix, shape (transducer, point), in the precision of the field."""
    factor: float
    """Radiation pressure of 1 Pa of sound, in Pa."""
    weights: NDArray[Any] | None
    """Weights of the cells, shape (point, cell)."""

    @classmethod
    def of(cls, G: Complex, medium: Medium, weights: Array | None, precision: Precision) -> "Spread":
        """Make it from a transfer matrix (point, transducer), and weights (cell, point) if there are cells."""
        real, exact = (np.float32, np.complex64) if precision == "single" else (np.float64, np.complex128)
        return cls(
            G=np.ascontiguousarray(G.T, exact),
            factor=float(radiation_pressure(np.ones(1), medium)[0]),
            weights=None if weights is None else np.ascontiguousarray(weights.T, real),
        )

    @property
    def width(self) -> int:
        """Number of points, or of cells if there are weights."""
        return self.G.shape[1] if self.weights is None else self.weights.shape[1]

    def pressure(self, q: Waves) -> Array:
        """Radiation pressure of drives (step, transducer), shape (step, point) or (step, cell), in Pa."""
        field = q.astype(self.G.dtype, copy=False) @ self.G
        power = field.real**2 + field.imag**2
        return self.factor * np.asarray(power if self.weights is None else power @ self.weights, np.float64)


def _check(drive: Drive, G: Complex, chain: PlaybackChain, weights: Array | None) -> None:
    count = drive.array.count
    if G.ndim != 2 or G.shape[1] != count:
        raise ShapeError(f"G: expected (point, {count}) for this drive's array, got {G.shape}")
    if chain.transducers is not None and chain.transducers.count != count:
        raise ShapeError(f"transducers: expected {count} for this drive's array, got {chain.transducers.count}")
    if weights is not None and (weights.ndim != 2 or weights.shape[1] != len(G)):
        raise ShapeError(f"weights: expected (cell, {len(G)}) for these points, got {weights.shape}")
