"""Setting of the firmware's silencer, which smooths phases and intensities, chosen by simulation of the pressure."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, get_args

import numpy as np

from midair.array_types import Array
from midair.devices.frame_bytes import TICK
from midair.errors import InputError
from midair.model import Drive
from midair.physics import PlaybackChain, TransducerDynamics, Transducers, simulate, transfer_matrix
from midair.streaming import blocks

SilencerChoice = Literal["auto", "off", "quarter", "half", "default"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Silencer:
    """Time constants of the firmware's silencer."""

    phase: float
    """Time in which a step of the phase is complete, in s; 0 is off."""
    intensity: float
    """Time in which a step of the intensity is complete, in s; 0 is off."""
    reason: str = ""
    """Reason for this choice."""

    def __str__(self) -> str:
        spread = "off" if self.phase == 0 else f"phase {1e3 * self.phase:g} ms, intensity {1e3 * self.intensity:g} ms"
        return f"{spread} ({self.reason})" if self.reason else spread


@dataclass(frozen=True, slots=True, kw_only=True)
class Sampling:
    """Part of a drive that is simulated, and the points at which it is evaluated."""

    windows: int = 4
    """Maximum number of pieces."""
    frames: int = 6
    """Maximum number of frames per piece."""
    before: int = 2
    """Frames simulated before each piece but not evaluated."""
    step: float = 50e-6
    """Maximum time step, in s; a phase takes the firmware 250 µs or more for a whole turn."""
    moments: int = 160
    """Approximate maximum number of time steps per piece; slow frames have many."""
    heights: tuple[float, ...] = field(default_factory=lambda: tuple(np.arange(0.1, 0.41, 0.025)))
    """Candidate heights above the array's centre, in m, if the drive does not state its own."""
    side: int = 12
    """Number of points along a side of the evaluated square."""
    pitch: float = 8e-3
    """Distance between these points, in m."""

    def steps(self, rate: float) -> int:
        """Time steps per frame, each a whole number of the firmware's ticks."""
        ticks = max(1, round(1e9 / rate / TICK))
        longest = max(1, round(self.step * 1e9 / TICK))
        return ticks // max(each for each in range(1, longest + 1) if ticks % each == 0)

    def shorter(self, rate: float) -> "Sampling":
        """The same sampling with pieces that are short enough to simulate."""
        frames = min(self.frames, max(1, self.moments // self.steps(rate)))
        return replace(self, frames=frames, before=min(self.before, frames))

    def plane(self, drive: Drive, height: float) -> Array:
        """Points of the square above the array's centre, shape (point, 3), in m."""
        along = (np.arange(self.side) - (self.side - 1) / 2) * self.pitch
        x, y = (part.ravel() for part in np.meshgrid(along, along))
        return np.asarray(drive.array.position.mean(axis=0) + np.column_stack([x, y, np.full(x.shape, height)]))


def named_silencer(choice: str, rate: float) -> Silencer:
    """The silencer of a name other than "auto", for a frame rate in Hz; "default" is the firmware's own, 1 ms.

    Raises InputError if the name is unknown.
    """
    known = [name for name in get_args(SilencerChoice) if name != "auto"]
    if choice not in known:
        raise InputError(f"silencer: expected one of auto, {', '.join(known)}, got {choice!r}")
    if choice == "off":
        return Silencer(phase=0, intensity=0)
    if choice == "default":
        return Silencer(phase=1e-3, intensity=0.25e-3)
    period, tick = (0.25 if choice == "quarter" else 0.5) / rate, TICK * 1e-9
    # Whole ticks, from one up to the firmware's own 1 ms.
    spread = max(1, min(round(1e-3 / tick), round(period / tick))) * tick
    return Silencer(phase=spread, intensity=min(spread, 0.25e-3))


def choose_silencer(choice: SilencerChoice, drive: Drive, sampling: Sampling | None = None) -> Silencer:
    """Return the requested silencer, or the one with the least simulated error of the pressure.

    "auto" simulates a sample of the drive with each silencer (`silencer_errors`) and selects the least error, rounded
    to 0.1 %; "off" wins a tie. Audible noise from dips of the output when phases jump (Suzuki et al., IEEE Trans.
    Haptics 13(1), 2020) is not minimised: select a silencer by name for less noise at the cost of a larger error.

    Raises InputError if the choice is unknown.
    """
    if choice != "auto":
        chosen = named_silencer(choice, drive.rate)
        errors = silencer_errors(drive, sampling)
        return replace(chosen, reason=f"as requested; {_errors_text(errors)}")
    errors = silencer_errors(drive, sampling)
    # `min` returns the first of equal values: off.
    best = min(errors, key=lambda name: round(errors[name], 3))
    return replace(named_silencer(best, drive.rate), reason=f"least error; {_errors_text(errors)}")


def silencer_errors(drive: Drive, sampling: Sampling | None = None) -> dict[str, float]:
    """Simulated error of the pressure with each silencer; 0 for a silent drive.

    Relative root sum of squares of the difference between the mean pressure over each frame, with transducer dynamics,
    and the steady pressure of that frame, on a square at the height of the drive's target. Delays count as errors.
    """
    sampling = (sampling or Sampling()).shorter(drive.rate)
    pieces = _pieces(drive, sampling)
    names = [name for name in get_args(SilencerChoice) if name != "auto"]
    if not pieces:
        return dict.fromkeys(names, 0.0)
    G = transfer_matrix(_target_plane(drive, pieces, sampling), drive.array, acoustics=drive.acoustics)
    moves = Transducers.varied(
        drive.array.count, TransducerDynamics(), gain_spread=0.0, resonance_spread=0.0, quality_spread=0.0, seed=0
    )
    steps = sampling.steps(drive.rate)
    steady = [simulate(piece, G, rate=piece.rate)[first:] for piece, first in pieces]
    errors: dict[str, float] = {}
    for name in names:
        silencer = named_silencer(name, drive.rate)
        chain = PlaybackChain(phase_ramp=silencer.phase, level_ramp=silencer.intensity, transducers=moves)
        wrong = power = 0.0
        for (piece, first), still in zip(pieces, steady, strict=True):
            moving = simulate(piece, G, chain=chain, rate=piece.rate * steps)
            felt = moving.reshape(piece.frames, steps, -1).mean(axis=1)[first:]
            wrong, power = wrong + float(((felt - still) ** 2).sum()), power + float((still**2).sum())
        errors[name] = float(np.sqrt(wrong / power)) if power > 0 else 0.0
    return errors


def _errors_text(errors: Mapping[str, float]) -> str:
    return "simulated error of the pressure: " + ", ".join(f"{name} {100 * one:.0f} %" for name, one in errors.items())


def _pieces(drive: Drive, sampling: Sampling) -> list[tuple[Drive, int]]:
    """Parts of a drive that are not silent, evenly spread over it, each with the index of its first evaluated frame."""
    loud = [block.reshape(len(block), -1).max(axis=1) > 0 for block in blocks(drive.level)]
    sounds = np.flatnonzero(np.concatenate(loud))
    if not sounds.size:
        return []
    middle = sounds[np.unique(np.linspace(0, sounds.size - 1, 2 * sampling.windows + 1)[1::2].astype(int))]
    pieces: list[tuple[Drive, int]] = []
    for begin in np.unique(np.maximum(0, np.minimum(middle, drive.frames - sampling.frames))).tolist():
        before = max(0, begin - sampling.before)
        part = slice(before, begin + sampling.frames)
        pieces.append((replace(drive, phase=drive.phase[part], level=drive.level[part]), begin - before))
    return pieces


def _target_plane(drive: Drive, pieces: list[tuple[Drive, int]], sampling: Sampling) -> Array:
    """Points at the height that the drive was solved for, or at the height of the sharpest pressure if unknown."""
    if isinstance(height := drive.provenance.last("settings").get("target.grid.height"), int | float):
        return sampling.plane(drive, height)
    coarse = replace(sampling, side=sampling.side // 2, pitch=2 * sampling.pitch)

    def sharpness(height: float) -> float:
        G = transfer_matrix(coarse.plane(drive, height), drive.array, acoustics=drive.acoustics)
        return sum(float((simulate(piece, G, rate=piece.rate) ** 2).sum()) for piece, _ in pieces)

    return sampling.plane(drive, max(sampling.heights, key=sharpness))
