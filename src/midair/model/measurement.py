"""What a measured calibration knows of itself: how sure it is, what its cells do to each other, and how straight it is.

Every uncertainty is a standard one (k = 1), as in the Guide to the expression of uncertainty in measurement (GUM,
JCGM 100:2008); twice it covers about 95 %. Those from few readings are already widened by Student's t.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError, ShapeError
from midair.model.reprs import clipped, counted, span, told
from midair.validation import frozen_array

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Measurement:
    """How sure a calibration is, bin by bin and channel by channel.

    Attributes
    ----------
    coherence : ndarray, shape (bin, row, column)
        Share of the output that the reference explains, 0 to 1.
    magnitude_uncertainty : ndarray, shape (bin, row, column)
        Of the response's magnitude, as a part of it; everything counted, the reference too.
    phase_uncertainty : ndarray, shape (bin, row, column)
        Of the response's phase, in rad.
    noise_density : ndarray, shape (bin, row, column)
        One-sided noise density of the output, in the calibration's unit per sqrt(Hz).
    noise_uncertainty : ndarray, shape (row, column)
        Of the calibration's `noise`, as a part of it.
    delay : ndarray, shape (row, column)
        Of each channel behind the reference in the upper half of the bins, in s.
    delay_uncertainty : ndarray, shape (row, column)
        In s.
    reference_uncertainty : float
        What of the magnitude's uncertainty all bins and channels share, as a part of the magnitude.
    reference : str
        What the pressure was measured by.
    method : str
        How it was done, in words.
    takes : int
        Number of recordings that it rests on.
    """

    coherence: Array
    magnitude_uncertainty: Array
    phase_uncertainty: Array
    noise_density: Array
    noise_uncertainty: Array
    delay: Array
    delay_uncertainty: Array
    reference_uncertainty: float = 0.0
    reference: str = ""
    method: str = ""
    takes: int = 1

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
        return told(
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
    """What each cell feels of a pressure on another one.

    Attributes
    ----------
    matrix : ndarray, shape (channel, channel)
        Pressure that cell i feels over the pressure on cell k alone; 1 on the diagonal.
    uncertainty : ndarray, shape (channel, channel)
        Of each element, how much it changes over the band included.
    """

    matrix: Array
    uncertainty: Array

    def __post_init__(self) -> None:
        matrix = frozen_array(self.matrix, "crosstalk", ("channel", "channel"))
        if matrix.shape[0] != matrix.shape[1] or np.abs(np.diag(matrix) - 1).max() > 1e-9:
            raise ShapeError(f"crosstalk: expected a square matrix with 1 on its diagonal, got shape {matrix.shape}")
        object.__setattr__(self, "matrix", matrix)
        _freeze(self, "uncertainty", matrix.shape, least=0.0)

    def __repr__(self) -> str:
        others = np.abs(self.matrix[~np.eye(len(self.matrix), dtype=bool)])
        said = f"at most {100 * others.max():.3g} % of a pressure on another cell" if others.size else ""
        return told(self, f"{len(self.matrix)} x {len(self.matrix)} channels", said)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Linearity:
    """Output over pressure at five levels or more: a straight line with an intercept, and its bend.

    Attributes
    ----------
    pressure : ndarray, shape (level, row, column)
        Rms of the pressure, in Pa.
    output : ndarray, shape (level, row, column)
        Rms of the part of the output that follows it, divided by the response: in Pa.
    gain, gain_uncertainty : ndarray, shape (row, column)
        Slope of the line; 1 where the response was measured at these levels.
    intercept, intercept_uncertainty : ndarray, shape (row, column)
        In Pa.
    curvature, curvature_uncertainty : ndarray, shape (row, column)
        Change of the slope from the lowest to the highest level by a parabola through the same points, as a part of the
        gain: saturation is negative.
    """

    pressure: Array
    output: Array
    gain: Array
    gain_uncertainty: Array
    intercept: Array
    intercept_uncertainty: Array
    curvature: Array
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
        return told(
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
