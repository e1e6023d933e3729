"""What the array is told, and how well it was solved for; and what it was told of touch while that was felt."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError, ShapeError
from midair.lazy_frames import LazyFrames
from midair.model.acoustics import Acoustics
from midair.model.geometry import TransducerArray
from midair.model.pictures import curve, dots, framed
from midair.model.provenance import Provenance
from midair.model.reprs import came_from, clipped, counted, lasting, span, told
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
        # A reel's numbers are looked at when they are read.
        if not isinstance(level, LazyFrames) and (level.min() < 0 or level.max() > 1):
            raise InputError(f"level: expected 0 to 1 of full drive, got {level.min():g} to {level.max():g}")
        object.__setattr__(self, "phase", phase)
        object.__setattr__(self, "level", level)
        object.__setattr__(self, "rate", positive(self.rate, "rate", "Hz"))

    def __repr__(self) -> str:
        return told(
            self,
            lasting(self.frames, self.rate),
            f"{counted(self.array.count, 'transducer')} of {clipped(self.array.name)}",
            f"level {span(self.level)}",
            came_from(self.provenance.source),
            simulated=self.provenance.simulated,
        )

    def _repr_html_(self) -> str:
        sounds = self.level.reshape(self.frames, -1) > 0
        first = int(sounds.any(axis=1).argmax())
        turn = self.phase[first] / (2 * np.pi) % 1
        colour = np.where(sounds[first], (turn * 16).astype(int) % 16, -1)
        picture = dots(self.array.position, colour, bar=("2π rad", "0"))
        said = f"Phase in rad of the first frame that sounds, at {first / self.rate:.4g} s; x, y in mm"
        said = said if sounds.any() else "No frame sounds; x, y in mm"
        return framed(self, picture, said, simulated=self.provenance.simulated)

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

    @classmethod
    def joined(cls, parts: "Sequence[Solution]") -> "Solution":
        """Parts of one recording, one after another; what is told of the drive is the first one's."""
        if len(parts) == 1:
            return parts[0]
        drives = [part.drive for part in parts]
        whole = replace(
            drives[0],
            phase=np.concatenate([np.asarray(drive.phase) for drive in drives]),
            level=np.concatenate([np.asarray(drive.level) for drive in drives]),
        )
        return cls(
            drive=whole,
            error=np.concatenate([part.error for part in parts]),
            iterations=np.concatenate([part.iterations for part in parts]),
            status=tuple(status for part in parts for status in part.status),
        )

    def cut(self, first: int, last: int) -> "Solution":
        """Frames from `first` up to `last`."""
        part = slice(first, last)
        drive = replace(self.drive, phase=self.drive.phase[part], level=self.drive.level[part])
        return Solution(drive=drive, error=self.error[part], iterations=self.iterations[part], status=self.status[part])

    def __repr__(self) -> str:
        plays, error = self.plays, 100 * self.error[self.plays]
        return told(
            self,
            counted(self.drive.frames, "frame"),
            f"E mean {error.mean():.3g} %, worst {error.max():.3g} %" if plays.any() else "",
            f"{(~plays).sum()} silent" if not plays.all() else "",
            f"of {self.drive!r}",
        )

    def _repr_html_(self) -> str:
        frames = np.arange(self.drive.frames, dtype=float)
        error = np.where(self.plays, 100 * self.error, np.nan)
        picture = curve(frames, error, x_label="frame", y_unit="%")
        said = "E in % of each frame that sounds" if self.plays.any() else "E in %: no frame sounds"
        return framed(self, picture, said, simulated=self.drive.provenance.simulated)

    @property
    def plays(self) -> NDArray[np.bool_]:
        """Whether a frame has anything to play, shape (frame,); E says something about these only."""
        return np.array([status != "silent" for status in self.status])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlayedTouch:
    """Frames of live touch as the array was told them, one for each frame that a sensor gave.

    Attributes
    ----------
    phase_steps : ndarray of uint8, shape (frame, transducer)
        In steps of 2 pi / 256; of a silent frame those of the last one that sounded.
    intensity : ndarray of uint8, shape (frame,)
        255 is full drive, 0 silence.
    instant : ndarray of int64, shape (frame,)
        When it was to sound, in ns of the units' time; 0 of a frame that had no instant.
    state : ndarray of int8, shape (frame,)
        1 it sounded; 2 it was late, and the one before stood on; 4 the sensor never gave it; or a sum of these.
    rate : float
        Frames per second, in Hz.
    array : TransducerArray
        That played.
    provenance : Provenance
        Where it came from.
    """

    phase_steps: NDArray[np.uint8]
    intensity: NDArray[np.uint8]
    instant: NDArray[np.int64]
    state: NDArray[np.int8]
    rate: float
    array: TransducerArray
    provenance: Provenance = field(default_factory=Provenance)

    def __post_init__(self) -> None:
        frames = len(self.phase_steps)
        if self.phase_steps.shape != (frames, self.array.count):
            raise ShapeError(f"phase_steps: expected (frame, {self.array.count}), got {self.phase_steps.shape}")
        for name in ("phase_steps", "intensity", "instant", "state"):
            # A view: ten minutes are 600 MB.
            view = getattr(self, name).view()
            view.flags.writeable = False
            object.__setattr__(self, name, view)
        for name in ("intensity", "instant", "state"):
            if getattr(self, name).shape != (frames,):
                raise ShapeError(f"{name}: expected shape ({frames},), got {getattr(self, name).shape}")

    def __repr__(self) -> str:
        return told(self, counted(self.frames, "frame"), f"{self.rate:g} Hz", self.array.name)

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.phase_steps)

    @property
    def drive(self) -> Drive:
        """What sounded, frame by frame: where one was late, or none came, the one before, which stood on."""
        there = np.maximum.accumulate(np.where(self.state & 6, 0, np.arange(self.frames)))
        return Drive(
            phase=np.asarray(self.phase_steps[there] * (2 * np.pi / 256), np.float64),
            level=self.intensity[there] / 255,
            rate=self.rate,
            array=self.array,
            provenance=self.provenance,
        )
