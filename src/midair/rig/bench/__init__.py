"""Measure calibrations of sensors and arrays, and identify which channel belongs to which cell."""

from .array_bench import PLACES as PLACES
from .array_bench import ArraySession as ArraySession
from .array_bench import calibrate_array as calibrate_array
from .array_bench import calibrate_by_beam as calibrate_by_beam
from .array_bench import calibrate_tracker as calibrate_tracker
from .array_bench import check_array_calibration as check_array_calibration
from .calibration_page import PRACTICE_RECORDINGS as PRACTICE_RECORDINGS
from .calibration_page import ReferenceChoice as ReferenceChoice
from .calibration_page import calibration_rows as calibration_rows
from .calibration_page import check_page_name as check_page_name
from .calibration_page import describe_uncertainty as describe_uncertainty
from .calibration_page import read_silence as read_silence
from .calibration_page import read_takes as read_takes
from .calibration_page import write_calibration_page as write_calibration_page
from .calibration_page import write_practice_recordings as write_practice_recordings
from .identify import Identity as Identity
from .identify import TapTest as TapTest
from .identify import assignment_problems as assignment_problems
from .identify import identify_by_taps as identify_by_taps
from .identify import identify_by_tones as identify_by_tones
from .identify import tone_answers as tone_answers
