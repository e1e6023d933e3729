"""Exposure clearance for tests on devices without sound."""

from midair.devices import ArrayDevice, ExposureChoices, ExposureClearance, check_exposure
from midair.files import DEFAULT_PROFILE, profile_named
from midair.model import Drive


def clear_any_exposure(drive: Drive, device: ArrayDevice, *, repeats: int = 1, by: str = "a test") -> ExposureClearance:
    """Clear a drive on a virtual device or an emulator above the exposure limit, as ``--override-exposure`` does."""
    return check_exposure(
        drive, device, ExposureChoices(profile=profile_named(DEFAULT_PROFILE), override=by), repeats=repeats
    )
