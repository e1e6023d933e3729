"""Evaluate: errors of a field, spectra, places of peaks, original against reproduction, what skin makes of it."""

from midair.evaluate.alignment import advance, find_delay
from midair.evaluate.card import CardFigure, PerceptualCard, perceptual_card
from midair.evaluate.comparison import Comparison, compare
from midair.evaluate.distortion import Fidelity, fidelity, image_level, in_band
from midair.evaluate.energy_error import Met, met
from midair.evaluate.field import peak_position
from midair.evaluate.heard_again import heard_perfectly, resting
from midair.evaluate.leakage import Leak, leak, surroundings
from midair.evaluate.other_air import error_in_air
from midair.evaluate.perception import SkinModel, pacinian_level, spqi, st_sim
from midair.evaluate.spectrum import dominant_frequency, spectral_error
from midair.evaluate.stage_loss import Budget, StageLoss, StageOutput, budget
from midair.evaluate.timbre import THIRD_OCTAVES, third_octaves
from midair.evaluate.whole_palm import PalmFidelity, PalmFrames, PressedPalm, palm_fidelity, palm_frames
from midair.physics import printed_error, relative_error

__all__ = [
    "Budget",
    "CardFigure",
    "Comparison",
    "Fidelity",
    "Leak",
    "Met",
    "PalmFidelity",
    "PalmFrames",
    "PerceptualCard",
    "PressedPalm",
    "SkinModel",
    "StageLoss",
    "StageOutput",
    "THIRD_OCTAVES",
    "advance",
    "budget",
    "compare",
    "dominant_frequency",
    "error_in_air",
    "fidelity",
    "find_delay",
    "heard_perfectly",
    "image_level",
    "in_band",
    "leak",
    "met",
    "pacinian_level",
    "palm_fidelity",
    "palm_frames",
    "peak_position",
    "perceptual_card",
    "printed_error",
    "relative_error",
    "resting",
    "spectral_error",
    "spqi",
    "st_sim",
    "surroundings",
    "third_octaves",
]
