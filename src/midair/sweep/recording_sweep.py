"""A sweep over recordings and settings: E of every frame of each recording under each choice of settings."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from midair.errors import InputError
from midair.lazy_frames import blocks
from midair.model import PressureFrames, Provenance, TransducerArray
from midair.physics import propagate, quantise_phase, relative_error
from midair.pipeline import reproduce
from midair.settings import Settings
from midair.solvers import solver as solver_of
from midair.sweep.task import Coordinate, Found, Job, Task, settings_of
from midair.sweep.trial_cut import TrialCut, is_cut


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SweepTrial:
    """One recording under one choice of settings.

    Attributes
    ----------
    recording : str
        What to call the recording.
    variant : str
        What is varied, such as ``method=fast height=200mm``; empty where nothing is.
    pressure : PressureFrames
        What the sensor felt, in the settings' band and at their rate.
    settings : Settings
        Settings of every stage.
    """

    recording: str
    variant: str
    pressure: PressureFrames
    settings: Settings


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RecordingSweep:
    """Every frame of every trial.

    A task is a whole trial, since frames may start from those before; but for trials by a solver of recordings as a
    whole, which are cut into pieces of its own blocks.

    Attributes
    ----------
    trials : tuple of SweepTrial
        The conditions.
    columns, rows : int
        Units of the array.
    bits : int
        Number of bits to which phases are rounded for the second error; 8 in an AUTD3.
    blocks : int
        Blocks of "glide" a task. Each task solves the marks of one block more, so that a few are better than one.
    cuts : tuple of TrialCut or None
        How each trial is cut; None for those that are one task.

    Raises
    ------
    InputError
        If there are no trials, one comes twice, or its solver does not take its settings.
    """

    trials: tuple[SweepTrial, ...]
    columns: int = 2
    rows: int = 2
    bits: int = 8
    blocks: int = 4
    cuts: tuple[TrialCut | None, ...] = field(init=False)

    def __post_init__(self) -> None:
        if not self.trials:
            raise InputError("sweep: expected at least one recording, got none")
        if not 1 <= self.bits <= 16:
            raise InputError(f"sweep: expected 1 to 16 bits, got {self.bits}")
        if self.blocks < 1:
            raise InputError(f"sweep: expected 1 block a task or more, got {self.blocks}")
        names = [(trial.recording, trial.variant) for trial in self.trials]
        for recording, variant in set(names):
            if names.count((recording, variant)) > 1:
                raise InputError(f"sweep: expected each recording and setting once, got {recording} {variant} twice")
        for settings in (trial.settings for trial in self.trials):
            # A setting that a method does not take fails here, and not on a worker.
            solver_of(settings.solver.method, iterations=settings.solver.iterations, start=settings.solver.start)
        object.__setattr__(self, "cuts", tuple(self._cut(trial) for trial in self.trials))

    @property
    def kind(self) -> str:
        """Name of the kind."""
        return "recordings"

    @property
    def item(self) -> str:
        """Name of what the second axis counts: places where frames do not stand in their own order."""
        return "place" if self._in_pieces else "frame"

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of conditions and of frames, with room for the longest task in place of each."""
        return len(self.trials), self.chunk * max(map(len, self._parts()))

    @property
    def chunk(self) -> int:
        """Most frames a task: those of the longest trial, or piece of one."""
        return max(last - first for parts in self._parts() for first, last in parts)

    def tasks(self) -> tuple[Task, ...]:
        """The longest trial first, so that no process is left with a long one at the end; its pieces in order.

        Each has `chunk` places in the store, of which the frames take the first.
        """
        width = self.chunk
        whole = [
            Task(condition=n, first=width * number, last=width * number + last - first)
            for n, parts in enumerate(self._parts())
            for number, (first, last) in enumerate(parts)
        ]
        return tuple(sorted(whole, key=lambda task: -self.trials[task.condition].pressure.frames))

    def job(self, task: Task) -> Job:
        """What a worker is given."""
        cut, array = self.cuts[task.condition], self._array()
        if cut is not None:
            return cut.job(task.first // self.chunk, array, self.bits)
        return TrialJob(trial=self.trials[task.condition], array=array, bits=self.bits)

    def coordinates(self) -> tuple[Coordinate, ...]:
        """Number of the recording and of the variant of each condition; the attributes name them.

        Where a trial is in pieces, which frame stands at which place.
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
        """Settings of every trial, and a digest of its pressure."""
        return {
            "columns": self.columns,
            "rows": self.rows,
            "bits": self.bits,
            "trials": [
                {
                    "recording": trial.recording,
                    "variant": trial.variant,
                    "frames": trial.pressure.frames,
                    # Another pressure under the same name is another sweep.
                    "pressure_sha256": _digest(trial.pressure),
                    # How many cores this computer has is no part of it.
                    "settings": settings_of(trial.settings.but(jobs=None)),
                }
                for trial in self.trials
            ],
        } | ({"blocks": self.blocks} if self._in_pieces else {})

    def provenance(self) -> Provenance:
        """Where the results come from: fields that are computed, not measured."""
        names = ", ".join(dict.fromkeys(trial.recording for trial in self.trials))
        return Provenance(source=names, simulated=True).then("sweep", {"bits": self.bits, "trials": len(self.trials)})

    def _numbered(self, name: str, values: Sequence[str]) -> Coordinate:
        different = list(dict.fromkeys(values))
        numbers = np.array([different.index(value) for value in values])
        return Coordinate(name=name, axes=("condition",), values=numbers, attributes={"names": different})

    def _array(self) -> TransducerArray:
        return TransducerArray.autd3(columns=self.columns, rows=self.rows)

    def _cut(self, trial: SweepTrial) -> TrialCut | None:
        if not is_cut(trial.settings):
            return None
        return TrialCut.of(trial.pressure, self._array(), trial.settings, together=self.blocks)

    @property
    def _in_pieces(self) -> bool:
        """Whether any trial is more than one task."""
        return max(map(len, self._parts())) > 1

    def _parts(self) -> list[list[tuple[int, int]]]:
        """First and last frame of each task of each trial."""
        return [
            [(0, trial.pressure.frames)] if cut is None else [(piece.first, piece.last) for piece in cut.pieces]
            for trial, cut in zip(self.trials, self.cuts, strict=True)
        ]

    def _places(self) -> tuple[Coordinate, ...]:
        """Which frame stands where, -1 for none; nothing where frames stand in order."""
        if not self._in_pieces:
            return ()
        parts, width = self._parts(), self.chunk
        frame = np.full(self.shape, -1)
        for row, of_trial in enumerate(parts):
            for number, (first, last) in enumerate(of_trial):
                frame[row, width * number : width * number + last - first] = np.arange(first, last)
        return (Coordinate(name="frame", axes=("condition", "place"), values=frame, attributes={}),)


def _digest(pressure: PressureFrames) -> str:
    """Of the numbers in memory's order, of an array or a reel."""
    made = hashlib.sha256()
    for block in blocks(pressure.pressure):
        made.update(np.ascontiguousarray(block).tobytes())
    return made.hexdigest()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrialJob:
    """A trial to be solved on a worker."""

    trial: SweepTrial
    array: TransducerArray
    bits: int

    def __call__(self) -> Found:
        """E of each frame, with phases as solved and as rounded."""
        settings = self.trial.settings
        made = reproduce(self.trial.pressure, self.array, settings)
        drive, wanted = made.solution.drive, made.target.amplitude
        rounded = propagate(
            replace(drive, phase=quantise_phase(drive.phase, bits=self.bits)),
            made.target.grid,
            acoustics=settings.acoustics,
        )
        # A silent target is played as silence, whatever its phases are.
        audible = wanted.any(axis=1)
        return Found(
            error=made.solution.error,
            rounded_error=np.where(audible, relative_error(rounded, wanted), 0.0),
            strength=made.strength(),
        )
