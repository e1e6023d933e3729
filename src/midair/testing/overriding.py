"""A drive admitted whatever it exposes people to, for devices that nobody can hear."""

from midair.devices import ArrayDevice, ExposureChoices, ExposureClearance, check_exposure
from midair.files import DEFAULT_PROFILE, profile_named
from midair.model import Drive


def overridden(drive: Drive, device: ArrayDevice, *, repeats: int = 1, by: str = "a test") -> ExposureClearance:
    """The drive, admitted on a device with somebody answering for it by name, as ``--override-exposure`` does.

    Parameters
    ----------
    drive : Drive
        To be played.
    device : ArrayDevice
        Virtual, or an emulator.
    repeats : int
        How often.
    by : str
        Who answers.
    """
    return check_exposure(
        drive, device, ExposureChoices(profile=profile_named(DEFAULT_PROFILE), override=by), repeats=repeats
    )
