"""Terms that a solver can add to the error of the paper, one file each.

Their functions accept arrays of any library of the array API standard; rows are frames. `solvers.methods.TAKES` lists
the terms that each method supports.
"""

from midair.solvers.terms.cells import Cells, CellTarget, cell_misfit
from midair.solvers.terms.error_measure import Fit, name_of_pressure_means, pressure_means
from midair.solvers.terms.guard import Guard, GuardField, excess, excess_rows
from midair.solvers.terms.level import automatic_level
from midair.solvers.terms.points import misfit
from midair.solvers.terms.quiet_ears import QuietEars
from midair.solvers.terms.quiet_palm import QuietPalm
from midair.solvers.terms.smooth import change
from midair.solvers.terms.temperatures import airs_around, psi_at_temperatures
from midair.solvers.terms.windows import Windows

__all__ = [
    "CellTarget",
    "Cells",
    "Fit",
    "Guard",
    "GuardField",
    "QuietEars",
    "QuietPalm",
    "Windows",
    "airs_around",
    "automatic_level",
    "cell_misfit",
    "change",
    "excess",
    "excess_rows",
    "pressure_means",
    "misfit",
    "name_of_pressure_means",
    "psi_at_temperatures",
]
