"""Check an array with a sensor above its centre: which unit each command reaches, and which transducers are dead."""

import numpy as np

from midair.array_types import Array
from midair.calibration import find_lag
from midair.devices import ArrayDevice, ExposureChoices, SensorDevice, check_exposure
from midair.errors import InputError
from midair.model import Acoustics, Drive, Provenance
from midair.physics import focus_phase, radiation_pressure, transfer_matrix
from midair.rig.bench import tone_answers
from midair.rig.playing import rerecord

RATE = 1000.0
"""Frame rate of the drives in Hz; the sensor's rate must be a multiple."""
TONE, STEP = 60.0, 24.0
"""Tone of the first place and distance of the tones in Hz."""
TOP = 100.0
"""Highest pressure in the focus in Pa; full drive if that is weaker."""
PERIOD = 12
"""Frames in which a transducer turns its phase and back, a tone of 83 Hz."""
SYNC = np.concatenate([np.repeat(np.random.default_rng(0).integers(0, 2, 64), 8), np.ones(100, int)])
"""Levels that mark the beginning of a drive in a recording, until the sensor has settled."""
HEARD = 5.0
"""Multiple of the noise from which a unit is detected."""
CLEAR = 1.4
"""Factor by which its true place must exceed any other: a grating lobe of AUTD3's neighbouring places reaches half."""
DEAD = 0.3
"""Strength relative to the others below which a transducer counts as dead."""


def check_sensor_rate(sensor: SensorDevice, units: int) -> None:
    """Refuse a sensor that cannot record the drives of this module, before anything sounds."""
    per = round(sensor.rate / RATE)
    if per < 1 or abs(per * RATE - sensor.rate) > 1e-6:
        raise InputError(f"{sensor.name}: expected a rate that is a multiple of {RATE:g} Hz, got {sensor.rate:g} Hz")
    if TONE + STEP * (units - 1) >= sensor.rate / 2:
        raise InputError(f"{sensor.name}: expected a higher rate for {units} units, got {sensor.rate:g} Hz")


def places_of_units(
    array: ArrayDevice, sensor: SensorDevice, choices: ExposureChoices, height: float
) -> tuple[int | None, ...]:
    """Find the place from which each unit sounds, by the number that the placement gives it; None if uncertain."""
    # One unit sounds at a time, with the phases that focus from each place in turn onto the sensor; each place has a
    # tone of its own. Only the phases of the true place give a focus there.
    from scipy.optimize import linear_sum_assignment

    model = array.array.nominal
    units, count = np.unique(model.unit, return_counts=True)
    tones = np.asarray(TONE + STEP * np.arange(len(units)), np.float64)
    if len(units) > 16 or len(set(count)) > 1:
        raise InputError(f"{array.name}: expected up to 16 units of one kind, got {len(units)}")
    acoustics = _acoustics(choices)
    focus = np.array([0.0, 0.0, height])
    phase = focus_phase(model, focus, acoustics=acoustics)
    strongest = np.abs(transfer_matrix(focus[None], model, acoustics=acoustics))[0, model.unit == units[0]].sum()
    frames = round(0.25 * RATE)
    time = np.arange(frames * len(units)) / RATE
    tone = np.sqrt((1 - np.cos(2 * np.pi * np.repeat(tones, frames) * time)) / 2)
    answers: list[Array] = []
    noises: list[float] = []
    for unit in units:
        inside = model.unit == unit
        steps = np.zeros((len(time), model.count))
        steps[:, inside] = np.repeat([phase[model.unit == place] for place in units], frames, axis=0)
        level = _level(float(strongest), acoustics) * tone[:, None] * inside
        answer, noise = tone_answers(_recorded(steps, level, array, sensor, choices), sensor.rate, tones)
        answers.append(np.linalg.norm(answer, axis=1))
        noises.append(float(np.linalg.norm(noise)))
    strength, floor = np.array(answers), np.maximum(noises, 1e-12)[:, None]
    place = linear_sum_assignment(-np.log(np.maximum(strength, floor)))[1]
    others = np.where(np.arange(len(units)) == place[:, None], 0, strength).max(axis=1)
    certain = strength[np.arange(len(units)), place] > np.maximum(CLEAR * others, HEARD * floor[:, 0])
    return tuple(int(at) if sure else None for at, sure in zip(place, certain, strict=True))


