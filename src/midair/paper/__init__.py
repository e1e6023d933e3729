"""Reproduce the paper's figures and numbers in its own mode and in another mode."""

from .figures import PaperResult as PaperResult
from .figures import figure_3 as figure_3
from .figures import figure_4 as figure_4
from .figures import figure_9 as figure_9
from .modes_compared import FidelityPlan as FidelityPlan
from .modes_compared import fidelity_table as fidelity_table
