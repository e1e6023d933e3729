"""Reproduce the paper's figures and numbers in its own mode and in another mode."""

from midair.paper.figure3 import figure_3
from midair.paper.figure4 import StimuliPlan, figure_4
from midair.paper.figure9 import figure_9
from midair.paper.materials_apart import MaterialsPlan, materials_table
from midair.paper.modes_compared import FidelityPlan, fidelity_table
from midair.paper.result import PaperResult

__all__ = [
    "FidelityPlan",
    "MaterialsPlan",
    "PaperResult",
    "StimuliPlan",
    "fidelity_table",
    "figure_3",
    "figure_4",
    "figure_9",
    "materials_table",
]
