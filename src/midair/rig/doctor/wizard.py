"""Check a real array on the first day: wiring, dead transducers, heat, air, placement and sound at the ears.

Everything sounds inside a `Session` only, so that an error, Ctrl-C, a signal or `midair stop` leaves silence.
"""

import json
from collections.abc import Callable
from dataclasses import asdict, replace
from datetime import UTC, datetime
from pathlib import Path
from urllib.parse import quote

import numpy as np
import scipy
from numpy.typing import NDArray

from midair.array_types import Array
from midair.calibration import find_lag
from midair.correct import focused_drive
from midair.devices import ArrayDevice, ExposureChoices, SensorDevice, make_state_folder, measure_exposure, state_folder
from midair.errors import ExposureError, InputError
from midair.files import write_file
from midair.model import HEIGHT, Acoustics, Drive, Medium, Provenance, TransducerArray
from midair.physics import focus_phase, radiation_pressure, transfer_matrix
from midair.rig.bench.identify import tone_answers
from midair.rig.doctor.checkup import Check, broken, missing, ok, report_findings
from midair.rig.session import Session

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
    place = scipy.optimize.linear_sum_assignment(-np.log(np.maximum(strength, floor)))[1]
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
    recording = Session.on(array, sensor, choices).rerecord(drive, source="doctor --wizard", tail=0.1)
    return recording.samples.reshape(recording.frames, -1)


Ask = Callable[[str], str | None]
"""Asks a person, and returns the answer without spaces and in lower case; None if no person is there."""

NOISY = 0.2
"""Uncertainty of the relative strength above which a transducer is not judged."""


def run_wizard(
    array: ArrayDevice,
    ask: Ask,
    choices: ExposureChoices,
    *,
    sensor: SensorDevice | None = None,
    height: float = HEIGHT,
) -> list[Check]:
    """Check an open array, whose silencer is off, with a person, a sensor, or neither.

    The sensor is open and lies face down over the centre of the array at a height in m. `choices` limits everything
    that sounds; without an override, clicks are attenuated to meet them.
    """
    if sensor is not None:
        check_sensor_rate(sensor, len(np.unique(array.array.unit)))
    air, choices = _air(ask, choices)
    acoustics = Acoustics() if choices.room is None else Acoustics(medium=choices.room)
    checks = [*report_findings(array.name, array.describe()), air, _placement(array, ask)]
    # The strongest focus, and the level at which it meets the profile.
    focus = np.array([0.0, 0.0, height])
    drive = focused_drive(array.array, focus, np.ones(1), rate=1000.0, acoustics=acoustics, source="focus")
    found = measure_exposure(drive, array.array, choices.profile, steps=array.steps_a_turn, room=choices.room)
    level = min(1.0, 10 ** (-found.excess / 20))
    # Rounded down, so that the printed level keeps the limit.
    digits = 10.0 ** (1 - np.floor(np.log10(level)))
    level = np.floor(level * digits) / digits
    said = f"a still focus at full drive: {found.verdict()}; at most {level:.2g} of full drive keeps it"
    checks.append(ok("ears", said, "keep ears outside the places of the profile: midair exposure --help"))
    units = [int(unit) for unit in np.unique(array.array.unit)]
    try:
        if sensor is not None:
            checks.append(_wiring(list(places_of_units(array, sensor, choices, height)), units))
            checks.append(_transducers(*transducer_strengths(array, sensor, choices, height), array.array.unit))
    except ExposureError as wrong:
        checks.append(missing("sensor", str(wrong)))
    if sensor is None:
        drives = [click_drive(array.array, unit, height=height, acoustics=acoustics) for unit in units]
        checks.append(_wiring_by_ear(array, ask, choices, units, drives))
        advice = "lay a sensor face down over the centre of the array, and name it: --sensor"
        checks.append(missing("transducers", "not checked without a sensor", advice))
    return [*checks, _heat(array)]


def click_drive(array: TransducerArray, unit: int, *, height: float, acoustics: Acoustics) -> Drive:
    """Five clicks of one unit in a second: bursts of 125 Hz, focused at a height above its centre."""
    inside = array.unit == unit
    focus = array.position[inside].mean(axis=0) + height * array.normal[inside][0]
    frame = np.arange(1000)
    sounds = (frame % 200 < 80) & (frame % 8 < 4)
    level, source = (sounds[:, None] & inside).astype(float), f"clicks of unit {unit}"
    return focused_drive(array, focus, level, rate=1000.0, acoustics=acoustics, source=source)


def store_checkup(device: str, checks: list[Check]) -> Path:
    """Store the dated report of an array in the state folder; return its path. Raises FileError if it cannot."""
    path, now = make_state_folder() / _name(device), datetime.now(UTC).isoformat(timespec="seconds")
    report = {"device": device, "time": now, "checks": [asdict(each) for each in checks]}
    write_file(path, json.dumps(report, indent=2))
    return path


