"""A simulated phased array, whose sound presses on a `VirtualSkin`, and simulated units for live touch."""

import time
from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from midair.devices.arrays import OUTCOMES, ImmediateArray, Silencer, SilencerChoice, choose_silencer
from midair.devices.frame_bytes import Bytes
from midair.devices.interface import ArrayDevice, PlayReport
from midair.devices.virtual.virtual_sensor import VirtualSkin
from midair.errors import DeviceStateError, InputError
from midair.model import Acoustics, Drive, PalmPath, Placement, Progress, TransducerArray
from midair.physics import (
    MovingSpread,
    PlaybackChain,
    Spread,
    TransducerDynamics,
    Transducers,
    TransducerState,
    Waves,
    middle_of,
    radiate,
    simulate,
    steps_per_frame,
    transfer_matrix,
)


class VirtualArray(ArrayDevice):
    """Simulates playback with transducer dynamics, quantised phases, and deviations of the transducers from the model.

    The deviations are intended: they are what calibration and correction measure and compensate.

    Parameters
    ----------
    skin : VirtualSkin, optional
        The surface that the sound presses on.
    acoustics : Acoustics, optional
        Air in which the sound propagates, whatever a drive was solved for; each drive's own air if None.
    dynamics : TransducerDynamics
        Mean response of a transducer to a change of its drive.
    phase_bits : int or None
        Resolution of the phases; not quantised if None.
    strength : float
        Mean strength of the transducers relative to the model.
    spread : float
        Relative standard deviation of the strengths.
    resonance_spread : float
        Standard deviation of the resonances, in Hz.
    quality_spread : float
        Relative standard deviation of the quality factors.
    seed : int
        Seed of the deviations.
    transducers : Transducers, optional
        Replaces strength, spreads and seed.
    silencer : {"auto", "off", "quarter", "half", "default"}, optional
        Setting of the silencer, see `choose_silencer`; default: auto as on a real array, or off if a chain is given.
    chain : PlaybackChain, optional
        Replaces all settings above except the silencer's, to make single parts ideal.
    palm : PalmPath, optional
        Poses of the skin in array coordinates from the first frame of each play on, the last of which holds; it rests
        in the middle above the array if None.
    """

    simulated = True
    gated = False
    streams = True

    def __init__(
        self,
        array: TransducerArray,
        skin: VirtualSkin | None = None,
        *,
        acoustics: Acoustics | None = None,
        dynamics: TransducerDynamics | None = None,
        phase_bits: int | None = 8,
        strength: float = 0.9,
        spread: float = 0.05,
        resonance_spread: float = 50.0,
        quality_spread: float = 0.05,
        seed: int = 0,
        transducers: Transducers | None = None,
        silencer: SilencerChoice | None = None,
        chain: PlaybackChain | None = None,
        palm: PalmPath | None = None,
        name: str = "virtual",
    ) -> None:
        self.name, self.array = name, array
        self.acoustics = acoustics
        self.silencer: SilencerChoice = silencer or ("auto" if chain is None else "off")
        self.chain = chain or PlaybackChain(
            phase_bits=phase_bits,
            transducers=transducers
            or Transducers.varied(
                array.count,
                dynamics,
                seed=seed,
                gain=strength,
                gain_spread=spread,
                resonance_spread=resonance_spread,
                quality_spread=quality_spread,
            ),
        )
        self._skin, self.palm = skin, palm
        self._path: _Path | None = None
        self._open = False
        self._now = TransducerState.silent(array.count)

    @property
    def emitting(self) -> bool:
        """True while any sound is emitted."""
        return bool(np.abs(self._now.q).max() > 0)

    def open(self) -> None:
        """Open the array; it is silent."""
        self._open = True
        self.silence()

    def emit(self, drive: Drive, progress: Progress | None, *, repeats: int = 1, delay: float = 0.0) -> PlayReport:
        """Compute the pressure of every frame on the skin, block by block."""
        if not self._open:
            raise DeviceStateError("virtual array: expected open before play")
        path = self._path_in(self.acoustics or Acoustics(medium=drive.acoustics.medium))
        silencer, chain = None, self.chain
        if self.silencer != "off":
            silencer = choose_silencer(self.silencer, drive)
            chain = replace(chain, phase_ramp=silencer.phase, level_ramp=silencer.intensity)
        steps = 1 if self._skin is None else steps_per_frame(drive.rate, self._skin.rate)
        if self._skin is not None and delay:
            self._skin.press(np.zeros((round(delay * drive.rate) * steps, self._skin.points.count)))
        total = drive.frames * repeats
        for before in range(0, total, drive.frames):
            if chain.hold == "ideal" and path is not None:
                pressure = simulate(drive, path.matrix, chain=chain, rate=path.skin.rate, acoustics=path.acoustics)
                path.skin.press(pressure)
            done, moment = 0, before * steps
            for q, now in radiate(drive, chain, steps, start=self._now):
                with self.sounding():
                    self._now = now
                done += len(q) // steps
                if chain.hold == "step" and path is not None:
                    path.skin.press(path.pressure(q, moment))
                moment += len(q)
                if progress:
                    progress(before + done, total)
        said = "off" if silencer is None else str(silencer)
        return PlayReport(frames=total, duration=total / drive.rate, silencer=said)

    def silence(self) -> None:
        """Stop all sound immediately."""
        self._now = TransducerState.silent(self.array.count)

    def close(self) -> None:
        """Close the array."""
        self._open = False

    def _path_in(self, acoustics: Acoustics) -> "_Path | None":
        """Propagation from the array to the skin, cached until the air changes."""
        if self._skin is not None and (self._path is None or self._path.acoustics != acoustics):
            matrix = transfer_matrix(self._skin.points, self.array, acoustics=acoustics)
            spread = Spread.of(matrix, acoustics.medium, None, self.chain.precision)
            moving = None if self.palm is None else self._moving(self._skin, self.palm, acoustics)
            self._path = _Path(skin=self._skin, acoustics=acoustics, matrix=matrix, spread=spread, moving=moving)
        return self._path

    def _moving(self, skin: VirtualSkin, palm: PalmPath, acoustics: Acoustics) -> MovingSpread:
        if self.chain.hold == "ideal":
            raise InputError("virtual array: expected frames that are held for a palm that moves, got an ideal hold")
        return MovingSpread(
            skin.points.position,
            self.array,
            acoustics,
            solved=middle_of(skin.points),
            path=palm,
            rate=skin.rate,
            precision=self.chain.precision,
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Path:
    """Propagation from the array to the skin."""

    skin: VirtualSkin
    acoustics: Acoustics
    matrix: NDArray[np.complex128]
    spread: Spread
    moving: MovingSpread | None = None

    def pressure(self, q: Waves, first: int) -> NDArray[np.float64]:
        """Pressure on the points of the skin from step `first` of a play on."""
        return self.spread.pressure(q) if self.moving is None else self.moving.pressure(q, first)


class VirtualUnits:
    """Accepts frames without sound; keeps the last `kept` of them as (phases, intensity, instant)."""

    emulated = True
    failsafe = 0.0

    def __init__(self, kept: int = 0) -> None:
        self.frames: deque[tuple[Bytes, int, int]] = deque(maxlen=kept)
        self._counts: dict[str, int] = dict.fromkeys(OUTCOMES, 0)
        self._sent_at = np.zeros(64, np.int64)
        self._number = 0

    def set_silencer(self, silencer: Silencer) -> None:
        """Do nothing: there is no silencer."""

    def now(self) -> int:
        """Device time, in ns."""
        return time.monotonic_ns()

    def put(self, phases: Bytes, intensity: int, instant: int) -> None:
        """Accept a frame, unless its instant has passed."""
        number, self._number = self._number, self._number + 1
        now = self._sent_at[number % 64] = time.monotonic_ns()
        if now >= instant:
            self._sent_at[number % 64] = 0
            self._counts["late"] += 1
            return
        self._counts["sent"] += 1
        self._counts["answered"] += 1
        if self.frames.maxlen:
            self.frames.append((phases.copy(), intensity, instant))

    def skip(self) -> None:
        """Do nothing: virtual units are never too hot."""

    def sent(self, number: int) -> int:
        """Time at which a frame was accepted, in ns of `time.monotonic_ns`."""
        return int(self._sent_at[number % 64])

    def told(self) -> dict[str, int]:
        """Number of frames by outcome."""
        return dict(self._counts)

    def state(self) -> None:
        """None: there are no units to query."""

    def silence(self) -> None:
        """Add a silent frame."""
        if self.frames:
            phases, _, _ = self.frames[-1]
            self.frames.append((np.zeros_like(phases), 0, time.monotonic_ns()))

    def release(self) -> None:
        """Do nothing: there is nothing to release."""

    def describe(self) -> dict[str, str]:
        """Description of the units."""
        return {"units": "virtual, without sound"}

    def close(self) -> None:
        """Do nothing: there is no connection to close."""


def virtual_immediate(
    placement: Placement | None = None, *, hold: float = 0.006, units: VirtualUnits | None = None
) -> ImmediateArray:
    """An immediate array without sound; pass `units` to inspect the frames that they received."""
    own = units or VirtualUnits()
    return ImmediateArray(
        lambda _: own, placement or Placement.grid(), name="virtual", hold=hold, simulated=True, gated=False
    )
