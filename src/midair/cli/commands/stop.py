"""The command `stop`: silence playing arrays from another terminal."""

from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import NoReturn

from midair import devices
from midair.cli.console import err, print_json, print_rows
from midair.cli.options import Json, Placement
from midair.errors import DeviceError, FileError, MidairError
from midair.table import Line, describe, plain, printed


def stop_command(
    *, device: str | None = None, placement: Placement = None, watch: str | None = None, json: Json = False
) -> int:
    """Silence all arrays that midair plays on.

    Stops every midair process of this user on this computer that plays or is about to play.
    "silent" means that the array has confirmed it.
    With --device, that array is then opened and silenced too, for units that another program left playing.
    The exit status is 1 if an array did not confirm silence; then switch its units off.

    Parameters
    ----------
    device
        Also open and silence this array: autd3, autd3:INTERFACE, pyautd3, pyautd3:INTERFACE.
    watch
        Wait, and stop whenever a byte arrives from this input: serial:PORT, keyboard or evdev:PATH. Its loss stops too
        and ends the command with status 1. With Ctrl-C the watch ends.

    Examples
    --------
    $ midair stop
    $ midair stop --watch serial:/dev/ttyUSB0
    """
    if watch is not None:
        _watch(watch, device, placement, json=json)
    try:
        stopped = devices.stop_playing()
        with suppress(FileError):  # silence does not depend on the log
            devices.close_orders()
        tables = [describe(one) for one in stopped]
        if json:
            print_json([plain(table) for table in tables])
        elif stopped or device is None:
            rows = [row for table in tables for row in printed(table)]
            print_rows(rows or [("stop", f"no running playback is registered in {devices.state_folder()}")])
    finally:
        # Even if stopping the others failed.
        if device is not None:
            _silence(device, placement)
    if device is not None and not json:
        print_rows([(device, "opened and silenced")])
    return int(any(one.outcome == "no answer" for one in stopped))


def _watch(name: str, device: str | None, placement: Path | None, *, json: bool) -> NoReturn:
    """Stop after each byte of an input; DeviceError after its loss."""
    with devices.open_stop_input(name) as opened:
        err().print(f"watching {name}")
        cause = "byte"
        while cause == "byte":
            cause = opened.wait()
            try:
                stop_command(device=device, placement=placement, json=json)
            except MidairError as wrong:
                err().print(f"midair: {wrong}")
    raise DeviceError(f"{name}: expected an input that stays connected, it was lost, and all arrays were stopped")


@describe.register
def _(one: devices.Stopped) -> list[Line]:
    who = f"process {one.process}" + (f", {one.command}" if one.command else "")
    text = f"{one.outcome} ({who})"
    if one.outcome == "no answer":
        text = f"NOT KNOWN TO BE SILENT ({who}): {one.reason}; switch the units off, or end the process (kill -9)"
    return [(one.device, text), asdict(one)]


def _silence(device: str, placement: Path | None) -> None:
    """Open a device and silence it, even if another process holds it."""
    # Imported here: stopping the playing processes must not wait for these imports.
    from midair.files import load_placement
    from midair.rig import array_named

    array = array_named(device, None if placement is None else load_placement(placement))
    # Not as a context manager, which refuses a device that another process holds.
    try:
        array.open()
        array.silence()
    finally:
        array.close()
