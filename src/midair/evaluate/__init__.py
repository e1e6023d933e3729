"""Evaluate: errors of a field, spectra, places of peaks, and original against reproduction (paper, 5.1 and 5.2)."""

from midair.evaluate.alignment import advance, find_delay
from midair.evaluate.comparison import Comparison, compare
from midair.evaluate.field import peak_position, printed_error, relative_error
from midair.evaluate.spectrum import dominant_frequency, spectral_error

__all__ = [
    "Comparison",
    "advance",
    "compare",
    "dominant_frequency",
    "find_delay",
    "peak_position",
    "printed_error",
    "relative_error",
    "spectral_error",
]
