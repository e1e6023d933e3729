"""A sweep over recordings and settings: E of every frame of each recording under each choice of settings."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from midair.errors import InputError
from midair.flow import reproduce
from midair.model import PressureFrames, Provenance, TransducerArray
from midair.physics import propagate, quantise_phase, relative_error
from midair.settings import Settings
from midair.solvers import solver as solver_of
from midair.sweep.task import Coordinate, Found, Task, settings_of


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
    """Every frame of every trial. A task is a whole trial, since frames may start from those before.

    Attributes
    ----------
    trials : tuple of SweepTrial
        The conditions.
    columns, rows : int
        Units of the array.
    bits : int
        Number of bits to which phases are rounded for the second error; 8 in an AUTD3.

    Raises
    ------
    InputError
        If there are no trials, one comes twice, or its solver does not take its settings.
    """

    trials: tuple[SweepTrial, ...]
    columns: int = 2
    rows: int = 2
    bits: int = 8

    def __post_init__(self) -> None:
        if not self.trials:
            raise InputError("sweep: expected at least one recording, got none")
        if not 1 <= self.bits <= 16:
            raise InputError(f"sweep: expected 1 to 16 bits, got {self.bits}")
        names = [(trial.recording, trial.variant) for trial in self.trials]
        for recording, variant in set(names):
            if names.count((recording, variant)) > 1:
                raise InputError(f"sweep: expected each recording and setting once, got {recording} {variant} twice")
        for settings in (trial.settings for trial in self.trials):
            # A setting that a method does not take fails here, and not on a worker.
            solver_of(settings.solver.method, iterations=settings.solver.iterations, start=settings.solver.start)

    @property
    def kind(self) -> str:
        """Name of the kind."""
        return "recordings"

    @property
    def item(self) -> str:
        """Name of what the second axis counts."""
        return "frame"

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of conditions and of frames, which are those of the longest trial."""
        return len(self.trials), max(trial.pressure.frames for trial in self.trials)

    @property
    def chunk(self) -> int:
        """Most frames a task: those of the longest trial."""
        return self.shape[1]

    def tasks(self) -> tuple[Task, ...]:
        """One a trial, the longest first, so that no process is left with a long one at the end."""
        whole = [Task(condition=n, first=0, last=trial.pressure.frames) for n, trial in enumerate(self.trials)]
        return tuple(sorted(whole, key=lambda task: -task.last))

    def job(self, task: Task) -> "TrialJob":
        """What a worker is given."""
        array = TransducerArray.autd3(columns=self.columns, rows=self.rows)
        return TrialJob(trial=self.trials[task.condition], array=array, bits=self.bits)

    def coordinates(self) -> tuple[Coordinate, ...]:
        """Number of the recording and of the variant of each condition; the attributes name them."""
        return (
            self._numbered("recording", [trial.recording for trial in self.trials]),
            self._numbered("variant", [trial.variant for trial in self.trials]),
            Coordinate(
                name="rate",
                axis="condition",
                values=np.array([trial.pressure.rate for trial in self.trials]),
                attributes={"units": "Hz"},
            ),
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
                    "pressure_sha256": hashlib.sha256(trial.pressure.pressure.tobytes()).hexdigest(),
                    "settings": settings_of(trial.settings),
                }
                for trial in self.trials
            ],
        }

    def provenance(self) -> Provenance:
        """Where the results come from: fields that are computed, not measured."""
        names = ", ".join(dict.fromkeys(trial.recording for trial in self.trials))
        return Provenance(source=names, simulated=True).then("sweep", {"bits": self.bits, "trials": len(self.trials)})

    def _numbered(self, name: str, values: Sequence[str]) -> Coordinate:
        different = list(dict.fromkeys(values))
        numbers = np.array([different.index(value) for value in values])
        return Coordinate(name=name, axis="condition", values=numbers, attributes={"names": different})


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
