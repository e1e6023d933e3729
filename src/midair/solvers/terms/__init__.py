"""Terms that a solver can add to the error of the paper, one file each; `SolverSettings` has a setting for each."""

from .amplitudes import Amplitudes as Amplitudes
from .amplitudes import doubled as doubled
from .amplitudes import halves as halves
from .amplitudes import with_amplitudes as with_amplitudes
from .fit import Cells as Cells
from .fit import Fit as Fit
from .fit import FitName as FitName
from .fit import Windows as Windows
from .fit import pressure_means as pressure_means
from .guard import Guard as Guard
from .quiet_ears import QuietEars as QuietEars
from .quiet_palm import QuietPalm as QuietPalm
from .temperatures import airs_around as airs_around
from .temperatures import psi_at_temperatures as psi_at_temperatures
