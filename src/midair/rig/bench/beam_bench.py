"""Calibrate a sensor with a focused beam on each of its cells."""

from dataclasses import replace

import numpy as np

from midair.array_types import Array, Complex
from midair.calibration import (
    BeamPlan,
    BeamReading,
    BeamSetting,
    beam_field,
    find_lag,
    focus_position,
    measure_beam,
    tone_amplitudes,
)
from midair.devices import ArrayDevice, ExposureChoices, SensorDevice, amplitude_of, check_exposure, read_frames
from midair.errors import RateError
from midair.model import Acoustics, Calibration, Drive, Progress, Provenance, Recording
from midair.physics import TransducerDynamics, envelope, focus_phase
from midair.rig.playing import default_exposure, rerecord

FINE = 8
"""Points per frame at which the commanded pressure is computed."""


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
    """Calibrate an open sensor with an open array.

    `plan` is the signal on each cell, `setting` the position of the sensor, the directivity of its cells, and their
    uncertainties, `acoustics` and `dynamics` the model of the array. The exposure limits of each drive are those of the
    default profile if None; `progress` is called with (cells done, total cells).

    MismatchError if only one of the two devices is simulated, RateError if the sensor's rate is not an integer multiple
    of the plan's rate, InputError if the array cannot reach the plan's pressure or the sensor does not detect the beam.
    """
    plan, setting = plan or BeamPlan(), setting or BeamSetting()
    acoustics, dynamics = acoustics or Acoustics(), dynamics or TransducerDynamics()
    steps = samples_per_frame(sensor, plan.rate, "the beam's")
    field = beam_field(array.array, sensor.grid, setting, acoustics=acoustics)
    strongest = float(field.middle.mean())
    # In the firmware's steps of 1/255.
    level = np.rint(255 * np.sqrt(plan.waveform * min(plan.top / strongest, 1.0))) / 255
    # An array with real firmware has discrete pulse widths.
    played = amplitude_of(np.rint(level * 255).astype(np.uint8)) if array.gated else level
    recordings: list[Recording] = []
    output: list[Complex] = []
    expected, commanded, slow = _command(plan, strongest, played, dynamics)
    cells = sensor.grid.count
    for cell in range(cells):
        drive = _drive(plan, level, array, focus_position(sensor.grid, cell, setting), acoustics)
        admission = check_exposure(drive, array, exposure or default_exposure())
        recording = rerecord(admission, array, sensor, source="beam calibration")
        flat = recording.samples.reshape(recording.frames, -1)
        lag = find_lag(flat[:, cell], np.repeat(expected, steps))
        output.append(tone_amplitudes(flat, sensor.rate, plan, lag=lag))
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
        # The beam begins anywhere within a frame: standard deviation of a uniform distribution.
        timing=1 / (np.sqrt(12) * plan.rate),
    )
    # The first recording, with the provenance of the whole measurement.
    life = Provenance(source=f"measured by a beam of {array.name}", simulated=recordings[0].provenance.simulated).then(
        "beam", {"array": array.name, "tones_hz": tuple(float(tone) for tone in plan.tones), "rate_hz": plan.rate}
    )
    told = replace(recordings[0], provenance=life)
    return measure_beam(reading, sensor=told, quiet=record_silence(sensor), date=date, version=version)


def _command(
    plan: BeamPlan, strongest: float, played: Array, dynamics: TransducerDynamics
) -> tuple[Array, Complex, Array]:
    """Commanded pressure at a focus: of each frame, of each tone, and the share lost to the dynamics."""
    fine = strongest * np.abs(envelope(played[:, None].astype(complex), plan.rate, FINE, dynamics)) ** 2
    still = strongest * np.repeat(played**2, FINE)[:, None]
    tones, at_once = (tone_amplitudes(pressure, FINE * plan.rate, plan)[..., 0] for pressure in (fine, still))
    # A sensor sample at the start of frame i is the mean from half a frame before to half a frame after.
    around = np.concatenate([np.zeros(FINE // 2), fine[:, 0]])[: len(fine)]
    return around.reshape(-1, FINE).mean(axis=1), tones, np.abs(1 - np.abs(tones[-1]) / np.abs(at_once[-1]))


def _drive(plan: BeamPlan, level: Array, array: ArrayDevice, focus: Array, acoustics: Acoustics) -> Drive:
    phase = np.broadcast_to(focus_phase(array.array, focus, acoustics=acoustics), (len(level), array.array.count))
    life = Provenance(source="beam on one cell")
    return Drive(phase=phase, level=level, rate=plan.rate, array=array.array, acoustics=acoustics, provenance=life)


def record_silence(sensor: SensorDevice, *, duration: float = 4.0) -> Recording:
    """Record the sensor while nothing plays, for a duration in s."""
    sensor.start()
    try:
        samples = read_frames(sensor, round(duration * sensor.rate))
    finally:
        sensor.stop()
    return Recording(samples=samples, rate=sensor.rate, sensor=sensor.grid, unit=sensor.unit)


def samples_per_frame(sensor: SensorDevice, rate: float, whose: str) -> int:
    """Samples of a sensor in one frame at a rate in Hz; RateError if that is no integer."""
    ratio = sensor.rate / rate
    if ratio < 1 or abs(ratio - round(ratio)) > 1e-6:
        raise RateError(f"{sensor.name}: expected an integer multiple of {whose} {rate:g} Hz, got {sensor.rate:g} Hz")
    return round(ratio)
