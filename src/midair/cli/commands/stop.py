"""The command `stop`: silence from another terminal."""

from pathlib import Path

from midair.cli.terminal import print_rows
from midair.files import load_placement
from midair.rig import array_named, stop_playing


def stop_command(*, device: str | None = None, placement: Path | None = None) -> int:
    """Silence whatever plays, at once.

    Every midair that plays on this computer under this user is told to be silent and to end. With a device, that device
    is then opened and silenced as well: it works on units that some other program left sounding.

    Leaves with 1 when something that plays did not answer; then switch the units off.

    Parameters
    ----------
    device
        Also open and silence it: autd3, autd3:INTERFACE, pyautd3, pyautd3:INTERFACE.
    placement
        TOML file with the units of that device; two by two if not given.
    """
    stopped = stop_playing()
    rows = [(one.device, f"{one.outcome} (process {one.process})") for one in stopped]
    if device is not None:
        with array_named(device, None if placement is None else load_placement(placement)) as array:
            array.silence()
        rows.append((device, "opened and silenced"))
    print_rows(rows or [("stop", "nothing plays")])
    return int(any(one.outcome == "no answer" for one in stopped))
