"""A sweep over binary patterns: patterns, strengths, heights, and the solver."""

from dataclasses import dataclass, field
from functools import partial
from itertools import product
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from midair.datasets import binary_patterns, channel_amplitudes
from midair.files import to_plain
from midair.model import HEIGHT, RATE, Acoustics, AmplitudeFrames, ControlGrid, Medium, SensorGrid, TransducerArray
from midair.physics import focus_amplitude
from midair.solvers import solve
from midair.solvers import solver as solver_of
from midair.sweep.tasks import Job, Task, errors_of
from midair.targets import interpolation_matrix
from midair.validation import positive, within


@dataclass(frozen=True, slots=True, kw_only=True)
class PatternSweep:
    """The paper's experiment 5.1: binary patterns over strengths and heights. The defaults are the whole experiment."""

    kind: ClassVar[str] = "patterns"
    strengths: tuple[float, ...] = (0.1, 0.2)  # Target peaks over the peak of a single focus of the whole array
    heights: tuple[float, ...] = (HEIGHT,)  # Height of the control points above the array, in m
    count: int = 65535  # Patterns for each pair of strength and height, of 65535
    seed: int = 2024  # Seed of the random order of the patterns; the first few are a representative sample
    method: str = "fast"  # Name in `solvers.METHODS`
    iterations: int | None = None  # Default of the method if None
    acoustics: Acoustics = field(default_factory=lambda: Acoustics(medium=Medium(attenuation=0.0), directivity="point"))
    bits: int = 8  # Bits of the rounded phases for the second error; 8 in an AUTD3
    chunk: int = 512  # Patterns per task; methods may treat the patterns of a batch together

    def __post_init__(self) -> None:
        for name, unit in (("strengths", ""), ("heights", "m")):
            within(len(getattr(self, name)), f"sweep: number of {name}", 1)
            for value in getattr(self, name):
                positive(value, name, unit)
        within(self.count, "patterns", 1, 65535)
        within(self.chunk, "sweep: chunk", 1)
        within(self.bits, "sweep: bits", 1, 16)
        # Check the settings of the method here, not on a worker.
        solver_of(self.method, iterations=self.iterations, start="zero")

    def settings(self) -> dict[str, Any]:
        """All fields as JSON values, for `from_plain`."""
        return to_plain(self)

    def conditions(self) -> list[tuple[float, float]]:
        """Each pair of height and strength once."""
        return list(dict.fromkeys(product(self.heights, self.strengths)))

    def patterns(self) -> NDArray[np.int64]:
        """Patterns of all conditions, shape (pattern,), bit k for channel k."""
        return binary_patterns(self.count, seed=self.seed)

    def tasks(self) -> list[Task]:
        """All tasks in processing order: the first patterns of every condition come first."""
        firsts, conditions = range(0, self.count, self.chunk), range(len(self.conditions()))
        return [Task(one, first, min(first + self.chunk, self.count)) for first in firsts for one in conditions]

    def job(self, task: Task) -> Job:
        """Job of a worker."""
        return partial(_solve, self, *self.conditions()[task.condition], slice(*task[1:]))


def _solve(sweep: PatternSweep, height: float, strength: float, some: slice) -> dict[str, Any]:
    """Solve patterns independently: 1 at active channels, interpolated to the control points (paper, 4.1)."""
    array, grid, sensor = TransducerArray.autd3(), ControlGrid(height=height), SensorGrid()
    shape = channel_amplitudes(sweep.patterns()[some], sensor) @ interpolation_matrix(sensor, grid).T
    focus = focus_amplitude(grid, array, acoustics=sweep.acoustics)
    target = AmplitudeFrames(amplitude=strength * focus * shape, rate=RATE, grid=grid)
    method: Any = {"method": sweep.method, "iterations": sweep.iterations, "start": "zero"}
    return errors_of(target, [solve(target, array, acoustics=sweep.acoustics, **method)], sweep.bits)
