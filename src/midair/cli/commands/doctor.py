"""The command `doctor`: check the installation and the devices."""

import sys
from contextlib import nullcontext
from dataclasses import asdict
from pathlib import Path

from rich.table import Table

from midair import files, rig
from midair.cli.console import banner, err, out, print_json, print_note, print_rows
from midair.cli.exposure_options import AirOptions, ExposureOptions
from midair.cli.options import Json, Length, Placement
from midair.errors import InputError
from midair.model import HEIGHT


def doctor_command(
    *,
    device: str | None = None,
    wizard: bool = False,
    sensor: str | None = None,
    height: Length = HEIGHT,
    yes: bool = False,
    placement: Placement = None,
    air: AirOptions | None = None,
    exposure: ExposureOptions | None = None,
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
        Check the array with sound and questions: air, placement, sound at the ears, wiring, transducers, heat.
        The report is stored, and midair play prints its age.
    sensor
        Sensor for --wizard, as in midair record, face down over the centre of the array.
        It finds the order of the units, and dead transducers.
    height
        Height of the sensor of --wizard above the array.
    yes
        Ask nothing; what a person would confirm is reported as not checked.
    air
        Air of the room for --wizard; asked if not stated.
    exposure
        Exposure limits for --wizard.
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
    if not wizard and (sensor or yes or placement or air or exposure or height != HEIGHT):
        raise InputError(
            "--sensor, --height, --yes and options of placement, air and exposure: expected --wizard, got none"
        )
    if not wizard:
        findings = rig.run_checks(device)
    elif device is None:
        raise InputError("--wizard: expected --device with an array, got none")
    else:
        choices = (exposure or ExposureOptions()).choices((air or AirOptions()).medium())
        array = rig.array_named(device, None if placement is None else files.load_placement(placement), silencer="off")
        with (
            array,
            nullcontext() if sensor is None else rig.sensor_named(sensor, rig.VirtualRig(height=height)) as above,
        ):
            banner(array.simulated)
            findings = rig.run_wizard(array, (lambda _: None) if yes else _ask, choices, sensor=above, height=height)
        print_note(f"report stored: {rig.store_checkup(array.name, findings)}")
    if json:
        print_json([asdict(finding) for finding in findings])
    else:
        table = Table(box=None, pad_edge=False)
        for name in ("", "state", "found", "advice"):
            table.add_column(name, overflow="fold")
        for finding in findings:
            table.add_row(finding.subject, finding.state, finding.found, finding.advice)
        out().print(table)
        if not wizard:
            out().print(rig.readiness(findings))
    return int(any(finding.state == "broken" for finding in findings))


def _ask(question: str) -> str:
    err().print(question, end="")
    line = sys.stdin.readline()
    if not line:
        raise InputError("expected an answer, got the end of the input; no report was stored; without a person: --yes")
    return line.strip().lower()
