"""A target and an array in normalised units, in which tolerances and weights suit any array."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from midair.model import Acoustics, AmplitudeFrames, TransducerArray
from midair.physics import radiation_pressure, transfer_matrix
from midair.solvers.initial_phase import spreading_phase
from midair.solvers.problem import Problem
from midair.solvers.terms import (
    Cells,
    Guard,
    GuardField,
    QuietEars,
    QuietPalm,
    Windows,
    automatic_level,
    psi_at_temperatures,
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NormalisedSetup:
    """Target and transfer matrices in units of the strongest focus, in the nominal air and optionally in others."""

    target: AmplitudeFrames
    array: TransducerArray
    airs: tuple[Acoustics, ...]
    G: list[NDArray[np.complex128]]
    focus: float

    @classmethod
    def of(cls, target: AmplitudeFrames, array: TransducerArray, airs: tuple[Acoustics, ...]) -> "NormalisedSetup":
        """Compute the matrix for each air, divided by the strongest focus in the first."""
        G = [transfer_matrix(target.grid, array, acoustics=each) for each in airs]
        focus = float(np.abs(G[0]).sum(axis=1).max())
        for each in G:
            each /= focus
        return cls(target=target, array=array, airs=airs, G=G, focus=focus)

    def problem(
        self,
        level: float | Literal["auto"],
        guard: Guard | None,
        means: Windows | Cells | None,
        smooth: float,
        ears: QuietEars | None,
        palm: QuietPalm | None,
    ) -> Problem:
        """The problem for a solver: the target in all airs, and the terms."""
        amplitude, grid, medium = self.target.amplitude / self.focus, self.target.grid, self.airs[0].medium
        unit = float(radiation_pressure(np.array(self.focus), medium))
        times = len(self.airs)
        return Problem(
            G=self.G[0] if times == 1 else np.concatenate(self.G),
            amplitude=np.tile(amplitude, (1, times)),
            level=automatic_level(amplitude) if level == "auto" else level,
            psi=psi_at_temperatures(self.G, spreading_phase(grid, self.array, medium)),
            guard=self._quiet(guard, ears, palm),
            cells=None if means is None else means.target(amplitude, grid, unit).repeated(times),
            smooth=smooth,
            position=self.array.position,
        )

    def _quiet(self, guard: Guard | None, ears: QuietEars | None, palm: QuietPalm | None) -> GuardField | None:
        """The guard's field: rows of the ring, the ears, and the palm around the control points."""
        field = None if guard is None else self._guarded(guard)
        none = GuardField(G=np.zeros((0, self.array.count), complex), ceiling=0.0, weight=1.0)
        # The error is a sum over M control points, so a mean over ears or palm is multiplied by M.
        count = np.sqrt(len(self.G[0])) / self.focus
        if ears is not None:
            rows = np.concatenate([ears.rows(self.array, each) for each in self.airs])
            field = (field or none).and_quiet(count * rows, ears.weight)
        if palm is not None:
            rows = np.concatenate([palm.rows(self.target.grid, self.array, each) for each in self.airs])
            field = (field or none).and_quiet(count * rows, palm.weight)
        return field

    def _guarded(self, guard: Guard) -> GuardField:
        ring = guard.ring(self.target.grid)
        G = np.concatenate([transfer_matrix(ring, self.array, acoustics=each) for each in self.airs])
        return GuardField(G=G / self.focus, ceiling=guard.ceiling, weight=guard.weight)
