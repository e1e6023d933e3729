"""What the error is taken over."""

from typing import Literal

from midair.errors import InputError
from midair.solvers.terms.cells import Cells
from midair.solvers.terms.windows import Windows

Fit = Literal["points", "windows", "cells"] | Windows | Cells
"""The control points, as in the paper; windows, wherever a palm or a sensor lies; cells of a sensor in one place."""


def pressure_means(fit: Fit) -> Windows | Cells | None:
    """The term whose means of pressure are to be met; none where it is the points themselves.

    Raises
    ------
    InputError
        If there is nothing of that name.
    """
    if isinstance(fit, Windows | Cells):
        return fit
    if fit not in ("points", "windows", "cells"):
        raise InputError(f"fit: expected points, windows, cells, Windows(...) or Cells(...), got {fit!r}")
    return Windows() if fit == "windows" else Cells() if fit == "cells" else None


def name_of_pressure_means(means: Windows | Cells | None) -> str:
    """The name of the fit that has this term."""
    return "points" if means is None else type(means).__name__.lower()