def checkup_line(device: str, typed: str = "") -> str:
    """Age and result of the stored report of an array, in one line; `typed` is the name that was typed for it."""
    try:
        stored = json.loads((state_folder() / _name(device)).read_bytes())
        made = datetime.fromisoformat(stored["time"])
        states = [each["state"] for each in stored["checks"]]
        age = datetime.now(UTC) - made
    except (OSError, ValueError, TypeError, KeyError) as wrong:
        kept = "never" if isinstance(wrong, FileNotFoundError) else "unreadable"
        return f'{kept}: midair doctor --device "{typed or device}" --wizard'
    ago = f"{age.days} days" if age.days else f"{age.seconds // 3600} hours"
    found = f"{states.count('broken')} of {len(states)} broken, {states.count('missing')} not checked"
    return f"{made.astimezone():%Y-%m-%d %H:%M}, {ago} ago: {found}"


def _name(device: str) -> str:
    return f"checkup-{quote(device, safe='')}.json"


def _air(ask: Ask, choices: ExposureChoices) -> tuple[Check, ExposureChoices]:
    """The air of the room, stated by an option or by the person."""
    while choices.room is None:
        answer = ask("temperature of the room beside the array in degrees Celsius (Enter: unknown): ")
        if not answer:
            return missing("air", "unknown; any of 14 to 30 °C counts", "state --temperature"), choices
        try:
            choices = replace(choices, room=Medium.at(temperature=float(answer.removesuffix("c"))))
        except ValueError:
            continue
    return ok("air", str(choices.room)), choices


def _placement(array: ArrayDevice, ask: Ask) -> Check:
    model = array.array
    centres = {unit: 1e3 * model.position[model.unit == unit].mean(axis=0) for unit in np.unique(model.unit)}
    text = "; ".join(f"{unit}: {x:.0f}, {y:.0f}, {z:.0f}" for unit, (x, y, z) in centres.items())
    found = f"centres of the units in mm, x to the right, y away from you, z up: {text}"
    answer = _one_of(ask, f"{found}\ndo the units lie there? y or n: ", "y", "n")
    if answer == "y":
        return ok("placement", found)
    advice = "measure the distances, and describe the units in a file: --placement FILE.toml"
    return (missing if answer is None else broken)("placement", found, advice)


def _heat(array: ArrayDevice) -> Check:
    found = array.describe().get("temperature")
    if found is None:
        return missing("heat", "not reported by this array", "feel the units")
    if found == "too hot":
        return broken("heat", found, "let the units cool, check their fans")
    return ok("heat", f"{found} at the end")


def _wiring_by_ear(
    array: ArrayDevice, ask: Ask, choices: ExposureChoices, units: list[int], drives: list[Drive]
) -> Check:
    """Let one unit click at a time; the person names it."""
    heard = list[str | None]()
    session = Session.on(array, None, replace(choices, attenuate=choices.override is None))
    for drive in drives:
        cleared = session.clear(drive)
        level = float(cleared.clearance.check_for(array).level.max())
        question = f"clicks at {level:.2g} of full drive: which unit? {units[0]} to {units[-1]}, n: none, r: again: "
        answer: str | None = "r"
        while answer == "r":
            session.play(cleared, source=drive.provenance.source)
            answer = _one_of(ask, question, "n", "r", *map(str, units))
        heard.append(answer)
    if None in heard:
        found = f"units {', '.join(map(str, units))} clicked in this order; not confirmed"
        return missing("wiring", found, "run it with a person or --sensor")
    return _wiring([None if each == "n" else int(str(each)) for each in heard], units)


def _wiring(places: list[int | None], units: list[int]) -> Check:
    if places == units:
        return ok("wiring", f"units {', '.join(map(str, units))} sound from their places")
    wrong = [
        f"the place of unit {unit} was not found"
        if place is None
        else f"commands for unit {unit} sound from the place of {place}"
        for unit, place in zip(units, places, strict=True)
        if place != unit
    ]
    advice = (
        "check the power of silent units and that the sensor lies over the centre; exchange cables, or the entries in "
    )
    return broken("wiring", ", ".join(wrong), advice + "the placement file")


def _transducers(strength: Array, uncertainty: Array, unit: NDArray[np.int64]) -> Check:
    judged = uncertainty < NOISY
    dead = np.flatnonzero(judged & (strength < DEAD))
    found = f"{len(dead)} of {judged.sum()} dead, {(~judged).sum()} too weak at the sensor to be judged"
    unknown = [str(each) for each in np.unique(unit) if judged[unit == each].mean() < 0.5]
    if unknown:
        found += f"; most of unit {', '.join(unknown)} cannot be judged"
    if unknown and not len(dead):
        advice = "check that these units sound, the height and the sensor; for more sound leave the room, and give "
        advice += "--override-exposure NAME"
        return missing("transducers", found, advice)
    if not len(dead):
        return ok("transducers", found)
    return broken("transducers", f"{found}: {', '.join(map(str, dead[:20]))}", "midair calibrate array measures them")


def _one_of(ask: Ask, question: str, *allowed: str) -> str | None:
    """Ask until the answer is allowed, at most 10 times."""
    for _ in range(10):
        answer = ask(question)
        if answer is None or answer in allowed:
            return answer
    raise InputError(f"expected one of {', '.join(allowed)}, got other answers; no report was stored")
