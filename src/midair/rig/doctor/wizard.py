"""Check a real array on the first day: wiring, heat, air, placement and sound at the ears.

Everything sounds inside a `Session` only, so that an error, Ctrl-C, a signal or `midair stop` leaves silence.
"""

import json
from collections.abc import Callable
from dataclasses import asdict, replace
from datetime import UTC, datetime
from pathlib import Path
from urllib.parse import quote

import numpy as np

from midair.correct import focused_drive
from midair.devices import ArrayDevice, ExposureChoices, make_state_folder, measure_exposure, state_folder
from midair.errors import InputError
from midair.files import write_file
from midair.model import HEIGHT, Acoustics, Drive, Medium, TransducerArray
from midair.rig.doctor.checkup import Check, broken, missing, ok, report_findings
from midair.rig.session import Session

Ask = Callable[[str], str | None]
"""Asks a person, and returns the answer without spaces and in lower case; None if no person is there."""


def run_wizard(array: ArrayDevice, ask: Ask, choices: ExposureChoices) -> list[Check]:
    """Check an open array, whose silencer is off, with or without a person.

    `choices` limits everything that sounds; without an override, clicks are attenuated to meet them.
    """
    air, choices = _air(ask, choices)
    acoustics = Acoustics() if choices.room is None else Acoustics(medium=choices.room)
    checks = [*report_findings(array.name, array.describe()), air, _placement(array, ask)]
    # The strongest focus, and the level at which it meets the profile.
    focus = np.array([0.0, 0.0, HEIGHT])
    drive = focused_drive(array.array, focus, np.ones(1), rate=1000.0, acoustics=acoustics, source="focus")
    found = measure_exposure(drive, array.array, choices.profile, steps=array.steps_a_turn, room=choices.room)
    level = min(1.0, 10 ** (-found.excess / 20))
    # Rounded down, so that the printed level keeps the limit.
    digits = 10.0 ** (1 - np.floor(np.log10(level)))
    level = np.floor(level * digits) / digits
    said = f"a still focus at full drive: {found.verdict()}; at most {level:.2g} of full drive keeps it"
    checks.append(ok("ears", said, "keep ears outside the places of the profile: midair exposure --help"))
    units = [int(unit) for unit in np.unique(array.array.unit)]
    drives = [click_drive(array.array, unit, height=HEIGHT, acoustics=acoustics) for unit in units]
    return [*checks, _wiring_by_ear(array, ask, choices, units, drives), _heat(array)]


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
        return missing("wiring", found, "run it with a person")
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
    advice = "check the power of silent units; exchange cables, or the entries in the placement file"
    return broken("wiring", ", ".join(wrong), advice)


def _one_of(ask: Ask, question: str, *allowed: str) -> str | None:
    """Ask until the answer is allowed, at most 10 times."""
    for _ in range(10):
        answer = ask(question)
        if answer is None or answer in allowed:
            return answer
    raise InputError(f"expected one of {', '.join(allowed)}, got other answers; no report was stored")
