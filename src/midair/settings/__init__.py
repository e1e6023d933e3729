"""Settings of calibration, target, compensation, solver and air, declared once, and the modes that name sets of them.

The options of the command line, the provenance of drives and the table of the documentation are derived from them.
"""

from .choices import CHOICES as CHOICES
from .choices import Choice as Choice
from .choices import format_setting as format_setting
from .choices import format_value as format_value
from .choices import nearest_mode as nearest_mode
from .choices import typed_options as typed_options
from .settings import EARS as EARS
from .settings import MODES as MODES
from .settings import MOST_GAIN as MOST_GAIN
from .settings import CalibrationSettings as CalibrationSettings
from .settings import CompensationSettings as CompensationSettings
from .settings import Mode as Mode
from .settings import Settings as Settings
from .settings import TargetSettings as TargetSettings
from .settings import TransducerSpread as TransducerSpread
from .settings import best_mode as best_mode
from .settings import finest_mode as finest_mode
from .settings import flat_names as flat_names
from .settings import paper_mode as paper_mode
from .settings import quick_mode as quick_mode
from .settings import quiet_mode as quiet_mode
from .settings import with_fewer_points as with_fewer_points
from .settings import with_paper_mode as with_paper_mode
