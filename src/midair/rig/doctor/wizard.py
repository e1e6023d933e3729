"""Check a real array on the first day: wiring, dead transducers, heat, air, placement and sound at the ears.

Everything sounds inside `play_cleared` only, so that an error, Ctrl-C, a signal or `midair stop` leaves silence.
"""

import json
import os
from collections.abc import Callable
from dataclasses import asdict, replace
from datetime import UTC, datetime
from pathlib import Path
from urllib.parse import quote

import numpy as np

from midair.devices import (
    ArrayDevice,
    ExposureChoices,
    SensorDevice,
    check_exposure,
    make_state_folder,
    measure_exposure,
    state_folder,
)
from midair.errors import ExposureError, FileError, InputError
from midair.model import HEIGHT, Acoustics, Drive, Medium, Provenance, TransducerArray
from midair.physics import focus_phase
from midair.rig.doctor.array_by_sensor import DEAD, places_of_units, transducer_strengths
from midair.rig.doctor.array_checkup import report_findings
from midair.rig.doctor.check import Check
from midair.rig.playing import play_cleared

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
    """Check an open array with a person, a sensor, or neither.

    Parameters
    ----------
    array : ArrayDevice
        Open, with the silencer off.
    ask : callable
        Asks a person; see `Ask`. Without answers, what only a person can confirm is "missing".
    choices : ExposureChoices
        Limits of everything that sounds; without an override clicks are attenuated to meet them.
    sensor : SensorDevice, optional
        Open, face down over the centre of the array; it then finds the order of the units and dead transducers.
    height : float
        Height of the sensor, and of the focus of the clicks, above the array in m.

    Raises
    ------
    InputError, DeviceError
        If `ask` raises it; if the array fails. The array is silent then.
    """
    air, choices = _air(ask, choices)
    checks = [
        *report_findings(array.name, array.describe()),
        air,
        _placement(array, ask),
        _ears(array, choices, height),
    ]
    if sensor is None:
        advice = "lay a sensor face down over the centre of the array, and name it: --sensor"
        checks.append(_wiring_by_ear(array, ask, choices, height))
        checks.append(
            Check(subject="transducers", state="missing", found="not checked without a sensor", advice=advice)
        )
    else:
        checks.append(_wiring_by_sensor(array, sensor, choices, height))
        checks.append(_transducers(array, sensor, choices, height))
    return [*checks, _heat(array)]


def click_drive(array: TransducerArray, unit: int, *, height: float, acoustics: Acoustics | None = None) -> Drive:
    """Five clicks of one unit in a second: bursts of 125 Hz, focused at a height above its centre."""
    inside = array.unit == unit
    focus = array.position[inside].mean(axis=0) + height * array.normal[inside][0]
    frame = np.arange(1000)
    sounds = (frame % 200 < 80) & (frame % 8 < 4)
    return Drive(
        phase=np.broadcast_to(focus_phase(array, focus, acoustics=acoustics), (len(frame), array.count)),
        level=(sounds[:, None] & inside).astype(float),
        rate=1000.0,
        array=array,
        acoustics=acoustics or Acoustics(),
        provenance=Provenance(source=f"clicks of unit {unit}"),
    )


def store_checkup(device: str, checks: list[Check]) -> Path:
    """Store the dated report of an array in the state folder; return its path. Raises FileError if it cannot."""
    path, now = _path(device), datetime.now(UTC).isoformat(timespec="seconds")
    aside = make_state_folder() / f"{path.name}.{os.getpid()}"
    text = json.dumps({"device": device, "time": now, "checks": [asdict(each) for each in checks]}, indent=2)
    try:
        aside.write_text(text, encoding="utf-8")
        aside.replace(path)
    except OSError as wrong:
        raise FileError(f"{path}: {wrong.strerror}; set MIDAIR_STATE to a folder with free space") from wrong
    return path


def checkup_line(device: str) -> str:
    """Age and result of the stored report of an array, in one line."""
    try:
        stored = json.loads(_path(device).read_bytes())
        made = datetime.fromisoformat(stored["time"])
        states = [each["state"] for each in stored["checks"]]
        age = datetime.now(UTC) - made
    except FileNotFoundError:
        return f"never: midair doctor --device {device} --wizard"
    except (OSError, ValueError, TypeError, KeyError):
        return f"unreadable: midair doctor --device {device} --wizard"
    ago = f"{age.days} days" if age.days else f"{age.seconds // 3600} hours"
    found = f"{states.count('broken')} of {len(states)} broken, {states.count('missing')} not checked"
    return f"{made.astimezone():%Y-%m-%d %H:%M}, {ago} ago: {found}"


def _path(device: str) -> Path:
    return state_folder() / f"checkup-{quote(device, safe='')}.json"


def _air(ask: Ask, choices: ExposureChoices) -> tuple[Check, ExposureChoices]:
    """The air of the room, stated by an option or by the person."""
    while choices.room is None:
        answer = ask("temperature of the room beside the array in degrees Celsius (Enter: unknown): ")
        if not answer:
            advice = "put a thermometer beside the array, and state --temperature"
            return Check(
                subject="air", state="missing", found="unknown; any of 14 to 30 °C counts", advice=advice
            ), choices
        try:
            choices = replace(choices, room=Medium.at(temperature=float(answer.removesuffix("c"))))
        except ValueError:
            continue
    return Check(subject="air", state="ok", found=str(choices.room)), choices


