"""The doctor: what is installed, what works, and what to do about what does not."""

from midair.rig.doctor.checkup import check_up

__all__ = [
    "check_up",
]
