"""The command `doctor`: check the installation and the devices."""

import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from midair import files, rig
from midair.cli.console import banner, err, print_json, print_note, print_rows
from midair.cli.exposure_options import RoomOptions
from midair.cli.options import Json, Placement
from midair.cli.output import print_table
from midair.errors import InputError
from midair.table import Details, Line


def doctor_command(
    *,
    device: str | None = None,
    wizard: bool = False,
    yes: bool = False,
    placement: Placement = None,
    room: RoomOptions | None = None,
    lab: Path | None = None,
    json: Json = False,
) -> int:
    """Check Python, libraries, folders, a solve and a device, and print advice for each problem.

    The last line says what this computer is ready for, and what is missing.
    The exit status is 1 if something that midair needs is broken.

    Parameters
    ----------
    device
        Also query this array, without sound: autd3, autd3:INTERFACE, autd3:emulator, pyautd3:INTERFACE.
        Or read this sensor for half a second: lsl:NAME, audio:DEVICE, serial:PORT, ni:CHANNELS.
    wizard
        Check the array with sound and questions: air, placement, sound at the ears, wiring, heat.
        The report is stored, and midair play prints its age.
    yes
        Ask nothing; what a person would confirm is reported as not checked.
    lab
        Only write this TOML file, lab.toml, with typical uncertainties of a laboratory for midair budget --lab.

    Examples
    --------
    $ midair doctor
    $ midair doctor --device autd3:emulator
    $ midair doctor --device autd3:emulator --wizard --yes
    $ midair doctor --lab lab.toml
    """
    if lab is not None:
        if lab.exists():
            raise InputError(f"--lab: expected a new file, got {lab}, which exists; delete it first or name another")
        files.save_laboratory(files.Laboratory(), lab)
        print_rows([("laboratory", f"{lab}; replace what you know better, then midair budget take.h5 --lab {lab}")])
        return 0
    if not wizard and (yes or placement or room):
        raise InputError("--yes and options of placement, air and exposure: expected --wizard, got none")
    if not wizard:
        findings = rig.run_checks(device)
    elif device is None:
        raise InputError("--wizard: expected --device with an array, got none")
    else:
        choices = (room or RoomOptions()).limits()
        array = rig.array_named(device, None if placement is None else files.load_placement(placement), silencer="off")
        with array:
            banner(array.simulated)
            findings = rig.run_wizard(array, (lambda _: None) if yes else _ask, choices)
        print_note(f"report stored: {rig.store_checkup(array.name, findings)}")
    if json:
        print_json([asdict(finding) for finding in findings])
    else:
        wrong = [f"{each.subject}: {each.state}" for each in findings if each.state != "ok"]
        answer = "; ".join(wrong) or "everything that was checked is in order" if wizard else rig.readiness(findings)
        print_table(_rows(findings, whole=wizard), answer=answer, json=False)
    return int(any(finding.state == "broken" for finding in findings))


def _rows(findings: Sequence[Any], *, whole: bool) -> list[Line]:
    """A row for each finding, broken ones first; what is fine is a detail unless `whole`."""
    rows: list[Line] = []
    for state in ("broken", "missing", "ok"):
        texts = [(each.subject, "; ".join(filter(None, [each.found, each.advice]))) for each in findings]
        some = [row for row, each in zip(texts, findings, strict=True) if each.state == state]
        rows += some if whole or state == "broken" else [Details(some)]
    return rows


def _ask(question: str) -> str:
    err().print(question, end="")
    line = sys.stdin.readline()
    if not line:
        raise InputError("expected an answer, got the end of the input; no report was stored; without a person: --yes")
    return line.strip().lower()
