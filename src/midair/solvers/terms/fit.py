"""Where the error is measured: control points (paper, eq. 5), windows over the whole square, or the cells of a sensor.

A sensor measures one number per cell and frame; the control points are interpolated from them. Windows and cells
compare ``w_c^T |G q|^2`` with a mean pressure, where w_c is the share of each point in window or cell c. Cells hold for
one place of the sensor: 2 mm beside it the pressure between the cells is not controlled. Windows of the size of a cell,
at a third of the cells' pitch, give the reading of any cell at any place of the sensor. The squared field is
band-limited, so the weights are exact with the control points as samples; the target of a window is the exact mean of
the linearly interpolated pressure.
"""

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Literal

from midair.array_types import Array
from midair.model import ControlGrid, PressureFrames, SensorGrid
from midair.physics import SensorModel, cell_weights
from midair.solvers.problem import CellTarget
from midair.validation import frozen_array, positive


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cells:
    """Cells of a sensor, and optionally their target pressures."""

    sensor: SensorModel = field(default_factory=SensorModel)
    """Its grid, aperture and spread give the weights."""
    pressure: PressureFrames | None = None
    """Target pressure of the cells, 0 or more, in Pa. If None, it is computed from the target at the control points."""

    def target(self, amplitude: Array, grid: ControlGrid, unit: float, at: ControlGrid | None = None) -> CellTarget:
        """The weights, and the target pressures for an amplitude (frame, point) in units of the focus.

        `unit` is the radiation pressure in Pa of an amplitude of 1; the field is sampled `at` the points of another
        grid, if there is one. ShapeError if `pressure` has other frames or cells.
        """
        # Radiation pressure is proportional to the squared amplitude and interpolated linearly.
        wanted = amplitude**2 @ cell_weights(self.sensor, grid, centre=grid.centre, between="lines").T
        if self.pressure is not None:
            given = self.pressure.pressure.reshape(self.pressure.frames, -1)
            wanted = frozen_array(given / unit, "pressure of the cells", wanted.shape)
        weights = cell_weights(self.sensor, at or grid, centre=grid.centre, between="waves")
        return CellTarget(weights=weights, wanted=wanted)


@dataclass(frozen=True, slots=True, kw_only=True)
class Windows:
    """Windows over the control points; 13 x 13 over the paper's 16 x 16."""

    aperture: float = 8e-3
    """Side of the square over which a window averages, in m."""
    spread: float = 1e-3
    """Standard deviation in m of the Gaussian with which skin, or gel, spreads a point of pressure."""
    pitch: float = 11e-3 / 3
    """Distance between windows in m; below half the aperture the windows leave no gaps."""
    inset: float = 5.5e-3
    """Distance in m from the outermost control points, with pressure zero, to the middle of the outermost windows."""
    faint: float = 1e-3
    """Smallest pressure, over that of the focus, to which errors are relative: that of 996 transducers with random
    phases.
    """

    def __post_init__(self) -> None:
        for name in ("aperture", "spread", "pitch", "inset"):
            positive(getattr(self, name), f"{name} of the windows", "m")

    @classmethod
    def fine(cls) -> "Windows":
        """Windows of half a cell, which overlap by half; 19 x 19 over the paper's 16 x 16 points."""
        return cls(aperture=5.5e-3, pitch=2.75e-3, inset=2.75e-3)

    def places(self, grid: ControlGrid) -> SensorModel:
        """The windows over a control grid, as the cells of a sensor."""
        rows, columns = (self._count(points, grid.pitch) for points in (grid.rows, grid.columns))
        sensor = SensorGrid(rows=rows, columns=columns, pitch=self.pitch, name="windows")
        return SensorModel(grid=sensor, aperture=self.aperture, spread=self.spread)

    def target(self, amplitude: Array, grid: ControlGrid, unit: float, at: ControlGrid | None = None) -> CellTarget:  # noqa: ARG002
        """As `Cells.target`."""
        # Kept up to 16 MB, since those of a large grid would fill the memory.
        small = self.places(grid).grid.count * grid.count <= 2**21
        weights = _window_weights if small else _window_weights.__wrapped__
        # Radiation pressure is proportional to the squared amplitude.
        wanted = amplitude**2 @ weights(self, grid, grid, "lines").T
        return CellTarget(weights=weights(self, grid, at or grid, "waves"), wanted=wanted, faint=self.faint)

    def _count(self, points: int, pitch: float) -> int:
        """Number of windows along an axis with this many control points."""
        free = (points - 1) * pitch - 2 * self.inset
        # 1e-9 keeps the last window despite rounding.
        return 1 + max(int(free / self.pitch + 1e-9), 0)


# Each part of a recording has the same windows.
@lru_cache(maxsize=8)
def _window_weights(windows: Windows, grid: ControlGrid, at: ControlGrid, between: Literal["lines", "waves"]) -> Array:
    """Weights in the windows over a grid of the points `at` another one, read-only."""
    made = cell_weights(windows.places(grid), at, centre=grid.centre, between=between)
    made.flags.writeable = False
    return made


FitName = Literal["points", "windows", "fine-windows", "cells"]
"""Control points, as in the paper; windows of 8 or 5.5 mm over the square; or the cells of a sensor at one place."""

Fit = FitName | Windows | Cells
"""Where the error is measured, by name or as an object."""


def pressure_means(fit: Fit) -> Windows | Cells | None:
    """The windows or cells of a fit; None for "points"."""
    if isinstance(fit, Windows | Cells):
        return fit
    return {"points": None, "windows": Windows(), "fine-windows": Windows.fine(), "cells": Cells()}[fit]
