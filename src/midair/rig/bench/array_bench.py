"""Measure the transducers of an array with the sensor above it: play codes, record them, fit the transducers."""

import numpy as np
from numpy.typing import NDArray

from midair.calibration import ArrayField, ArrayPlan, array_codes, find_lag, fit_array, typical_uncertainty
from midair.devices import ArrayDevice, ExposureChoices, SensorDevice, check_exposure
from midair.errors import InputError, RateError
from midair.model import HEIGHT, HEIGHTS, Acoustics, ArrayCalibration, Drive, Provenance
from midair.physics import TransducerDynamics, radiation_pressure, transfer_matrix
from midair.rig.correction import Stage, no_progress
from midair.rig.playing import default_exposure, rerecord
from midair.validation import length

Array = NDArray[np.float64]


def calibrate_array(
    array: ArrayDevice,
    sensor: SensorDevice,
    plan: ArrayPlan | None = None,
    *,
    height: float = HEIGHT,
    acoustics: Acoustics | None = None,
    dynamics: TransducerDynamics | None = None,
    exposure: ExposureChoices | None = None,
    date: str = "",
    stage: Stage = no_progress,
) -> ArrayCalibration:
    """Measure the transducers of an open array with an open, calibrated sensor.

    Parameters
    ----------
    array, sensor : ArrayDevice, SensorDevice
        Open; both real or both virtual. The array's silencer must be off.
    plan : ArrayPlan, optional
        Duration and strength of the codes.
    height : float
        Height of the sensor above the array in m, to about 1 mm; the fit finds the rest.
    acoustics : Acoustics, optional
        Air of the room and directivity.
    dynamics : TransducerDynamics, optional
        Envelope of the model's transducers.
    exposure : ExposureChoices, optional
        Exposure limits of the codes; the default profile if None.
    date : str
        As in `ArrayCalibration`.
    stage : callable
        Called with the name of each stage at its start; returns its progress callback.

    Raises
    ------
    MismatchError
        If only one of the two devices is simulated.
    RateError
        If the sensor's rate is not an integer multiple of the codes' rate.
    InputError
        If the sensor has no calibration, or does not detect the beam.
    """
    length(height, "height", HEIGHTS)
    plan, acoustics = plan or ArrayPlan(), acoustics or Acoustics()
    known = sensor.calibration
    if known is None:
        raise InputError(f"{sensor.name}: expected a sensor with a calibration, got none; give one with --calibration")
    per = sensor.rate / plan.rate
    if per < 1 or abs(per - round(per)) > 1e-6:
        raise RateError(
            f"{sensor.name}: expected an integer multiple of the codes' {plan.rate:g} Hz, got {sensor.rate:g} Hz"
        )
    model = array.array.nominal
    codes = array_codes(model, sensor.grid, plan, acoustics=acoustics, height=height)
    life = Provenance(source=f"codes of {array.name}")
    drive = Drive(
        phase=codes.phase,
        level=np.full(codes.frames, codes.level),
        rate=codes.rate,
        array=model,
        acoustics=acoustics,
        provenance=life,
    )
    admission = check_exposure(drive, array, exposure or default_exposure())
    recording = rerecord(admission, array, sensor, source="array calibration", tail=0.1, progress=stage("play codes"))
    samples = recording.samples.reshape(recording.frames, -1)
    if not sensor.simulated:
        expected = _expected(drive, sensor, list(codes.cells), height, round(per))
        samples = samples[find_lag(samples[:, list(codes.cells)].sum(axis=1), expected) :]
    field = ArrayField(
        array=model, codes=codes, acoustics=acoustics, calibration=known, height=height, rate=sensor.rate
    )
    told = {"array": array.name, "sensor": known.identifier, "seconds": plan.duration, "top_pa": plan.top}
    measured = Provenance(source=f"{array.name} heard by {sensor.name}", simulated=recording.provenance.simulated)
    return fit_array(
        field,
        samples,
        dynamics=dynamics,
        synchronous=sensor.simulated,
        level_uncertainty=(typical_uncertainty(known, field.band) or 0.0) / 2,
        date=date,
        provenance=measured.then("measure array", told),
        progress=stage("fit each group"),
    )


def _expected(drive: Drive, sensor: SensorDevice, cells: list[int], height: float, per: int) -> Array:
    """Pressure in Pa, by the model, at the centre of the cells at each sample of the sensor."""
    foci = np.array([(*sensor.grid.channel_position(cell), height) for cell in cells])
    G = transfer_matrix(foci, drive.array, acoustics=drive.acoustics)
    pressure = radiation_pressure(drive.q @ G.T, drive.acoustics.medium).sum(axis=1)
    return np.repeat(pressure, per)
