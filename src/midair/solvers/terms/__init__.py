"""Terms that a solver can add to the error of the paper, one file each.

Their functions accept arrays of any library of the array API standard; rows are frames.
"""

from .amplitudes import Amplitudes as Amplitudes
from .amplitudes import Bounded as Bounded
from .fit import Cells as Cells
from .fit import CellTarget as CellTarget
from .fit import Fit as Fit
from .fit import PressureMeans as PressureMeans
from .fit import Windows as Windows
from .fit import cell_misfit as cell_misfit
from .fit import misfit as misfit
from .guard import Guard as Guard
from .guard import GuardField as GuardField
from .guard import excess as excess
from .guard import excess_rows as excess_rows
from .quiet_ears import QuietEars as QuietEars
from .quiet_palm import QuietPalm as QuietPalm
from .smooth import Smooth as Smooth
from .temperatures import Robust as Robust
from .temperatures import airs_around as airs_around
from .temperatures import psi_at_temperatures as psi_at_temperatures
from .term import TERMS as TERMS
from .term import PhaseTerm as PhaseTerm
from .term import QuietTerm as QuietTerm
from .term import Term as Term
from .term import registered_terms as registered_terms
