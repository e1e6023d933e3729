"""Apply a calibration to whole recordings or to a stream of blocks."""

from midair.calibration.apply.causal import CausalInverse, causal_error, causal_fir
from midair.calibration.apply.crosstalk_inverse import undo_matrix
from midair.calibration.apply.inverse import default_taps, inverse_fir, inverse_response
from midair.calibration.apply.pressure import Method, calibrate, typical_uncertainty
from midair.calibration.apply.streaming_inverse import StreamingInverse

__all__ = [
    "CausalInverse",
    "Method",
    "StreamingInverse",
    "calibrate",
    "causal_error",
    "causal_fir",
    "default_taps",
    "inverse_fir",
    "inverse_response",
    "typical_uncertainty",
    "undo_matrix",
]
