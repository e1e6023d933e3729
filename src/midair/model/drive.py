"""What the array is told, and how well it was solved for."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError, ShapeError
from midair.model.acoustics import Acoustics
from midair.model.geometry import TransducerArray
from midair.model.pictures import captioned, dots, lines
from midair.model.provenance import Provenance
from midair.model.telling import came_from, frames_at, short, span
from midair.validation import frozen_array, positive

Array = NDArray[np.float64]

Status = Literal["converged", "iterations", "stalled", "silent"]
"""How the solver of a frame ended: step or gradient small enough; iterations used up; no step of any length helps;
nothing to play."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drive:
    """Phase and level of every transducer, frame by frame: q = level exp(j phase).

    Attributes
    ----------
    phase : ndarray, shape (frame, transducer)
        In rad.
    level : ndarray, shape (frame,) or (frame, transducer)
        0 to 1 of full drive.
    rate : float
        Frames per second, in Hz.
    array : TransducerArray
        The array that the phases are for, and for no other.
    acoustics : Acoustics
        The air and the directivity that the phases are for.
    provenance : Provenance
        Where it came from and what was done to it.
    """

    phase: Array
    level: Array
    rate: float
    array: TransducerArray
    acoustics: Acoustics = field(default_factory=Acoustics)
    provenance: Provenance = field(default_factory=Provenance)

    def __post_init__(self) -> None:
        phase = frozen_array(self.phase, "phase", ("frame", self.array.count))
        shape = np.shape(self.level)
        if shape not in ((len(phase),), phase.shape):
            raise ShapeError(f"level: expected shape {(len(phase),)} or {phase.shape}, got {shape}")
        level = frozen_array(self.level, "level", shape)
        if level.min() < 0 or level.max() > 1:
            raise InputError(f"level: expected 0 to 1 of full drive, got {level.min():g} to {level.max():g}")
        object.__setattr__(self, "phase", phase)
        object.__setattr__(self, "level", level)
        object.__setattr__(self, "rate", positive(self.rate, "rate", "Hz"))

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.phase)

    @property
    def time(self) -> Array:
        """Of each frame, shape (frame,), in s."""
        return np.arange(self.frames) / self.rate

    @property
    def q(self) -> NDArray[np.complex128]:
        """Complex drive of each transducer (paper, eq. 4), shape (frame, transducer), 0 to 1 in magnitude."""
        level = self.level if self.level.ndim == 2 else self.level[:, None]
        return np.asarray(level * np.exp(1j * self.phase), np.complex128)

    def __repr__(self) -> str:
        array = f"{self.array.count} transducers of {short(self.array.name)}"
        said = f"{frames_at(self.frames, self.rate)}, {array}, level {span(self.level, '')}"
        return f"<Drive {said}, {came_from(self.provenance)}>"

    def _repr_html_(self) -> str:
        loud = self.level if self.level.ndim == 1 else self.level.max(axis=1)
        first = int(np.argmax(loud > 0))
        x, y = self.array.position[:, 0], self.array.position[:, 1]
        shown = dots(x, y, self.phase[first], low="phase as colour", high=f"{1e3 * float(np.ptp(x)):.0f} mm wide")
        return captioned(shown, f"{repr(self)[1:-1]}; frame {first}")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solution:
    """A drive and how well each of its frames meets the target.

    Attributes
    ----------
    drive : Drive
        What to play.
    error : ndarray, shape (frame,)
        ``E = || |G q| - p || / || p ||``; 0 for a frame with nothing to play.
    iterations : ndarray of int, shape (frame,)
        That the solver made.
    status : tuple of {"converged", "iterations", "stalled", "silent"}
        One a frame.
    """

    drive: Drive
    error: Array
    iterations: NDArray[np.int64]
    status: tuple[Status, ...]

    def __post_init__(self) -> None:
        frames = self.drive.frames
        object.__setattr__(self, "error", frozen_array(self.error, "error", (frames,)))
        object.__setattr__(self, "iterations", frozen_array(self.iterations, "iterations", (frames,), np.int64))
        if len(self.status) != frames:
            raise ShapeError(f"status: expected {frames} entries, one a frame, got {len(self.status)}")

    def __repr__(self) -> str:
        heard = np.array([status != "silent" for status in self.status])
        error = 100 * self.error[heard]
        said = f"E mean {error.mean():.1f} %, worst {error.max():.1f} %" if heard.any() else "nothing to play"
        return f"<Solution {said}, {int((~heard).sum())} silent, of {self.drive!r}>"

    def _repr_html_(self) -> str:
        end = self.drive.frames / self.drive.rate
        shown = lines(100 * self.error[None], low="0 s", high=f"{end:.3g} s; E in %")
        return captioned(shown, repr(self)[1:-1])
