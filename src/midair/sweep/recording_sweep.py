"""A sweep over recordings and settings: E of every frame of each recording with each choice of settings.

Trials are cut into pieces at frames where their solver can start independently.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, ClassVar

import numpy as np

from midair.array_types import Array
from midair.errors import InputError
from midair.model import Acoustics, AmplitudeFrames, Drive, PressureFrames, Provenance, TransducerArray
from midair.physics import check_frame_rate, focus_amplitude, propagate, quantise_phase, relative_error
from midair.pipeline import reproduce, target_amplitude
from midair.settings import Settings
from midair.solvers import Glide, Piece, pieces, read_solver_blocks, solve_piece
from midair.solvers import solver as solver_of
from midair.streaming import blocks
from midair.sweep.storage import Coordinate, Found, Job, Task, settings_of
from midair.validation import within


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
        method = solver_of(settings.solver.method, backend=settings.solver.backend)
        if not isinstance(method, Glide):
            raise TypeError(f"expected settings with method glide, got {settings.solver.name}")
        check_frame_rate(pressure.rate, array.frequency)
        target = target_amplitude(replace(pressure, provenance=settings.noted(pressure.provenance)), settings)
        sounds = np.concatenate([block.any(axis=1) for block in blocks(target.amplitude, 256)])
        return cls(target=target, settings=settings, pieces=tuple(pieces(method, sounds, together=together)))

    def job(self, number: int, array: TransducerArray, bits: int) -> Job:
        """Job for one piece: its targets and those of the marks before it."""
        piece = self.pieces[number]
        begin = int(piece.marks[0]) if len(piece.marks) else piece.first
        frames = read_solver_blocks(self.target.amplitude, begin, piece.last)
        target, marks = replace(self.target, amplitude=frames[piece.first - begin :]), frames[piece.marks - begin]
        return partial(_solve_piece, target, marks, self.loudest, self.settings.but(jobs=1), array, bits)

    @cached_property
    def loudest(self) -> float:
        """Highest amplitude of the recording for level "auto"; otherwise 0."""
        return float(self.target.amplitude.max()) if self.settings.solver.level == "auto" else 0.0


def _solve_piece(
    target: AmplitudeFrames, marks: Array, loudest: float, settings: Settings, array: TransducerArray, bits: int
) -> Found:
    """E of each frame of a piece, with exact and with rounded phases, on a worker.

    `marks` are the targets of the marks before it, shape (mark, point), in Pa.
    """
    error, rounded, first, acoustics = list[Array](), list[Array](), 0, settings.acoustics
    for part in solve_piece(target, array, settings.solver, marks=marks, loudest=loudest, acoustics=acoustics):
        here = replace(target, amplitude=target.amplitude[first : first + len(part.error)])
        first += len(part.error)
        error.append(part.error)
        rounded.append(_rounded_error(part.drive, here, acoustics, bits))
    focus = focus_amplitude(target.grid, array, acoustics=acoustics)
    strength = float(target.amplitude.max() / focus)
    return Found(error=np.concatenate(error), rounded_error=np.concatenate(rounded), strength=strength)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SweepTrial:
    """One recording with one choice of settings."""

    recording: str
    """Name of the recording."""
    variant: str
    """Varied settings, such as ``method=fast height=200mm``; may be empty."""
    pressure: PressureFrames
    """Recorded pressure in the settings' band and at their rate."""
    settings: Settings
    """Settings of every stage."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RecordingSweep:
    """Every frame of every trial.

    A task is usually a whole trial, because frames may start from earlier ones. Trials with a solver of whole
    recordings are cut into pieces of its blocks. Raises InputError if there are no trials, one occurs twice, or its
    solver does not support its settings.
    """

    kind: ClassVar[str] = "recordings"
    """Kind of the sweep."""
    trials: tuple[SweepTrial, ...]
    """The conditions."""
    columns: int = 2
    """Units of the array per row."""
    rows: int = 2
    """Rows of units of the array."""
    bits: int = 8
    """Bits of the rounded phases for the second error; 8 in an AUTD3."""
    blocks: int = 4
    """Blocks of "glide" per task. Each task solves the marks of one more block, so a few blocks are better than one."""
    cuts: tuple[TrialCut | None, ...] = field(init=False)
    """Pieces of each trial; None for a trial that is one task."""

    def __post_init__(self) -> None:
        if not self.trials:
            raise InputError("sweep: expected at least one recording, got none")
        within(self.bits, "sweep: bits", 1, 16)
        within(self.blocks, "sweep: blocks per task", 1)
        names = [(trial.recording, trial.variant) for trial in self.trials]
        for recording, variant in set(names):
            if names.count((recording, variant)) > 1:
                raise InputError(f"sweep: expected each recording and setting once, got {recording} {variant} twice")
        for settings in (trial.settings for trial in self.trials):
            # Check the settings of the method here, not on a worker.
            solver_of(settings.solver.method, iterations=settings.solver.iterations, start=settings.solver.start)
        object.__setattr__(self, "cuts", tuple(self._cut(trial) for trial in self.trials))

    @property
    def item(self) -> str:
        """Name of the items along the second axis: places if the frames are not stored in order."""
        return "place" if self._in_pieces else "frame"

    @property
    def shape(self) -> tuple[int, int]:
        """Number of conditions and of frames, with room for the longest task in every task's place."""
        return len(self.trials), self.chunk * max(map(len, self._parts()))

    @property
    def chunk(self) -> int:
        """Most frames per task: those of the longest trial or piece."""
        return max(last - first for parts in self._parts() for first, last in parts)

    def tasks(self) -> tuple[Task, ...]:
        """All tasks, the longest trial first so that no process is left with a long one at the end; pieces in order.

        Each task has `chunk` places in the store; its frames use the first ones.
        """
        width = self.chunk
        whole = [
            Task(condition=n, first=width * number, last=width * number + last - first)
            for n, parts in enumerate(self._parts())
            for number, (first, last) in enumerate(parts)
        ]
        return tuple(sorted(whole, key=lambda task: -self.trials[task.condition].pressure.frames))

    def job(self, task: Task) -> Job:
        """Job of a worker."""
        cut, array = self.cuts[task.condition], self._array()
        if cut is not None:
            return cut.job(task.first // self.chunk, array, self.bits)
        return partial(_solve_trial, self.trials[task.condition], array, self.bits)

    def coordinates(self) -> tuple[Coordinate, ...]:
        """Index of recording and variant of each condition, with their names as attributes, and the rates.

        For trials in pieces also the frame at each place.
        """
        return (
            self._numbered("recording", [trial.recording for trial in self.trials]),
            self._numbered("variant", [trial.variant for trial in self.trials]),
            Coordinate(
                name="rate",
                axes=("condition",),
                values=np.array([trial.pressure.rate for trial in self.trials]),
                attributes={"units": "Hz"},
            ),
            *self._places(),
        )

    def settings(self) -> dict[str, Any]:
        """Settings of every trial, and a hash of its pressure."""
        return {
            "columns": self.columns,
            "rows": self.rows,
            "bits": self.bits,
            "trials": [
                {
                    "recording": trial.recording,
                    "variant": trial.variant,
                    "frames": trial.pressure.frames,
                    # Detects another pressure with the same name.
                    "pressure_sha256": _digest(trial.pressure),
                    # The number of cores does not affect the results.
                    "settings": settings_of(trial.settings.but(jobs=None)),
                }
                for trial in self.trials
            ],
        } | ({"blocks": self.blocks} if self._in_pieces else {})

    def provenance(self) -> Provenance:
        """Provenance of the results, which are computed, not measured."""
        names = ", ".join(dict.fromkeys(trial.recording for trial in self.trials))
        return Provenance(source=names, simulated=True).then("sweep", {"bits": self.bits, "trials": len(self.trials)})

    def _numbered(self, name: str, values: Sequence[str]) -> Coordinate:
        different = list(dict.fromkeys(values))
        numbers = np.array([different.index(value) for value in values])
        return Coordinate(name=name, axes=("condition",), values=numbers, attributes={"names": different})

    def _array(self) -> TransducerArray:
        return TransducerArray.autd3(columns=self.columns, rows=self.rows)

    def _cut(self, trial: SweepTrial) -> TrialCut | None:
        if trial.settings.solver.name != "glide":  # another solver cannot start within a recording
            return None
        return TrialCut.of(trial.pressure, self._array(), trial.settings, together=self.blocks)

    @property
    def _in_pieces(self) -> bool:
        """True if any trial has more than one task."""
        return max(map(len, self._parts())) > 1

    def _parts(self) -> list[list[tuple[int, int]]]:
        """First and last frame of each task of each trial."""
        return [
            [(0, trial.pressure.frames)] if cut is None else [(piece.first, piece.last) for piece in cut.pieces]
            for trial, cut in zip(self.trials, self.cuts, strict=True)
        ]

    def _places(self) -> tuple[Coordinate, ...]:
        """Frame at each place, -1 for none; empty if all frames are stored in order."""
        if not self._in_pieces:
            return ()
        parts, width = self._parts(), self.chunk
        frame = np.full(self.shape, -1)
        for row, of_trial in enumerate(parts):
            for number, (first, last) in enumerate(of_trial):
                frame[row, width * number : width * number + last - first] = np.arange(first, last)
        return (Coordinate(name="frame", axes=("condition", "place"), values=frame, attributes={}),)


def _digest(pressure: PressureFrames) -> str:
    """SHA-256 of the pressure's samples in memory order."""
    made = hashlib.sha256()
    for block in blocks(pressure.pressure):
        made.update(np.ascontiguousarray(block).tobytes())
    return made.hexdigest()


def _solve_trial(trial: SweepTrial, array: TransducerArray, bits: int) -> Found:
    """E of each frame of a trial, with exact and with rounded phases, on a worker."""
    made = reproduce(trial.pressure, array, trial.settings)
    rounded = _rounded_error(made.solution.drive, made.target, trial.settings.acoustics, bits)
    return Found(error=made.solution.error, rounded_error=rounded, strength=made.strength())


def _rounded_error(drive: Drive, target: AmplitudeFrames, acoustics: Acoustics, bits: int) -> Array:
    """E of each frame with phases rounded to `bits`."""
    rounded = replace(drive, phase=quantise_phase(drive.phase, bits=bits))
    field = propagate(rounded, target.grid, acoustics=acoustics)
    # A silent target is played as silence, so its error is 0 for any phases.
    return np.where(target.amplitude.any(axis=1), relative_error(field, target.amplitude), 0.0)
