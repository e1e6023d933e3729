"""The command `studio`: open the studio in a browser."""

import sys
from pathlib import Path

from midair import devices
from midair.cli.console import print_note
from midair.cli.options import ArrayCalibration, Seed, StopInput


def studio_command(
    folder: Path | None = None,
    /,
    *,
    port: int = 0,
    no_browser: bool = False,
    device: str = "virtual",
    sensor: str = "virtual:towel",
    array_calibration: ArrayCalibration = None,
    seed: Seed = 0,
    stop_input: StopInput = None,
) -> None:
    """Open the studio in the browser: record, solve, play and compare.

    Serves this computer only, without internet, and prints a link that works once within five minutes.
    Ctrl-C ends the studio and silences the array.

    Parameters
    ----------
    folder
        Folder to read and write, made if there is none. [default: current folder]
    port
        TCP port to listen on; 0 selects a free one.
    no_browser
        Print the link without opening a browser.
    device
        Array, as in midair play.
    sensor
        Sensor, as in midair record.

    Examples
    --------
    $ midair studio
    $ midair studio recordings --no-browser
    """
    from midair.studio import StudioPlan, open_studio

    if folder is not None and not folder.exists() and folder.parent.is_dir():
        print_note(f"{folder}: no such folder; it is made")
    plan = StudioPlan(
        folder=folder or Path(), device=device, sensor=sensor, array_calibration=array_calibration, seed=seed
    )
    with devices.stop_on_input(stop_input):
        open_studio(plan, port=port, browser=not no_browser and sys.stdout is not None)
