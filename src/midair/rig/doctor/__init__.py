"""Check the installation, the computer and the devices, with advice for each problem."""

from midair.rig.doctor.checkup import run_checks

__all__ = [
    "run_checks",
]
