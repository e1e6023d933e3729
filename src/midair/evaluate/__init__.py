"""Evaluate reproductions: field errors, spectra, peaks, comparison with the original, perceptual metrics."""

from midair.evaluate.alignment import advance, find_delay
from midair.evaluate.comparison import Comparison, compare
from midair.evaluate.distortion import Fidelity, fidelity, image_level, in_band
from midair.evaluate.energy_error import SolveError, error_by_energy
from midair.evaluate.error_budget import Budget, StageLoss, StageOutput, budget
from midair.evaluate.ideal_rerecording import apply_band_twice, band_settling_frames
from midair.evaluate.leakage import Leak, leak, surroundings
from midair.evaluate.palm_metrics import PalmFidelity, PalmFrames, PressedPalm, palm_fidelity, palm_frames
from midair.evaluate.peak import peak_position
from midair.evaluate.perception import SkinModel, pacinian_level, spqi, st_sim
from midair.evaluate.skin_metrics import PerceptualFigure, PerceptualMetrics, perceptual_metrics
from midair.evaluate.spectrum import dominant_frequency, spectral_error
from midair.evaluate.temperature_error import error_at_temperature
from midair.evaluate.timbre import THIRD_OCTAVES, third_octaves
from midair.physics import printed_error, relative_error

__all__ = [
    "Budget",
    "PerceptualFigure",
    "Comparison",
    "Fidelity",
    "Leak",
    "SolveError",
    "PalmFidelity",
    "PalmFrames",
    "PerceptualMetrics",
    "PressedPalm",
    "SkinModel",
    "StageLoss",
    "StageOutput",
    "THIRD_OCTAVES",
    "advance",
    "budget",
    "compare",
    "dominant_frequency",
    "error_at_temperature",
    "fidelity",
    "find_delay",
    "apply_band_twice",
    "image_level",
    "in_band",
    "leak",
    "error_by_energy",
    "pacinian_level",
    "palm_fidelity",
    "palm_frames",
    "peak_position",
    "perceptual_metrics",
    "printed_error",
    "relative_error",
    "band_settling_frames",
    "spectral_error",
    "spqi",
    "st_sim",
    "surroundings",
    "third_octaves",
]
