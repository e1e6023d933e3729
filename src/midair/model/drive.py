"""The drive of an array, the solution that it is part of, and the frames that were played in live touch."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import InputError, ShapeError
from midair.model.geometry import TransducerArray
from midair.model.medium import Acoustics, Medium
from midair.model.provenance import (
    Brief,
    Provenance,
    clipped,
    counted,
    frames_and_duration,
    frames_without_lead,
    from_source,
    span,
    summary,
)
from midair.model.shown import Frames, Shown
from midair.streaming import LazyFrames
from midair.validation import frozen_array, positive

Status = Literal["converged", "iterations", "stalled", "silent"]
"""How the solver ended a frame: step or gradient below its tolerance; maximum of iterations reached; no step of any
length reduces the error; nothing to play."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drive(Frames):
    """Phase and level of every transducer, frame by frame: q = level exp(j phase)."""

    phase: Array
    """Shape (frame, transducer), in rad."""
    level: Array
    """Shape (frame,) or (frame, transducer), 0 to 1 of full drive."""
    rate: float
    """Frames per second, in Hz."""
    array: TransducerArray
    """The array that the phases were computed for; they are invalid for any other."""
    acoustics: Acoustics = field(default_factory=Acoustics)
    """The air and the directivity that the phases were computed for."""
    provenance: Provenance = field(default_factory=Provenance)

    def __post_init__(self) -> None:
        phase = frozen_array(self.phase, "phase", ("frame", self.array.count))
        shape = np.shape(self.level)
        if shape not in ((len(phase),), phase.shape):
            raise ShapeError(f"level: expected shape {(len(phase),)} or {phase.shape}, got {shape}")
        level = frozen_array(self.level, "level", shape)
        # Lazy frames are checked when they are read.
        if not isinstance(level, LazyFrames) and (level.min() < 0 or level.max() > 1):
            raise InputError(f"level: expected 0 to 1 of full drive, got {level.min():g} to {level.max():g}")
        object.__setattr__(self, "phase", phase)
        object.__setattr__(self, "level", level)
        object.__setattr__(self, "rate", positive(self.rate, "rate", "Hz"))

    def __repr__(self) -> str:
        return summary(
            self,
            frames_and_duration(self.frames, self.rate, self.provenance),
            f"{counted(self.array.count, 'transducer')} of {clipped(self.array.name)}",
            f"level {span(self.level)}",
            from_source(self.provenance.source),
            simulated=self.provenance.simulated,
        )

    @property
    def q(self) -> NDArray[np.complex128]:
        """Complex drive of each transducer (paper, eq. 4), shape (frame, transducer), magnitude 0 to 1."""
        return self.q_of(slice(None))

    def q_of(self, which: slice | NDArray[np.intp]) -> NDArray[np.complex128]:
        """`q` of these frames."""
        phase = np.asarray(self.phase[which])
        level = np.asarray(self.level[which]).reshape(len(phase), -1)
        return np.asarray(level * np.exp(1j * phase), np.complex128)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solution(Shown):
    """A drive, with the error and the solver status of each frame."""

    drive: Drive
    error: Array
    """``E = || |G q| - p || / || p ||``, shape (frame,); 0 with nothing to play, NaN if the target is unknown."""
    iterations: NDArray[np.int64]
    """Number of iterations of the solver, shape (frame,)."""
    status: tuple[Status, ...]
    """One status per frame."""

    def __post_init__(self) -> None:
        frames = self.drive.frames
        object.__setattr__(self, "error", frozen_array(self.error, "error", (frames,), finite=False))
        object.__setattr__(self, "iterations", frozen_array(self.iterations, "iterations", (frames,), np.int64))
        if len(self.status) != frames:
            raise ShapeError(f"status: expected {frames} entries, one a frame, got {len(self.status)}")

    @classmethod
    def joined(cls, parts: "Sequence[Solution]") -> "Solution":
        """Concatenate consecutive parts of one recording; all other properties are those of the first."""
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
        """Frames from `first` up to, but not including, `last`."""
        part = slice(first, last)
        drive = replace(self.drive, phase=self.drive.phase[part], level=self.drive.level[part])
        return Solution(drive=drive, error=self.error[part], iterations=self.iterations[part], status=self.status[part])

    def to_csv(self, path: str | os.PathLike[str]) -> None:
        """Write a new table, a row a frame: time in s, E, iterations, and 1 where it plays; InputError if it exists."""
        self._part("files").write_errors(self, path)

    def __repr__(self) -> str:
        # Its mean would differ from that by energy, which commands print and needs the target.
        inside = frames_without_lead(self.drive.provenance, self.drive.frames, self.drive.rate)
        plays, error = self.plays, 100 * self.error[inside][self.plays[inside]]
        return summary(
            self,
            f"E of a frame {span(error, '%')}" if len(error) and np.isfinite(error[0]) else "",
            f"{counted(int((~plays).sum()), 'frame')} silent" if not plays.all() else "",
            f"of {self.drive!r}",
        )

    @property
    def plays(self) -> NDArray[np.bool_]:
        """True for each frame that has anything to play, shape (frame,); E is meaningful for these only."""
        return np.array([status != "silent" for status in self.status])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class PlayedTouch(Brief):
    """Frames of live touch that were sent to the array, one for each sensor frame."""

    phase_steps: NDArray[np.uint8]
    """Shape (frame, transducer), in steps of 2 pi / 256; a silent frame repeats those of the last frame with sound."""
    intensity: NDArray[np.uint8]
    """Shape (frame,); 255 is full drive, 0 is silence."""
    instant: NDArray[np.int64]
    """Scheduled time of each frame, shape (frame,), in ns of the units' clock; 0 for a frame without one."""
    state: NDArray[np.int8]
    """Shape (frame,), a sum of: 1 the frame was played; 2 it was late and the frame before continued; 4 the sensor lost
    it."""
    rate: float
    """Frames per second, in Hz."""
    array: TransducerArray
    """The array that played."""
    provenance: Provenance = field(default_factory=Provenance)

    def __post_init__(self) -> None:
        frames = len(self.phase_steps)
        if self.phase_steps.shape != (frames, self.array.count):
            raise ShapeError(f"phase_steps: expected (frame, {self.array.count}), got {self.phase_steps.shape}")
        for name in ("phase_steps", "intensity", "instant", "state"):
            # A view saves memory: ten minutes are 600 MB.
            view = getattr(self, name).view()
            view.flags.writeable = False
            object.__setattr__(self, name, view)
        for name in ("intensity", "instant", "state"):
            if getattr(self, name).shape != (frames,):
                raise ShapeError(f"{name}: expected shape ({frames},), got {getattr(self, name).shape}")

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.phase_steps)

    @property
    def drive(self) -> Drive:
        """The drive that was emitted; a late or lost frame repeats the frame before it."""
        there = np.maximum.accumulate(np.where(self.state & 6, 0, np.arange(self.frames)))
        return Drive(
            phase=np.asarray(self.phase_steps[there] * (2 * np.pi / 256), np.float64),
            level=self.intensity[there] / 255,
            rate=self.rate,
            array=self.array,
            acoustics=Acoustics(medium=self._medium),
            provenance=self.provenance,
        )

    @property
    def _medium(self) -> Medium:
        """Air that the frames were solved for; the paper's where it is not stated."""
        air = self.provenance.last("live")
        match air.get("temperature_c"), air.get("humidity"), air.get("sound_m_s"):
            case float(temperature), float(humidity), _:
                return Medium.at(temperature=temperature, humidity=humidity)
            case _, _, float(speed):
                return Medium(speed=speed)
            case _:
                return Medium()
