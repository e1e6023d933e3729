"""Make devices from the names that users type, their calibrations, and the virtual rig."""

from .array_names import KeptCalibration as KeptCalibration
from .array_names import array_calibration_for as array_calibration_for
from .array_names import array_calibration_named as array_calibration_named
from .array_names import array_named as array_named
from .array_names import calibration_age as calibration_age
from .array_names import keep_array_calibration as keep_array_calibration
from .array_names import keep_array_check as keep_array_check
from .array_names import kept_array_calibration as kept_array_calibration
from .array_names import transducers_of as transducers_of
from .sensor_names import SENSORS as SENSORS
from .sensor_names import VirtualRig as VirtualRig
from .sensor_names import open_tracker as open_tracker
from .sensor_names import sensor_named as sensor_named
from .sensor_names import source_sensor as source_sensor
from .sensor_names import stage_named as stage_named
from .sensor_names import tracker_options as tracker_options
