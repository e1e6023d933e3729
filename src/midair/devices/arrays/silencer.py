"""How gently the firmware moves phases and intensities, chosen by what a simulation says of the pressure."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from midair.devices.frame_bytes import TICK
from midair.errors import InputError
from midair.lazy_frames import blocks
from midair.model import Drive
from midair.physics import PlaybackChain, TransducerDynamics, Transducers, simulate, transfer_matrix

Array = NDArray[np.float64]
SilencerChoice = Literal["auto", "off", "quarter", "half", "default"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Silencer:
    """The time over which the firmware spreads a step.

    Attributes
    ----------
    phase, intensity : float
        Time in which a step is complete, in s; 0 is at once.
    reason : str
        Why this was chosen.
    """

    phase: float
    intensity: float
    reason: str = ""

    def __str__(self) -> str:
        spread = "off" if self.phase == 0 else f"phase {1e3 * self.phase:g} ms, intensity {1e3 * self.intensity:g} ms"
        return f"{spread} ({self.reason})"


@dataclass(frozen=True, slots=True, kw_only=True)
class Sampling:
    """Which part of a drive is simulated, and where it is looked at.

    Attributes
    ----------
    windows, frames, before : int
        How many pieces of how many frames at most, and how many frames before each that are simulated and not judged.
    step : float
        Longest time between two moments, in s; a phase that turns all the way round takes the firmware 250 µs or more.
    moments : int
        About how many moments a piece has at most: slow frames have many.
    heights : tuple of float
        Heights over the array's centre among which the sharpest is looked for, if a drive does not tell its own, in m.
    side, pitch : int, float
        Points on a side of the square that is looked at there, and their distance in m.
    """

    windows: int = 4
    frames: int = 6
    before: int = 2
    step: float = 50e-6
    moments: int = 160
    heights: tuple[float, ...] = field(default_factory=lambda: tuple(np.arange(0.1, 0.41, 0.025)))
    side: int = 12
    pitch: float = 8e-3

    def steps(self, rate: float) -> int:
        """Moments a frame: each is a whole number of the firmware's ticks."""
        ticks = max(1, round(1e9 / rate / TICK))
        longest = max(1, round(self.step * 1e9 / TICK))
        return ticks // max(each for each in range(1, longest + 1) if ticks % each == 0)

    def shorter(self, rate: float) -> "Sampling":
        """The same with pieces that are not too long to simulate."""
        frames = min(self.frames, max(1, self.moments // self.steps(rate)))
        return replace(self, frames=frames, before=min(self.before, frames))

    def plane(self, drive: Drive, height: float) -> Array:
        """Points of the square over the array's centre, shape (point, 3), in m."""
        along = (np.arange(self.side) - (self.side - 1) / 2) * self.pitch
        x, y = (part.ravel() for part in np.meshgrid(along, along))
        return np.asarray(drive.array.position.mean(axis=0) + np.column_stack([x, y, np.full(x.shape, height)]))


def named_silencer(choice: str, rate: float) -> Silencer:
    """The silencer of a name, for frames of a rate in Hz; "default" is the firmware's own, 1 ms.

    Raises
    ------
    InputError
        If there is none of that name, or it is "auto", which hangs on the drive.
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
    """What to set for a drive: the one that was asked for, or the one with the least error of the felt pressure.

    "auto" simulates a sample of the drive with each silencer (`silencer_errors`) and takes the least error, to a tenth
    of a percent; where none has less than no silencer, none. That transducers dip when phases jump, and are heard
    (Suzuki et al., IEEE Trans. Haptics 13(1), 2020), counts as far as it is felt, and no further: whoever wants less
    noise at the cost of some error asks for it by name.

    Raises
    ------
    InputError
        If there is no such choice.
    """
    if choice != "auto":
        chosen = named_silencer(choice, drive.rate)
        errors = silencer_errors(drive, sampling)
        return replace(chosen, reason=f"as asked; {_said(errors)}")
    errors = silencer_errors(drive, sampling)
    # The first of equals: off.
    best = min(errors, key=lambda name: round(errors[name], 3))
    return replace(named_silencer(best, drive.rate), reason=f"least error; {_said(errors)}")


def silencer_errors(drive: Drive, sampling: Sampling | None = None) -> dict[str, float]:
    """Error of the felt pressure with each silencer, simulated; no error for a drive that is silent.

    Root of the summed squares of the difference between the mean pressure over each frame, while transducers follow
    their drive at their resonance, and the pressure of that frame if it stood for ever, over that pressure's; on a
    square at the height for which the drive was solved. Delays count: a frame is to be felt when it is its turn.
    """
    sampling = (sampling or Sampling()).shorter(drive.rate)
    pieces = _pieces(drive, sampling)
    names = [name for name in get_args(SilencerChoice) if name != "auto"]
    if not pieces:
        return dict.fromkeys(names, 0.0)
    G = transfer_matrix(_felt_plane(drive, pieces, sampling), drive.array, acoustics=drive.acoustics)
    moves = Transducers.varied(
        drive.array.count, TransducerDynamics(), gain_spread=0.0, resonance_spread=0.0, quality_spread=0.0, seed=0
    )
    steps = sampling.steps(drive.rate)
    errors: dict[str, float] = {}
    for name in names:
        silencer = named_silencer(name, drive.rate)
        chain = PlaybackChain(phase_ramp=silencer.phase, level_ramp=silencer.intensity, transducers=moves)
        wrong = power = 0.0
        for piece, first in pieces:
            still = simulate(piece, G, rate=piece.rate)[first:]
            moving = simulate(piece, G, chain=chain, rate=piece.rate * steps)
            felt = moving.reshape(piece.frames, steps, -1).mean(axis=1)[first:]
            wrong, power = wrong + float(((felt - still) ** 2).sum()), power + float((still**2).sum())
        errors[name] = float(np.sqrt(wrong / power)) if power > 0 else 0.0
    return errors


def _said(errors: Mapping[str, float]) -> str:
    return "simulated error of the pressure: " + ", ".join(f"{name} {100 * one:.0f} %" for name, one in errors.items())


def _pieces(drive: Drive, sampling: Sampling) -> list[tuple[Drive, int]]:
    """Parts of a drive that sound, evenly spread over it, each with the number of its first frame that is judged."""
    loud = [block.reshape(len(block), -1).max(axis=1) > 0 for block in blocks(drive.level)]
    sounds = np.flatnonzero(np.concatenate(loud))
    if not sounds.size:
        return []
    middle = sounds[np.unique(np.linspace(0, sounds.size - 1, 2 * sampling.windows + 1)[1::2].astype(int))]
    pieces: list[tuple[Drive, int]] = []
    for each in middle:
        begin = max(0, min(int(each), drive.frames - sampling.frames))
        before = max(0, begin - sampling.before)
        part = slice(before, begin + sampling.frames)
        pieces.append((replace(drive, phase=drive.phase[part], level=drive.level[part]), begin - before))
    return pieces


def _felt_plane(drive: Drive, pieces: list[tuple[Drive, int]], sampling: Sampling) -> Array:
    """The points at the height that a drive was solved for; if it does not tell, where it presses most sharply."""
    if isinstance(height := drive.provenance.last("settings").get("target.grid.height"), int | float):
        return sampling.plane(drive, height)
    coarse = replace(sampling, side=sampling.side // 2, pitch=2 * sampling.pitch)

    def sharpness(height: float) -> float:
        G = transfer_matrix(coarse.plane(drive, height), drive.array, acoustics=drive.acoustics)
        return sum(float((simulate(piece, G, rate=piece.rate) ** 2).sum()) for piece, _ in pieces)

    return sampling.plane(drive, max(sampling.heights, key=sharpness))
