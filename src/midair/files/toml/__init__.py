"""TOML files that users write by hand."""

from .exposure_profiles import DEFAULT_PROFILE as DEFAULT_PROFILE
from .exposure_profiles import from_plain as from_plain
from .exposure_profiles import load_profiles as load_profiles
from .exposure_profiles import profile_named as profile_named
from .exposure_profiles import to_plain as to_plain
from .hardware import Laboratory as Laboratory
from .hardware import load_laboratory as load_laboratory
from .hardware import load_palm as load_palm
from .hardware import load_placement as load_placement
from .hardware import load_sensor as load_sensor
from .hardware import load_stage as load_stage
from .hardware import load_tracker as load_tracker
from .hardware import save_laboratory as save_laboratory
from .hardware import save_sensor as save_sensor
from .hardware import save_tracker as save_tracker
