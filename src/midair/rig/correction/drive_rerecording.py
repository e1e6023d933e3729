"""What a sensor and a whole palm get of a drive on the virtual rig."""

from dataclasses import dataclass

from midair.devices import check_exposure
from midair.evaluate import PalmFidelity
from midair.model import Calibration, Drive, Palm, PressureFrames, Recording
from midair.rig.correction.palm_simulation import palm_of_drive, played_chain
from midair.rig.correction.passes import Stage, quiet
from midair.rig.names import VirtualRig
from midair.rig.playing import rerecord, usual_exposure


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveRerecording:
    """What came of a drive.

    Attributes
    ----------
    recording : Recording
        Of the virtual sensor, from the drive's first frame on.
    calibration : Calibration
        Of that sensor.
    palm : PalmFidelity
        Of a palm at the sensor's height.
    """

    recording: Recording
    calibration: Calibration | None
    palm: PalmFidelity


def rerecord_drive(
    drive: Drive,
    original: PressureFrames,
    asked: PressureFrames,
    rig: VirtualRig,
    *,
    palm: Palm | None = None,
    band: tuple[float, float] = (20.0, 470.0),
    stage: Stage = quiet,
) -> DriveRerecording:
    """Play a drive on the virtual rig to its sensor, and to a whole palm.

    Parameters
    ----------
    drive : Drive
        What the array is told.
    original, asked : PressureFrames
        What it is of, and the same with the lead that it was solved with.
    rig : VirtualRig
        Array, sensor and air; the sensor has the original's cells.
    palm : Palm, optional
        A disc of 85 mm if None.
    band : tuple of float
        (low, high) that counts, in Hz.
    stage : callable, optional
        Told the name of each stage as it begins; gives what to call with its progress.
    """
    skin = rig.skin()
    with rig.array_device(skin) as array, rig.sensor(skin) as sensor:
        admission = check_exposure(drive, array, usual_exposure())
        recording = rerecord(admission, array, sensor, progress=stage("play and re-record"))
        calibration = sensor.calibration
    chain = played_chain(drive, rig)
    lead = (asked.frames - original.frames) // 2 / original.rate
    judged = (lead, original.frames / original.rate)
    of_palm = palm_of_drive(
        asked, drive, palm or Palm.disc(), chain=chain, rig=rig, judged=judged, band=band, progress=stage("palm")
    )
    return DriveRerecording(recording=recording, calibration=calibration, palm=of_palm)
