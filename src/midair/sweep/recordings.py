"""A sweep over recordings and settings: E of every frame of each recording with each choice of settings."""

import hashlib
import json
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Any, ClassVar

from midair.errors import InputError
from midair.model import PressureFrames, TransducerArray
from midair.pipeline import reproduce_stream
from midair.settings import Settings
from midair.sweep.tasks import Job, Task, errors_of
from midair.validation import within


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SweepTrial:
    """One recording with one choice of settings."""

    recording: str  # Name of the recording
    variant: str  # Varied settings, such as "method=fast height=200mm"; may be empty
    pressure: PressureFrames  # In the settings' band and at their rate
    settings: Settings  # those of every stage

    @property
    def digest(self) -> str:
        """SHA-256 of the pressure's samples in memory order."""
        return hashlib.sha256(self.pressure.pressure.tobytes()).hexdigest()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RecordingSweep:
    """Every frame of every trial; a task is a trial, because frames may start from earlier ones.

    Raises InputError if there are no trials, one occurs twice, or its solver does not support its settings.
    """

    kind: ClassVar[str] = "recordings"
    trials: tuple[SweepTrial, ...]
    bits: int = 8  # Bits of the rounded phases for the second error; 8 in an AUTD3
    array: TransducerArray = field(default_factory=TransducerArray.autd3)

    def __post_init__(self) -> None:
        if not self.trials:
            raise InputError("sweep: expected at least one recording, got none")
        within(self.bits, "sweep: bits", 1, 16)
        names = [(trial.recording, trial.variant) for trial in self.trials]
        if twice := [" ".join(name) for name in names if names.count(name) > 1]:
            raise InputError(f"sweep: expected each recording and setting once, got {twice[0]} twice")
        for trial in self.trials:
            # Check the settings of the method here, not on a worker.
            trial.settings.solver.solver()

    def settings(self) -> dict[str, Any]:
        """Settings of every trial, and a hash of its pressure, which detects another pressure with the same name."""
        trials = [
            {"recording": one.recording, "variant": one.variant, "frames": one.pressure.frames}
            # The number of cores does not affect the results.
            | {"sha256": one.digest, "settings": asdict(one.settings.but(jobs=None))}
            for one in self.trials
        ]
        return json.loads(json.dumps({"array": self.array.name, "bits": self.bits, "trials": trials}, default=str))

    def tasks(self) -> list[Task]:
        """All tasks, the longest first so that no process is left with a long one at the end."""
        tasks = [Task(number, 0, trial.pressure.frames) for number, trial in enumerate(self.trials)]
        return sorted(tasks, key=lambda task: -task.last)

    def job(self, task: Task) -> Job:
        """Job of a worker."""
        return partial(_solve, self.trials[task.condition], self.array, self.bits)


def _solve(trial: SweepTrial, array: TransducerArray, bits: int) -> dict[str, Any]:
    return errors_of(*reproduce_stream(trial.pressure, array, trial.settings), bits)
