"""Check the installation, the computer and the devices, with advice for each problem."""

from .checkup import run_checks as run_checks
