"""Check the installation and the devices, with advice for each problem."""

from .checkup import readiness as readiness
from .checkup import run_checks as run_checks
from .wizard import checkup_line as checkup_line
from .wizard import run_wizard as run_wizard
from .wizard import store_checkup as store_checkup
