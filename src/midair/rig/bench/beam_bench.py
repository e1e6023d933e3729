"""Calibrate a sensor by a focused beam on each of its cells: plays, listens, and hands over to `calibrate.beam`."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from midair.calibration import (
    BeamPlan,
    BeamReading,
    BeamSetting,
    beam_field,
    find_lag,
    focus_of,
    measure_beam,
    tones_of,
)
from midair.devices import ArrayDevice, ExposureChoices, SensorDevice, amplitude_of, check_exposure, read_frames
from midair.errors import RateError
from midair.model import Acoustics, Calibration, Drive, Progress, Provenance, Recording
from midair.physics import TransducerDynamics, envelope, focus_phase
from midair.rig.playing import rerecord, usual_exposure

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

FINE = 8
"""Moments in a frame at which the command is worked out."""


def calibrate_by_beam(
    array: ArrayDevice,
    sensor: SensorDevice,
    plan: BeamPlan | None = None,
    *,
    setting: BeamSetting | None = None,
    acoustics: Acoustics | None = None,
    dynamics: TransducerDynamics | None = None,
    exposure: ExposureChoices | None = None,
    date: str = "",
    version: int = 1,
    progress: Progress | None = None,
) -> Calibration:
    """Calibration of an open sensor by an open array.

    Parameters
    ----------
    array, sensor : ArrayDevice, SensorDevice
        Open; both real or both virtual.
    plan : BeamPlan, optional
        What is played on each cell.
    setting : BeamSetting, optional
        Where the sensor lies, how its cells hear, and how sure all that is.
    acoustics, dynamics
        Of the array's model.
    exposure : ExposureChoices, optional
        Limits that each drive has to keep; the usual profile if None.
    date, version
        As in `Calibration`.
    progress : callable, optional
        Called with (cells done, cells in all).

    Raises
    ------
    MismatchError
        If only one of the two is simulated.
    RateError
        If the sensor's rate is no whole multiple of the plan's.
    InputError
        If the beam cannot press as hard as the plan asks, or is not heard.
    """
    plan, setting = plan or BeamPlan(), setting or BeamSetting()
    acoustics, dynamics = acoustics or Acoustics(), dynamics or TransducerDynamics()
    _check_rate(sensor, plan)
    field = beam_field(array.array, sensor.grid, setting, acoustics=acoustics)
    strongest = float(field.middle.mean())
    level = _level(plan, strongest)
    recordings: list[Recording] = []
    output: list[Complex] = []
    expected, commanded, slow = _command(plan, strongest, _played(level, array), dynamics)
    cells = sensor.grid.count
    for cell in range(cells):
        drive = _drive(plan, level, array, focus_of(sensor.grid, cell, setting), acoustics)
        admission = check_exposure(drive, array, exposure or usual_exposure())
        recording = rerecord(admission, array, sensor, source="beam calibration")
        flat = recording.samples.reshape(recording.frames, -1)
        steps = round(sensor.rate / plan.rate)
        lag = find_lag(flat[:, cell], np.repeat(expected, steps))
        output.append(tones_of(flat, sensor.rate, plan, lag=lag))
        recordings.append(recording)
        if progress:
            progress(cell + 1, cells)
    reading = BeamReading(
        plan=plan,
        commanded=commanded,
        output=np.array(output),
        shares=field.on_cells(setting) / strongest,
        changed_shares=field.changed(setting) / strongest,
        slow=setting.dynamics_uncertainty * slow,
        level=setting.pressure_uncertainty,
        # The beam begins anywhere within a frame: the standard deviation of an even distribution.
        timing=1 / (np.sqrt(12) * plan.rate),
    )
    told = _life(recordings[0], array, plan)
    return measure_beam(reading, sensor=told, quiet=_quiet(sensor), date=date, version=version)


def _level(plan: BeamPlan, strongest: float) -> Array:
    """Level of the drive, shape (frame,), in steps of 1/255 as the firmware holds it."""
    return np.rint(255 * np.sqrt(plan.waveform * min(plan.top / strongest, 1.0))) / 255


def _played(level: Array, array: ArrayDevice) -> Array:
    """The amplitude that a level becomes: an array with real firmware has its pulse widths only."""
    return amplitude_of(np.rint(level * 255).astype(np.uint8)) if array.gated else level


def _command(
    plan: BeamPlan, strongest: float, played: Array, dynamics: TransducerDynamics
) -> tuple[Array, Complex, Array]:
    """Commanded pressure in the middle of a focus: of each frame, of each tone, and what the dynamics take from it."""
    fine = strongest * np.abs(envelope(played[:, None].astype(complex), plan.rate, FINE, dynamics)) ** 2
    still = strongest * np.repeat(played**2, FINE)[:, None]
    tones, at_once = (tones_of(pressure, FINE * plan.rate, plan)[..., 0] for pressure in (fine, still))
    # What a sensor samples when frame i begins: the mean from half a frame before to half a frame after.
    around = np.concatenate([np.zeros(FINE // 2), fine[:, 0]])[: len(fine)]
    return around.reshape(-1, FINE).mean(axis=1), tones, np.abs(1 - np.abs(tones[-1]) / np.abs(at_once[-1]))


def _drive(plan: BeamPlan, level: Array, array: ArrayDevice, focus: Array, acoustics: Acoustics) -> Drive:
    phase = np.broadcast_to(focus_phase(array.array, focus, acoustics=acoustics), (len(level), array.array.count))
    life = Provenance(source="beam on one cell")
    return Drive(phase=phase, level=level, rate=plan.rate, array=array.array, acoustics=acoustics, provenance=life)


def _quiet(sensor: SensorDevice, *, duration: float = 4.0) -> Recording:
    """What the sensor says while nothing plays."""
    sensor.start()
    try:
        samples = read_frames(sensor, round(duration * sensor.rate))
    finally:
        sensor.stop()
    return Recording(samples=samples, rate=sensor.rate, sensor=sensor.grid, unit=sensor.unit)


def _life(recording: Recording, array: ArrayDevice, plan: BeamPlan) -> Recording:
    """The first recording, with the life of the whole."""
    life = Provenance(source=f"measured by a beam of {array.name}", simulated=recording.provenance.simulated).then(
        "beam", {"array": array.name, "tones_hz": tuple(float(tone) for tone in plan.tones), "rate_hz": plan.rate}
    )
    return replace(recording, provenance=life)


def _check_rate(sensor: SensorDevice, plan: BeamPlan) -> None:
    ratio = sensor.rate / plan.rate
    if ratio < 1 or abs(ratio - round(ratio)) > 1e-6:
        raise RateError(
            f"{sensor.name}: expected a whole multiple of the beam's {plan.rate:g} Hz, got {sensor.rate:g} Hz"
        )
