"""A sweep over binary patterns: patterns, strengths, heights, and the solver."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import partial
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.datasets import binary_patterns, channel_amplitudes
from midair.errors import InputError
from midair.files import from_plain
from midair.model import HEIGHT, Acoustics, ControlGrid, Medium, Provenance, SensorGrid, Setting, TransducerArray
from midair.physics import quantise_phase, transfer_matrix
from midair.solvers import Problem, error_of, one_blas_thread, spreading_phase
from midair.solvers import solver as solver_of
from midair.sweep.storage import Coordinate, Found, Job, Task, settings_of
from midair.targets import interpolation_matrix
from midair.validation import positive


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """One strength at one height, for the first `count` patterns."""

    strength: float
    """Target peak over the peak of a single focus of the whole array at this height."""
    height: float
    """Height of the control points above the array, in m."""
    count: int


@dataclass(frozen=True, slots=True, kw_only=True)
class PatternSweep:
    """The paper's experiment 5.1: binary patterns over strengths and heights. The defaults are the whole experiment."""

    kind: ClassVar[str] = "patterns"
    """Kind of the sweep."""
    item: ClassVar[str] = "pattern"
    """Name of the items along the second axis."""
    strengths: tuple[float, ...] = (0.1, 0.2)
    """Every pattern is solved at each pair of strength and height."""
    heights: tuple[float, ...] = (HEIGHT,)
    """In m."""
    count: int = 65535
    """Number of patterns, of 65535."""
    curve_strengths: tuple[float, ...] = (0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4)
    """Strengths of the curve at the first height."""
    curve_heights: tuple[float, ...] = (0.15, 0.175, 0.2, 0.225, 0.25, 0.275, 0.3)
    """Heights in m of the curves at each of `strengths`."""
    curve_count: int = 512
    """Number of patterns for the curves, the first ones; 0 for no curves."""
    seed: int = 2024
    """Seed of the random order of the patterns; the first few are a representative sample."""
    method: str = "fast"
    """Name in `solvers.METHODS`."""
    iterations: int | None = None
    """Default of the method if None."""
    acoustics: Acoustics = field(default_factory=lambda: Acoustics(medium=Medium(attenuation=0.0), directivity="point"))
    """Point sources without attenuation, as in the paper's simulation."""
    columns: int = 2
    """Units of the array per row."""
    rows: int = 2
    """Rows of units of the array."""
    bits: int = 8
    """Bits of the rounded phases for the second error; 8 in an AUTD3."""
    chunk: int = 512
    """Patterns per task; affects the results, because methods may treat the patterns of a batch together."""

    def __post_init__(self) -> None:
        for name, unit in (("strengths", ""), ("heights", "m"), ("curve_strengths", ""), ("curve_heights", "m")):
            values = tuple(positive(float(value), name, unit) for value in getattr(self, name))
            object.__setattr__(self, name, values)
        if not self.strengths or not self.heights:
            raise InputError("sweep: expected at least one strength and one height, got none")
        if not 1 <= self.count <= 65535 or not 0 <= self.curve_count <= 65535:
            raise InputError(f"patterns: expected 1 to 65535 (curves: from 0), got {self.count}, {self.curve_count}")
        if self.chunk < 1 or not 1 <= self.bits <= 16:
            raise InputError(f"sweep: expected chunk 1 or more and 1 to 16 bits, got {self.chunk} and {self.bits}")
        # Check the settings of the method here, not on a worker.
        solver_of(self.method, iterations=self.iterations, start="zero")

    @property
    def shape(self) -> tuple[int, int]:
        """Number of conditions and of patterns."""
        return len(self.conditions()), max(self.count, self.curve_count)

    @property
    def sensor(self) -> SensorGrid:
        """Sensor whose channels the patterns refer to."""
        return SensorGrid()

    def grid(self, height: float) -> ControlGrid:
        """The paper's control points at a height in m."""
        return ControlGrid(height=height)

    def patterns(self) -> NDArray[np.int64]:
        """Patterns of all conditions, shape (pattern,), bit k for channel k."""
        return binary_patterns(max(self.count, self.curve_count), seed=self.seed)

    def conditions(self) -> tuple[Condition, ...]:
        """Each pair of strength and height once, starting with those of all patterns."""
        asked = {(strength, height): self.count for height in self.heights for strength in self.strengths}
        curves = [(strength, self.heights[0]) for strength in self.curve_strengths]
        curves += [(strength, height) for strength in self.strengths for height in self.curve_heights]
        for pair in curves if self.curve_count else ():
            asked[pair] = max(self.curve_count, asked.get(pair, 0))
        return tuple(Condition(strength=s, height=h, count=count) for (s, h), count in asked.items())

    def tasks(self) -> tuple[Task, ...]:
        """All tasks in processing order: the first patterns of every condition come first."""
        whole = [
            Task(condition=number, first=first, last=min(first + self.chunk, condition.count))
            for number, condition in enumerate(self.conditions())
            for first in range(0, condition.count, self.chunk)
        ]
        return tuple(sorted(whole, key=lambda task: (task.first, task.condition)))

    def job(self, task: Task) -> Job:
        """Job of a worker."""
        return partial(_solve_task, self, self.conditions()[task.condition], self.patterns()[task.first : task.last])

    def coordinates(self) -> tuple[Coordinate, ...]:
        """Arrays that are stored along the axes."""
        strength = np.array([one.strength for one in self.conditions()])
        height = np.array([one.height for one in self.conditions()])
        return (
            Coordinate(name="strength", axes=("condition",), values=strength, attributes={}),
            Coordinate(name="height", axes=("condition",), values=height, attributes={"units": "m"}),
            Coordinate(
                name="pattern",
                axes=("pattern",),
                values=self.patterns(),
                attributes={"description": "bit k is channel k"},
            ),
        )

    def settings(self) -> dict[str, Any]:
        """Everything that affects the results, including the solver's own settings, as JSON values."""
        solver = solver_of(self.method, iterations=self.iterations, start="zero")
        return settings_of(self) | {"solver": settings_of(solver)}

    @classmethod
    def of_settings(cls, settings: Mapping[str, Any]) -> "PatternSweep":
        """Create the sweep from its `settings`."""
        said: dict[str, Any] = {
            name: tuple(value) if isinstance(value, list) else value for name, value in settings.items()
        }
        said["acoustics"] = from_plain(Acoustics, settings["acoustics"])
        del said["solver"]
        return cls(**said)

    def provenance(self) -> Provenance:
        """Provenance of the results, which are simulated."""
        settings: dict[str, Setting] = {
            name: value
            for name, value in ((one.name, getattr(self, one.name)) for one in fields(self))
            if isinstance(value, str | int | float | tuple)
        }
        return Provenance(source="virtual:binary patterns", simulated=True).then("sweep", settings)


