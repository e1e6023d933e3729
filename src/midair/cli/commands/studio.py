"""The command `studio`: a page in the browser in which all of this can be seen and touched."""

import sys
from pathlib import Path

from midair.errors import MissingExtraError


def studio_command(
    folder: Path | None = None,
    /,
    *,
    port: int = 0,
    no_browser: bool = False,
    device: str = "virtual",
    sensor: str = "virtual:towel",
    seed: int = 0,
) -> None:
    """Open the studio in the browser: record, solve, play and compare.

    It listens on this computer alone and prints a link that works once, for five minutes. Ctrl-C ends it, and silences
    what plays. It needs the extra studio, and no internet.

    Parameters
    ----------
    folder
        The one folder that it reads and writes; this one if not given.
    port
        On which it listens; any that is free if 0.
    no_browser
        Only print the link.
    device
        An array, as in midair play.
    sensor
        A sensor, as in midair record.
    seed
        Of the virtual rig.

    Examples
    --------
    $ midair studio
    $ midair studio recordings --no-browser
    """
    try:
        from midair.studio import StudioPlan, open_studio
    except ModuleNotFoundError as wrong:
        if (wrong.name or "").partition(".")[0] == "midair":
            raise
        raise MissingExtraError(
            f'studio: expected the package {wrong.name}, it is not installed; pip install "midair[studio]"'
        ) from wrong
    plan = StudioPlan(folder=folder or Path(), device=device, sensor=sensor, seed=seed)
    open_studio(plan, port=port, browser=not no_browser and sys.stdout is not None)
