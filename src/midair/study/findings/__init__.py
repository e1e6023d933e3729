"""Report texts and tables of the planned analyses."""

from .analysis import Choices as Choices
from .analysis import Report as Report
from .analysis import analyse as analyse
from .choice_findings import Finding as Finding
from .study_data import NO_PERSON as NO_PERSON
from .study_data import NO_TOUCH as NO_TOUCH
from .study_data import StudyData as StudyData
from .study_data import data_of_answers as data_of_answers
from .study_data import data_of_columns as data_of_columns
from .study_data import simulation_of as simulation_of
