"""Re-record a drive on the virtual rig, with the sensor and on a whole palm."""

from dataclasses import dataclass

from midair.devices import check_exposure
from midair.evaluate import PalmFidelity
from midair.model import BAND, Calibration, Drive, Palm, PressureFrames, Recording
from midair.rig.correction.palm_simulation import palm_of_drive, played_chain
from midair.rig.correction.passes import Stage, no_progress
from midair.rig.names import VirtualRig
from midair.rig.playing import default_exposure, rerecord


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveRerecording:
    """Result of a re-recorded drive."""

    recording: Recording
    """Recording of the virtual sensor, from the drive's first frame."""
    calibration: Calibration | None
    """Calibration of that sensor."""
    palm: PalmFidelity
    """Fidelity on a palm at the sensor's height."""


def rerecord_drive(
    drive: Drive,
    original: PressureFrames,
    asked: PressureFrames,
    rig: VirtualRig,
    *,
    palm: Palm | None = None,
    band: tuple[float, float] = BAND,
    stage: Stage = no_progress,
) -> DriveRerecording:
    """Play a drive on the virtual rig to its sensor and to a whole palm.

    Parameters
    ----------
    original, asked : PressureFrames
        Pressure that the drive reproduces, and the same with the lead of the solve.
    rig : VirtualRig
        Array, sensor and air; the sensor has the original's cells.
    palm : Palm, optional
        A disc of 85 mm if None.
    band : tuple of float
        (low, high) of the compared band in Hz.
    stage : callable, optional
        Called with the name of each stage at its start; returns its progress callback.
    """
    skin = rig.skin()
    with rig.array_device(skin) as array, rig.sensor(skin) as sensor:
        admission = check_exposure(drive, array, default_exposure())
        recording = rerecord(admission, array, sensor, progress=stage("play and re-record"))
        calibration = sensor.calibration
    chain = played_chain(drive, rig)
    lead = (asked.frames - original.frames) // 2 / original.rate
    judged = (lead, original.frames / original.rate)
    of_palm = palm_of_drive(
        asked, drive, palm or Palm.disc(), chain=chain, rig=rig, judged=judged, band=band, progress=stage("palm")
    )
    return DriveRerecording(recording=recording, calibration=calibration, palm=of_palm)
