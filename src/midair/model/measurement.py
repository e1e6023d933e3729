"""Uncertainty, crosstalk and linearity of a measured calibration.

Every uncertainty is a standard uncertainty (k = 1), as in the Guide to the expression of uncertainty in measurement
(GUM, JCGM 100:2008); twice its value covers about 95 %. Those from few readings are widened by Student's t.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError, ShapeError
from midair.model.reprs import clipped, counted, span, summary
from midair.validation import frozen_array

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Measurement:
    """Uncertainties of a calibration, bin by bin and channel by channel."""

    coherence: Array
    """Share of the output that the reference explains, 0 to 1, shape (bin, row, column)."""
    magnitude_uncertainty: Array
    """Relative uncertainty of the response's magnitude, including that of the reference, shape (bin, row, column)."""
    phase_uncertainty: Array
    """Uncertainty of the response's phase, shape (bin, row, column), in rad."""
    noise_density: Array
    """One-sided noise density of the output, shape (bin, row, column), in the calibration's unit per sqrt(Hz)."""
    noise_uncertainty: Array
    """Relative uncertainty of the calibration's `noise`, shape (row, column)."""
    delay: Array
    """Delay of each channel relative to the reference in the upper half of the bins, shape (row, column), in s."""
    delay_uncertainty: Array
    """Shape (row, column), in s."""
    reference_uncertainty: float = 0.0
    """Part of the relative magnitude uncertainty that all bins and channels share."""
    reference: str = ""
    """Name of the reference sensor or source."""
    method: str = ""
    """Description of the method."""
    takes: int = 1
    """Number of recordings that were used."""

    def __post_init__(self) -> None:
        bins = frozen_array(self.coherence, "coherence", ("bin", "row", "column"))
        object.__setattr__(self, "coherence", bins)
        for name in ("magnitude_uncertainty", "phase_uncertainty", "noise_density"):
            _freeze(self, name, bins.shape, least=0.0)
        _freeze(self, "delay", bins.shape[1:])
        for name in ("noise_uncertainty", "delay_uncertainty"):
            _freeze(self, name, bins.shape[1:], least=0.0)
        if bins.min() < -1e-9 or bins.max() > 1 + 1e-9:
            raise InputError(f"coherence: expected 0 to 1, got {bins.min():g} to {bins.max():g}")
        if not 0 <= self.reference_uncertainty < np.inf:
            raise InputError(f"reference uncertainty: expected 0 or more, got {self.reference_uncertainty:g}")

    def __repr__(self) -> str:
        bins, rows, columns = self.coherence.shape
        return summary(
            self,
            f"{counted(bins, 'bin')} of {rows} x {columns} cells",
            f"magnitude to {100 * np.median(self.magnitude_uncertainty):.3g} % (median, k = 1)",
            f"coherence {np.median(self.coherence):.3g}",
            f"delay {span(1e3 * self.delay, 'ms')}",
            f"by {clipped(self.reference)}" if self.reference else "",
            clipped(self.method),
            counted(self.takes, "take"),
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Crosstalk:
    """Response of each cell to a pressure on another cell."""

    matrix: Array
    """Shape (channel, channel): output of cell i, as pressure, over the pressure on cell k alone; 1 on the diagonal."""
    uncertainty: Array
    """Uncertainty of each element, including its change over the band, shape (channel, channel)."""

    def __post_init__(self) -> None:
        matrix = frozen_array(self.matrix, "crosstalk", ("channel", "channel"))
        if matrix.shape[0] != matrix.shape[1] or np.abs(np.diag(matrix) - 1).max() > 1e-9:
            raise ShapeError(f"crosstalk: expected a square matrix with 1 on its diagonal, got shape {matrix.shape}")
        object.__setattr__(self, "matrix", matrix)
        _freeze(self, "uncertainty", matrix.shape, least=0.0)

    def __repr__(self) -> str:
        others = np.abs(self.matrix[~np.eye(len(self.matrix), dtype=bool)])
        said = f"at most {100 * others.max():.3g} % of a pressure on another cell" if others.size else ""
        return summary(self, f"{len(self.matrix)} x {len(self.matrix)} channels", said)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Linearity:
    """Output over pressure at five or more levels: a straight line with an intercept, and its curvature."""

    pressure: Array
    """Rms pressure, shape (level, row, column), in Pa."""
    output: Array
    """Rms of the part of the output that follows the pressure, divided by the response, shape (level, row, column), in
    Pa."""
    gain: Array
    """Slope of the line, shape (row, column); 1 if the response was measured at these levels."""
    gain_uncertainty: Array
    intercept: Array
    """Shape (row, column), in Pa."""
    intercept_uncertainty: Array
    curvature: Array
    """Relative change of the slope from the lowest to the highest level, by a fitted parabola; negative for saturation.
    """
    curvature_uncertainty: Array

    def __post_init__(self) -> None:
        pressure = frozen_array(self.pressure, "pressure of the levels", ("level", "row", "column"))
        object.__setattr__(self, "pressure", pressure)
        _freeze(self, "output", pressure.shape)
        for name in ("gain", "intercept", "curvature"):
            _freeze(self, name, pressure.shape[1:])
            _freeze(self, f"{name}_uncertainty", pressure.shape[1:], least=0.0)

    def __repr__(self) -> str:
        rows, columns = self.gain.shape
        return summary(
            self,
            f"{counted(self.levels, 'level')} of {rows} x {columns} cells",
            f"{span(self.pressure, 'Pa')} rms",
            f"gain {span(self.gain)}",
            f"intercept {span(self.intercept, 'Pa')}",
            f"curvature {span(100 * self.curvature, '%')}",
        )

    @property
    def levels(self) -> int:
        """Number of levels."""
        return len(self.pressure)


def _freeze(owner: Any, name: str, shape: tuple[int, ...], *, least: float = -np.inf) -> None:
    """Replace an attribute of a frozen dataclass by its checked, read-only copy."""
    spelled = name.replace("_", " ")
    values = frozen_array(getattr(owner, name), spelled, shape)
    if values.min() < least:
        raise InputError(f"{spelled}: expected {least:g} or more, got {values.min():g}")
    object.__setattr__(owner, name, values)