def transducer_strengths(
    array: ArrayDevice, sensor: SensorDevice, choices: ExposureChoices, height: float
) -> tuple[Array, Array]:
    """Strength of each transducer relative to its unit, and its standard uncertainty, shape (transducer,) each."""
    # One unit after the other focuses on a cell near the centre of the sensor, and one transducer after the other turns
    # its phase by half a turn, which lowers the pressure by four times its share of the amplitude.
    per = round(sensor.rate / RATE)
    model, acoustics = array.array.nominal, _acoustics(choices)
    cells = np.array([(*sensor.grid.channel_position(cell), height) for cell in range(sensor.grid.count)])
    target = int(np.linalg.norm(cells[:, :2], axis=1).argmin())
    phase = focus_phase(model, cells[target], acoustics=acoustics)
    share = transfer_matrix(cells, model, acoustics=acoustics) * np.exp(1j * phase)
    strength, uncertainty = np.zeros(model.count), np.zeros(model.count)
    for unit in np.unique(model.unit):
        members = np.flatnonzero(model.unit == unit)
        level = _level(float(np.abs(share[target, members].sum())), acoustics)
        lasts = len(SYNC) + PERIOD * len(members)
        frame = np.arange(lasts - len(SYNC))
        turned = (frame % PERIOD < PERIOD // 2)[:, None] & (frame[:, None] // PERIOD == np.arange(len(members)))
        steps = np.tile(phase, (lasts, 1))
        steps[np.ix_(np.arange(len(SYNC), lasts), members)] += np.pi * turned
        gate = np.concatenate([SYNC, np.ones(len(frame))])
        levels = level * gate[:, None] * (model.unit == unit)
        samples = _recorded(steps, levels, array, sensor, choices)
        whole = level * share[:, members].sum(axis=1)
        normal = radiation_pressure(whole, acoustics.medium)
        expected = radiation_pressure(whole - 2 * level * share[:, members].T, acoustics.medium) - normal
        course = gate * normal[target]
        course[len(SYNC) :] += turned @ expected[:, target]
        lag = 0 if sensor.simulated else find_lag(samples[:, target], course.repeat(per))
        samples = samples[lag + len(SYNC) * per :][: len(frame) * per].reshape(len(members), PERIOD * per, -1)
        strength[members], uncertainty[members] = _fit(samples, expected, PERIOD * per)
    return strength, uncertainty


def _fit(samples: Array, expected: Array, period: int) -> tuple[Array, Array]:
    """Strength and uncertainty from samples (transducer, sample, channel) and expected steps (transducer, channel)."""
    turn = np.exp(-2j * np.pi * np.arange(samples.shape[1]) / period)
    found = np.einsum("tsc,s->tc", samples, turn)
    gain = (found * expected).sum(axis=0) / np.square(expected).sum(axis=0)
    weight = np.linalg.norm(np.abs(gain) * expected, axis=1)
    # In units of the noise, which is the same for all: the tone of a transducer has the phase of the others' tones.
    clear = (found * gain.conj() * expected).sum(axis=1) / weight
    scale = float(np.median(clear.real / weight))
    if not scale > 0:  # silence: the noise has the sign by chance
        return np.zeros(len(weight)), np.full(len(weight), np.inf)
    return clear.real / weight / scale, np.std(clear.imag) / weight / scale


def _level(amplitude: float, acoustics: Acoustics) -> float:
    return min(1.0, float(np.sqrt(TOP / radiation_pressure(np.array([amplitude]), acoustics.medium)[0])))


def _acoustics(choices: ExposureChoices) -> Acoustics:
    return Acoustics() if choices.room is None else Acoustics(medium=choices.room)


def _recorded(phase: Array, level: Array, array: ArrayDevice, sensor: SensorDevice, choices: ExposureChoices) -> Array:
    """Samples, shape (frame, channel), while a drive plays."""
    drive = Drive(
        phase=phase,
        level=level,
        rate=RATE,
        array=array.array,
        acoustics=_acoustics(choices),
        provenance=Provenance(source="doctor --wizard"),
    )
    recording = rerecord(check_exposure(drive, array, choices), array, sensor, source="doctor --wizard", tail=0.1)
    return recording.samples.reshape(recording.frames, -1)
