"""The command `doctor`: check the installation and the devices."""

from dataclasses import asdict

from rich.table import Table

from midair.cli.console import out, print_json
from midair.cli.options import Json
from midair.rig import run_checks


def doctor_command(*, device: str | None = None, json: Json = False) -> int:
    """Check the installation, drivers and devices, and print advice for each problem.

    The exit status is 1 if something that midair needs is broken.

    Parameters
    ----------
    device
        Also query this array, without sound: autd3, autd3:INTERFACE, autd3:emulator, pyautd3:INTERFACE, openmpd:PORT.
        Or read this sensor for half a second: lsl:NAME, audio:DEVICE, serial:PORT, ni:CHANNELS.

    Examples
    --------
    $ midair doctor
    $ midair doctor --device autd3:emulator
    """
    findings = run_checks(device)
    if json:
        print_json([asdict(finding) for finding in findings])
    else:
        table = Table(box=None, pad_edge=False)
        for name in ("", "state", "found", "advice"):
            table.add_column(name, overflow="fold")
        for finding in findings:
            table.add_row(finding.subject, finding.state, finding.found, finding.advice)
        out().print(table)
    return int(any(finding.state == "broken" for finding in findings))
