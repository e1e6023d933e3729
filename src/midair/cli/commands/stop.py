"""The command `stop`: silence from another terminal."""

from dataclasses import asdict
from pathlib import Path

from midair.cli.terminal import Json, print_json, print_rows
from midair.devices import Stopped, state_folder, stop_playing


def stop_command(*, device: str | None = None, placement: Path | None = None, json: Json = False) -> int:
    """Silence all arrays that midair plays on.

    Every midair that plays on this computer under this user, or is about to, is told to be silent and to end; those
    that are only starting refuse to play. "silent" is said when the array has confirmed it. With a device, that device
    is then opened and silenced as well: it works on units that some other program left sounding.

    Leaves with 1 when something that plays did not confirm that it is silent; then switch the units off.

    Parameters
    ----------
    device
        Also open and silence it: autd3, autd3:INTERFACE, pyautd3, pyautd3:INTERFACE, openmpd:PORT.
    placement
        TOML file with the units of that device; two by two if not given.
    json
        Print JSON for a program.

    Examples
    --------
    $ midair stop
    """
    try:
        stopped = stop_playing()
        if json:
            print_json([asdict(one) for one in stopped])
        elif stopped or device is None:
            rows = [(one.device, _said(one)) for one in stopped]
            print_rows(rows or [("stop", f"nothing plays of which there is word in {state_folder()}")])
    finally:
        # Whatever became of the others.
        if device is not None:
            _silence(device, placement)
    if device is not None and not json:
        print_rows([(device, "opened and silenced")])
    return int(any(one.outcome == "no answer" for one in stopped))


def _said(one: Stopped) -> str:
    who = f"process {one.process}" + (f", {one.command}" if one.command else "")
    if one.outcome == "no answer":
        return f"NOT KNOWN TO BE SILENT ({who}): {one.reason}; switch the units off, or end the process (kill -9)"
    return f"{one.outcome} ({who})"


def _silence(device: str, placement: Path | None) -> None:
    """Open a device and silence it, whoever holds it."""
    # Only now: what they take with them must not keep those waiting that play.
    from midair.files import load_placement
    from midair.rig import array_named

    array = array_named(device, None if placement is None else load_placement(placement))
    # Not entered, which would wait for nobody and refuse where another program has it.
    try:
        array.open()
        array.silence()
    finally:
        array.close()
