"""Terms that a solver can add to the error of the paper, one file each.

Their functions accept arrays of any library of the array API standard; rows are frames. `solvers.methods.TAKES` lists
the terms that each method supports.
"""

from .cells import Cells as Cells
from .cells import CellTarget as CellTarget
from .cells import cell_misfit as cell_misfit
from .error_measure import Fit as Fit
from .error_measure import name_of_pressure_means as name_of_pressure_means
from .error_measure import pressure_means as pressure_means
from .guard import Guard as Guard
from .guard import GuardField as GuardField
from .guard import excess as excess
from .guard import excess_rows as excess_rows
from .level import automatic_level as automatic_level
from .points import misfit as misfit
from .quiet_ears import QuietEars as QuietEars
from .quiet_palm import QuietPalm as QuietPalm
from .smooth import change as change
from .temperatures import airs_around as airs_around
from .temperatures import psi_at_temperatures as psi_at_temperatures
from .windows import Windows as Windows
