"""The quantity in which the error is measured: control points, windows, or sensor cells."""

from typing import Literal

from midair.errors import InputError
from midair.solvers.terms.cells import Cells
from midair.solvers.terms.windows import Windows

Fit = Literal["points", "windows", "cells"] | Windows | Cells
"""Control points, as in the paper; windows over the whole square; or the cells of a sensor at one place."""


def pressure_means(fit: Fit) -> Windows | Cells | None:
    """The term with the mean pressures of this fit; None for "points". Raises InputError for an unknown name."""
    if isinstance(fit, Windows | Cells):
        return fit
    if fit not in ("points", "windows", "cells"):
        raise InputError(f"fit: expected points, windows, cells, Windows(...) or Cells(...), got {fit!r}")
    return Windows() if fit == "windows" else Cells() if fit == "cells" else None


def name_of_pressure_means(means: Windows | Cells | None) -> str:
    """Name of the fit with this term."""
    return "points" if means is None else type(means).__name__.lower()
