"""Measure the transducers of an array by codes and a sensor above it; calibrate a sensor by a beam.

A tracker is placed by a palm that is held where the array marks places by a focus.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from midair.array_types import Array, Complex
from midair.calibration import (
    ArrayCheck,
    ArrayField,
    ArrayPlan,
    BeamPlan,
    BeamReading,
    BeamSetting,
    array_codes,
    beam_field,
    check_array,
    find_lag,
    fit_array,
    fit_tracker,
    focus_position,
    measure_beam,
    tone_amplitudes,
    typical_uncertainty,
)
from midair.correct import focused_drive
from midair.devices import ArrayDevice, ExposureChoices, SensorDevice, Tracker, amplitude_of, read_frames
from midair.errors import DeviceError, InputError, RateError
from midair.model import (
    HEIGHT,
    HEIGHTS,
    Acoustics,
    ArrayCalibration,
    Calibration,
    Drive,
    Progress,
    Provenance,
    Recording,
    TrackerPlacement,
)
from midair.physics import (
    TransducerDynamics,
    envelope,
    focus_amplitude,
    radiation_pressure,
    sound_amplitude,
    transfer_matrix,
)
from midair.rig.correction.iteration import Stage, no_progress
from midair.rig.session import Session
from midair.validation import length, within

FINE = 8
"""Points per frame at which the commanded pressure is computed."""


def calibrate_by_beam(
    array: ArrayDevice,
    sensor: SensorDevice,
    plan: BeamPlan | None = None,
    *,
    setting: BeamSetting | None = None,
    acoustics: Acoustics | None = None,
    exposure: ExposureChoices | None = None,
    date: str = "",
    version: int = 1,
    progress: Progress | None = None,
) -> Calibration:
    """Calibrate an open sensor with an open array.

    `plan` is the signal on each cell, `setting` the position of the sensor, the directivity of its cells, and their
    uncertainties, `acoustics` those of the array. The exposure limits of each drive are those of the default profile if
    None; `progress` is called with (cells done, total cells).

    MismatchError if only one of the two devices is simulated, RateError if the sensor's rate is not an integer multiple
    of the plan's rate, InputError if the array cannot reach the plan's pressure or the sensor does not detect the beam.
    """
    plan, setting = plan or BeamPlan(), setting or BeamSetting()
    acoustics = acoustics or Acoustics()
    steps = samples_per_frame(sensor, plan.rate, "the beam's")
    field = beam_field(array.array, sensor.grid, setting, acoustics=acoustics)
    strongest = float(field.middle.mean())
    # In the firmware's steps of 1/255.
    level = np.rint(255 * np.sqrt(plan.waveform * min(plan.top / strongest, 1.0))) / 255
    # An array with real firmware has discrete pulse widths.
    played = amplitude_of(np.rint(level * 255).astype(np.uint8)) if array.gated else level
    recordings: list[Recording] = []
    output: list[Complex] = []
    expected, commanded, slow = _command(plan, strongest, played)
    cells = sensor.grid.count
    for cell in range(cells):
        focus, source = focus_position(sensor.grid, cell, setting), "beam on one cell"
        drive = focused_drive(array.array, focus, level, rate=plan.rate, acoustics=acoustics, source=source)
        recording = Session.on(array, sensor, exposure).rerecord(drive, source="beam calibration")
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


def _command(plan: BeamPlan, strongest: float, played: Array) -> tuple[Array, Complex, Array]:
    """Commanded pressure at a focus: of each frame, of each tone, and the share lost to the dynamics."""
    fine = strongest * np.abs(envelope(played[:, None].astype(complex), plan.rate, FINE, TransducerDynamics())) ** 2
    still = strongest * np.repeat(played**2, FINE)[:, None]
    tones, at_once = (tone_amplitudes(pressure, FINE * plan.rate, plan)[..., 0] for pressure in (fine, still))
    # A sensor sample at the start of frame i is the mean from half a frame before to half a frame after.
    around = np.concatenate([np.zeros(FINE // 2), fine[:, 0]])[: len(fine)]
    return around.reshape(-1, FINE).mean(axis=1), tones, np.abs(1 - np.abs(tones[-1]) / np.abs(at_once[-1]))


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


_SILENCE = 1.0
"""Duration of the recording before the codes, in s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ArraySession:
    """Conditions under which codes are played."""

    height: float = HEIGHT
    """Height of the sensor above the array in m, to about 1 mm; the fit finds the rest."""
    plate: float = 0.0
    """Diameter in m of a rigid plate in which the sensor lies flush: the reflection of the array's face is measured."""
    acoustics: Acoustics = field(default_factory=Acoustics)
    """Air of the room and directivity."""
    exposure: ExposureChoices | None = None
    """Exposure limits of the codes; the default profile if None."""
    stage: Stage = no_progress
    """Called with the name of each stage at its start; returns its progress callback."""
    warn: Callable[[str], object] = bool
    """Called with a line for each fault of the recording that widens the uncertainties."""

    def __post_init__(self) -> None:
        length(self.height, "height", HEIGHTS)
        within(self.plate, "diameter of the plate", 0, 1, unit="m")


