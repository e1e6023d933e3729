"""Apply a calibration to whole recordings or to a stream of blocks."""

from .inverse import CausalInverse as CausalInverse
from .inverse import causal_error as causal_error
from .inverse import causal_fir as causal_fir
from .inverse import default_taps as default_taps
from .inverse import inverse_fir as inverse_fir
from .inverse import inverse_response as inverse_response
from .inverse import undo_matrix as undo_matrix
from .pressure import Method as Method
from .pressure import calibrate as calibrate
from .pressure import typical_uncertainty as typical_uncertainty
