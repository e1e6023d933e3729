"""A trial cut into pieces at frames where its solver can start independently."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from midair.model import AmplitudeFrames, PressureFrames, TransducerArray
from midair.physics import check_frame_rate, focus_amplitude, propagate, quantise_phase, relative_error
from midair.pipeline import target_amplitude
from midair.settings import Settings
from midair.solvers import Glide, Piece, pieces, read_solver_blocks, solve_piece, solver
from midair.streaming import blocks
from midair.sweep.task import Found

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class TrialCut:
    """Target of a trial, and its independent pieces."""

    target: AmplitudeFrames
    settings: Settings
    pieces: tuple[Piece, ...]

    @classmethod
    def of(cls, pressure: PressureFrames, array: TransducerArray, settings: Settings, *, together: int) -> "TrialCut":
        """Cut a trial into pieces of `together` blocks; the target is read once to find the frames with sound.

        Raises a RateError if the array does not support the pressure's rate.
        """
        check_frame_rate(pressure.rate, array.frequency)
        target = target_amplitude(replace(pressure, provenance=settings.noted(pressure.provenance)), settings)
        sounds = np.concatenate([block.any(axis=1) for block in blocks(target.amplitude, 256)])
        return cls(
            target=target, settings=settings, pieces=tuple(pieces(method_of(settings), sounds, together=together))
        )

    def job(self, number: int, array: TransducerArray, bits: int) -> "PieceJob":
        """Job for one piece: its targets and those of the marks before it."""
        piece = self.pieces[number]
        begin = int(piece.marks[0]) if len(piece.marks) else piece.first
        frames = read_solver_blocks(self.target.amplitude, begin, piece.last)
        return PieceJob(
            target=replace(self.target, amplitude=frames[piece.first - begin :]),
            marks=frames[piece.marks - begin],
            loudest=self.loudest,
            settings=self.settings.but(jobs=1),
            array=array,
            bits=bits,
        )

    @cached_property
    def loudest(self) -> float:
        """Highest amplitude of the recording for level "auto"; otherwise 0."""
        return float(self.target.amplitude.max()) if self.settings.solver.level == "auto" else 0.0


def is_cut(settings: Settings) -> bool:
    """True if the solver can start within a recording."""
    return settings.solver.name == "glide"


def method_of(settings: Settings) -> Glide:
    """Solver of settings that can be cut."""
    made = solver(settings.solver.method, backend=settings.solver.backend)
    if not isinstance(made, Glide):
        raise TypeError(f"expected settings with method glide, got {settings.solver.name}")
    return made


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PieceJob:
    """A piece of a trial for a worker; `marks` are the targets of the marks before it, shape (mark, point) in Pa."""

    target: AmplitudeFrames
    marks: Array
    loudest: float
    settings: Settings
    array: TransducerArray
    bits: int

    def __call__(self) -> Found:
        """E of each frame, with exact and with rounded phases."""
        asked, error, rounded, first = self.target, list[Array](), list[Array](), 0
        acoustics = self.settings.acoustics
        parts = solve_piece(
            asked,
            self.array,
            self.settings.solver,
            marks=self.marks,
            loudest=self.loudest,
            acoustics=acoustics,
        )
        for part in parts:
            wanted_here = asked.amplitude[first : first + len(part.error)]
            first += len(part.error)
            drive = replace(part.drive, phase=quantise_phase(part.drive.phase, bits=self.bits))
            field = propagate(drive, asked.grid, acoustics=acoustics)
            error.append(part.error)
            # A silent target is played as silence, so its error is 0 for any phases.
            rounded.append(np.where(wanted_here.any(axis=1), relative_error(field, wanted_here), 0.0))
        focus = focus_amplitude(asked.grid, self.array, acoustics=acoustics)
        return Found(
            error=np.concatenate(error),
            rounded_error=np.concatenate(rounded),
            strength=float(asked.amplitude.max() / focus),
        )