def _placement(array: ArrayDevice, ask: Ask) -> Check:
    model, text = array.array, []
    for unit in np.unique(model.unit):
        x, y, z = 1e3 * model.position[model.unit == unit].mean(axis=0)
        text.append(f"{unit}: {x:.0f}, {y:.0f}, {z:.0f}")
    found = f"centres of the units in mm, x to the right, y away from you, z up: {'; '.join(text)}"
    answer = _one_of(ask, f"{found}\ndo the units lie there? y or n: ", ("y", "n"))
    state = "missing" if answer is None else "ok" if answer == "y" else "broken"
    advice = "" if state == "ok" else "measure the distances, and describe the units in a file: --placement FILE.toml"
    return Check(subject="placement", state=state, found=found, advice=advice)


def _ears(array: ArrayDevice, choices: ExposureChoices, height: float) -> Check:
    """Sound at the ears of the strongest focus, and the level at which it meets the profile."""
    focus = focus_phase(array.array, np.array([0.0, 0.0, height]), acoustics=_acoustics(choices))
    drive = Drive(phase=focus[None], level=np.ones(1), rate=1000.0, array=array.array, acoustics=_acoustics(choices))
    found = measure_exposure(drive, array.array, choices.profile, steps=array.steps_a_turn, room=choices.room)
    level = min(1.0, 10 ** (-found.excess / 20))
    return Check(
        subject="ears",
        state="ok",
        found=f"a still focus at full drive: {found.verdict()}; at most {level:.2g} of full drive keeps it",
        advice="keep ears outside the places of the profile: midair exposure --help",
    )


def _heat(array: ArrayDevice) -> Check:
    """Heat of the units after everything that sounded."""
    found = array.describe().get("temperature")
    if found is None:
        return Check(subject="heat", state="missing", found="not reported by this array", advice="feel the units")
    advice = "let the units cool, check their fans" if found == "too hot" else ""
    return Check(subject="heat", state="broken" if advice else "ok", found=f"{found} at the end", advice=advice)


def _wiring_by_ear(array: ArrayDevice, ask: Ask, choices: ExposureChoices, height: float) -> Check:
    """Let one unit click at a time; the person names it."""
    units = [int(unit) for unit in np.unique(array.array.unit)]
    heard: list[str | None] = []
    for unit in units:
        drive = click_drive(array.array, unit, height=height, acoustics=_acoustics(choices))
        admission = check_exposure(drive, array, replace(choices, attenuate=choices.override is None))
        level = 0.0 if admission.drive is None else float(admission.drive.level.max())
        answer: str | None = "r"
        while answer == "r":
            play_cleared(admission, array, source=drive.provenance.source)
            question = (
                f"clicks at {level:.2g} of full drive: which unit? {units[0]} to {units[-1]}, n: none, r: again: "
            )
            answer = _one_of(ask, question, ("n", "r", *map(str, units)))
        heard.append(answer)
    names = ", ".join(map(str, units))
    if None in heard:
        found = f"units {names} clicked in this order; not confirmed"
        return Check(subject="wiring", state="missing", found=found, advice="run it with a person or --sensor")
    return _wiring([None if each == "n" else int(str(each)) for each in heard], units)


def _wiring_by_sensor(array: ArrayDevice, sensor: SensorDevice, choices: ExposureChoices, height: float) -> Check:
    try:
        found = places_of_units(array, sensor, choices, height)
    except ExposureError as wrong:
        return Check(subject="wiring", state="missing", found=str(wrong))
    return _wiring(list(found), [int(unit) for unit in np.unique(array.array.unit)])


def _wiring(places: list[int | None], units: list[int]) -> Check:
    if places == units:
        found = f"units {', '.join(map(str, units))} sound from their places"
        return Check(subject="wiring", state="ok", found=found)
    wrong = [
        f"unit {unit} is not detected" if place is None else f"commands for unit {unit} sound from the place of {place}"
        for unit, place in zip(units, places, strict=True)
        if place != unit
    ]
    advice = "exchange cables, or the entries in the placement file; check the power of silent units"
    return Check(subject="wiring", state="broken", found=", ".join(wrong), advice=advice)


def _transducers(array: ArrayDevice, sensor: SensorDevice, choices: ExposureChoices, height: float) -> Check:
    subject = "transducers"
    try:
        strength, uncertainty = transducer_strengths(array, sensor, choices, height)
    except ExposureError as wrong:
        return Check(subject=subject, state="missing", found=str(wrong))
    judged = uncertainty < NOISY
    dead = np.flatnonzero(judged & (strength < DEAD))
    found = f"{len(dead)} of {judged.sum()} dead, {(~judged).sum()} too weak at the sensor to be judged"
    if judged.mean() < 0.5:
        advice = "check the height and the sensor; for more sound leave the room, and give --override-exposure NAME"
        return Check(subject=subject, state="missing", found=found, advice=advice)
    if not len(dead):
        return Check(subject=subject, state="ok", found=found)
    names = ", ".join(str(number) for number in dead[:20]) + (" and more" if len(dead) > 20 else "")
    return Check(
        subject=subject, state="broken", found=f"{found}: {names}", advice="midair calibrate array measures them"
    )


def _one_of(ask: Ask, question: str, allowed: tuple[str, ...]) -> str | None:
    """Ask until the answer is allowed, at most 10 times."""
    for _ in range(10):
        answer = ask(question)
        if answer is None or answer in allowed:
            return answer
    raise InputError(f"expected one of {', '.join(allowed)}, got other answers; nothing was stored")


def _acoustics(choices: ExposureChoices) -> Acoustics:
    return Acoustics() if choices.room is None else Acoustics(medium=choices.room)
