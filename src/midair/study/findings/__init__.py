"""Report texts and tables of the planned analyses."""

from midair.study.findings.analysis import Choices, Report, analyse
from midair.study.findings.finding import Finding
from midair.study.findings.study_data import StudyData, data_of_answers, data_of_columns

__all__ = [
    "Choices",
    "Finding",
    "Report",
    "StudyData",
    "analyse",
    "data_of_answers",
    "data_of_columns",
]
