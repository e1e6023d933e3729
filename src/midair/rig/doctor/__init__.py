"""Check the installation, the computer and the devices, with advice for each problem."""

from midair.rig.doctor.checkup import check_up

__all__ = [
    "check_up",
]