def _solve_task(sweep: PatternSweep, condition: Condition, patterns: NDArray[np.int64]) -> Found:
    """E of each pattern of one condition, on a worker."""
    solved = solve_patterns(sweep, condition, patterns)
    return Found(error=solved.error, rounded_error=solved.rounded_error, strength=condition.strength)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solved:
    """Solution of a task: phases (pattern, transducer) in rad, levels 0 to 1, E with exact and rounded phases."""

    phase: Array
    level: Array
    error: Array
    rounded_error: Array


def problem_of(sweep: PatternSweep, condition: Condition, patterns: NDArray[np.int64]) -> Problem:
    """Targets and transfer matrix, normalised by the peak of a single focus.

    A pattern is 1 at its active channels; it is interpolated to the control points (paper, 4.1) and multiplied by the
    strength.
    """
    array, grid = TransducerArray.autd3(columns=sweep.columns, rows=sweep.rows), sweep.grid(condition.height)
    G = transfer_matrix(grid, array, acoustics=sweep.acoustics)
    shape = channel_amplitudes(patterns, sweep.sensor) @ interpolation_matrix(sweep.sensor, grid).T
    return Problem(
        G=G / np.abs(G).sum(axis=1).max(),
        amplitude=condition.strength * shape,
        psi=spreading_phase(grid, array, sweep.acoustics.medium),
    )


def solve_patterns(sweep: PatternSweep, condition: Condition, patterns: NDArray[np.int64]) -> Solved:
    """Solve the patterns of one condition independently."""
    problem = problem_of(sweep, condition, patterns)
    with one_blas_thread():
        answer = solver_of(sweep.method, iterations=sweep.iterations, start="zero").solve(problem)
        rounded = quantise_phase(answer.phase, bits=sweep.bits)
        return Solved(
            phase=answer.phase,
            level=np.ones(len(patterns)) if answer.level is None else answer.level,
            error=error_of(problem, answer.phase, answer.level),
            rounded_error=error_of(problem, rounded, answer.level),
        )