def calibrate_array(
    array: ArrayDevice,
    sensor: SensorDevice,
    plan: ArrayPlan | None = None,
    *,
    session: ArraySession | None = None,
    date: str = "",
) -> ArrayCalibration:
    """Measure the transducers of an open array, whose silencer is off, with an open, calibrated sensor.

    MismatchError if only one of the two devices is simulated, RateError if the sensor's rate is not an integer multiple
    of the codes' rate, InputError if the sensor has no calibration, does not detect the beam, clips, is too noisy, or
    moved by more than 0.5 mm.
    """
    session = session or ArraySession()
    model, samples, told = _recorded(array, sensor, plan or ArrayPlan(), session)
    found = fit_array(
        model,
        samples,
        synchronous=sensor.simulated,
        level_uncertainty=(typical_uncertainty(model.calibration, model.band) or 0.0) / 2,
        date=date,
        provenance=told,
        progress=session.stage("fit each group"),
    )
    _check_fit(found, session.warn)
    return found


def check_array_calibration(
    array: ArrayDevice, sensor: SensorDevice, known: ArrayCalibration, *, session: ArraySession | None = None
) -> ArrayCheck:
    """Compare an open array with its calibration by about two seconds of codes; devices and errors as above."""
    session = session or ArraySession()
    # Two numbers are measured for each of the four unknowns of a transducer.
    plan = ArrayPlan(duration=max(0.5, 2 * array.array.count / 996))
    model, samples, _ = _recorded(array, sensor, plan, session)
    return check_array(model, samples, known, synchronous=sensor.simulated)


def _recorded(
    array: ArrayDevice, sensor: SensorDevice, plan: ArrayPlan, session: ArraySession
) -> tuple[ArrayField, Array, Provenance]:
    """Play and record the codes of a plan; return the model, the samples from the first frame on, and their origin."""
    height, acoustics = session.height, session.acoustics
    known = sensor.calibration
    if known is None:
        raise InputError(f"{sensor.name}: expected a sensor with a calibration, got none; give one with --calibration")
    per = samples_per_frame(sensor, plan.rate, "the codes'")
    nominal = array.array.nominal
    codes = array_codes(nominal, sensor.grid, plan, acoustics=acoustics, height=height)
    drive = Drive(
        phase=codes.phase,
        level=np.full(codes.frames, codes.level),
        rate=codes.rate,
        array=nominal,
        acoustics=acoustics,
        provenance=Provenance(source=f"codes of {array.name}"),
    )
    model = ArrayField(
        array=nominal,
        codes=codes,
        acoustics=acoustics,
        calibration=known,
        height=height,
        rate=sensor.rate,
        plate=session.plate,
    )
    silence = record_silence(sensor, duration=_SILENCE)
    check_silence(silence.samples.reshape(silence.frames, -1), model, session.warn)
    how: Any = {"source": "array calibration", "tail": 0.1, "progress": session.stage("play codes")}
    recording = Session.on(array, sensor, session.exposure).rerecord(drive, **how)
    samples = recording.samples.reshape(recording.frames, -1)
    if sensor.full_scale is not None:
        clipped = float((np.abs(samples[:, list(codes.cells)]) >= 0.999 * sensor.full_scale).mean())
        if clipped > 0:
            raise InputError(
                f"{sensor.name}: expected no clipped sample under the beam, got {100 * clipped:.2g} % at full scale; "
                f"lower --top ({plan.top:g} Pa)"
            )
    if not sensor.simulated:
        expected = _expected(drive, sensor, list(codes.cells), height, per)
        samples = samples[find_lag(samples[:, list(codes.cells)].sum(axis=1), expected) :]
    told = {"array": array.name, "sensor": known.identifier, "seconds": plan.duration, "top_pa": plan.top}
    told |= {"height_m": height, "temperature_c": acoustics.medium.degrees}
    measured = Provenance(source=f"{array.name} heard by {sensor.name}", simulated=recording.provenance.simulated)
    return model, samples, measured.then("measure array", told)


def check_silence(samples: Array, model: ArrayField, warn: Callable[[str], object] = bool) -> None:
    """Compare a recording without sound, shape (frame, channel), with the noise of the sensor's calibration.

    Noise in the band above twice that of the calibration, or three times as much below 15 Hz as in the band (a draught,
    or someone walking), gives a warning; ten times the noise InputError.
    """
    cells = list(model.codes.cells)
    known = float(np.sqrt((model.calibration.noise.ravel()[cells] ** 2).mean()))
    some = samples[:, cells] - samples[:, cells].mean(axis=0)
    frequency = np.fft.rfftfreq(len(some), 1 / model.rate)
    density = 2 * np.square(np.abs(np.fft.rfft(some, axis=0))).mean(axis=1) / (model.rate * len(some))
    low, high = model.band
    noise = float(np.sqrt(density[(frequency >= low) & (frequency <= high)].mean()))
    slow = float(np.sqrt(density[(frequency >= 1) & (frequency < 15)].mean()))
    if known > 0 and noise > 2 * known:
        line = (
            f"the silent sensor: expected the noise of its calibration, got {noise / known:.1f} times as much; "
            "switch off what hums or shakes, and check the cable"
        )
        if noise > 10 * known:
            raise InputError(line)
        warn(line)
    if slow > 3 * noise > 0:
        warn(
            f"the silent sensor: expected still air, got {slow / noise:.1f} times the noise below 15 Hz; close doors "
            "and windows, switch off fans, and do not walk"
        )


def _check_fit(found: ArrayCalibration, warn: Callable[[str], object]) -> None:
    """Warn or raise InputError if the sensor moved during the codes; warn if the model leaves more than the noise."""
    told = found.provenance.last("fit array")
    moved, sure, left = (float(str(told[name])) for name in ("moved_m", "moved_uncertainty_m", "noise_ratio"))
    if moved > max(0.1e-3, 4 * sure):
        line = (
            f"the sensor: expected it at rest, got a movement of {1e3 * moved:.2f} mm (± {2e3 * sure:.2f} mm) during "
            "the codes; fix it and the array, and measure again"
        )
        if moved > 0.5e-3:
            raise InputError(line)
        warn(line)
    if left > _LEFT:
        warn(
            f"the fit: expected the noise of the sensor as remainder, got {left:.1f} times as much: draught, movement "
            "or echoes; the uncertainties contain it"
        )


_LEFT = 3.0
"""Remainder of a fit over the sensor's noise that gives a warning."""


def _expected(drive: Drive, sensor: SensorDevice, cells: list[int], height: float, per: int) -> Array:
    """Pressure in Pa, by the model, at the centre of the cells at each sample of the sensor."""
    foci = np.array([(*sensor.grid.channel_position(cell), height) for cell in cells])
    G = transfer_matrix(foci, drive.array, acoustics=drive.acoustics)
    pressure = radiation_pressure(drive.q @ G.T, drive.acoustics.medium).sum(axis=1)
    return np.repeat(pressure, per)


PLACES = np.array([[-0.05, -0.04, 0.18], [0.05, -0.04, 0.22], [0.05, 0.04, 0.18], [-0.05, 0.04, 0.22]])
"""Default places, in m."""
ROUND, ROUNDS, RATE, TONE = 2.0, 30, 1000.0, 200.0
"""Length of a focus in s, most repeats for a place, frame rate and modulation in Hz."""
STILL, STEADY = 2e-3, 20
"""Largest standard deviation in m, and least number of poses in the last second, of a palm that is held still."""


def calibrate_tracker(
    tracker: Tracker,
    array: ArrayDevice,
    *,
    top: float = 100.0,
    acoustics: Acoustics | None = None,
    exposure: ExposureChoices,
    say: Callable[[int], None],
    entered: Callable[[], bool] = lambda: False,
) -> TrackerPlacement:
    """Mark each place by a focus until the palm is held still there, and fit the placement.

    Devices are open, and the tracker in its own coordinates; `top` is the highest pressure of the focus in Pa. `say`
    gets the index of a place before it is marked; `entered` returns whether the person confirmed the place since the
    last call, which accepts a palm that is not still.

    ExposureError if the focus exceeds the profile, DeviceError if the palm is not held still for a minute or the
    tracker sends nothing, InputError if the places are collinear or do not fit; `fit_tracker`.
    """
    held, session = list[Array](), Session.on(array, None, exposure)
    for at, place in enumerate(PLACES):
        cleared = session.clear(_focus(array, place, top, acoustics or Acoustics()))
        say(at)
        said = tracker.clock()
        for _ in range(ROUNDS):
            session.play(cleared, source="calibrate tracker")
            seen = tracker.poses(since=max(said, tracker.clock() - 1.0))
            if seen is None or len(seen.time) < STEADY:
                continue
            if entered() or seen.centre.std(axis=0).max() < STILL:
                held.append(np.median(seen.centre, axis=0))
                break
        else:
            state = tracker.status().state
            raise DeviceError(
                f"{tracker.name}: expected a palm held still at place {at + 1} within {ROUND * ROUNDS:.0f} s, got none "
                f"(the tracker is {state}); hold it where the focus is felt"
            )
    return fit_tracker(np.array(held), PLACES)


def _focus(array: ArrayDevice, place: Array, top: float, acoustics: Acoustics) -> Drive:
    """A focus whose pressure swings between 0 and `top`, as far as the array reaches it."""
    times = np.arange(round(ROUND * RATE)) / RATE
    reached = focus_amplitude(place[None], array.array, acoustics=acoustics)
    strongest = min(1.0, float(sound_amplitude(np.array(top), acoustics.medium)) / reached)
    level = strongest * np.abs(np.sin(np.pi * TONE * times))
    return focused_drive(array.array, place, level, rate=RATE, acoustics=acoustics, source="focus on a place")
