"""The command `identify`: find the channel of each cell by taps, and correct the sensor file."""

from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path

from rich.text import Text

from midair import devices, files, rig
from midair.cli.console import banner, err, out
from midair.cli.keys import Keys
from midair.cli.options import Json, OptionalTime, Seed, Time
from midair.cli.output import print_table
from midair.errors import InputError
from midair.model import SensorWiring
from midair.table import Line, Row, describe


def identify_command(
    sensor: str,
    /,
    *,
    sensor_file: Path | None = None,
    every: OptionalTime = None,
    wait: Time = 10.0,
    json: Json = False,
    seed: Seed = 0,
) -> int:
    """Find out which channel belongs to which cell, by taps.

    Tap each cell when the command names it, row by row from the top left.
    The exit status is 1 if a channel is dead, doubled or uncertain; a different order is no error.

    Parameters
    ----------
    sensor
        Sensor, as in midair record; virtual:taps is a virtual sensor that is tapped once a second (use --every 1s).
    sensor_file
        Sensor file NAME.toml: its channel order is read, and replaced by the right one; created if missing.
    every
        Tap in this rhythm instead of waiting for each tap; this also finds cells that do not respond.
    wait
        Skip a cell that does not respond within this time; the key s skips it at once.

    Examples
    --------
    $ midair identify virtual:taps --every 1s
    """
    wiring = files.load_sensor(sensor_file) if sensor_file is not None and sensor_file.exists() else None
    device = rig.sensor_named(sensor, rig.VirtualRig(seed=seed), wiring=wiring)
    banner(device.simulated)
    with device, Keys() as keys:
        test, prompt = rig.TapTest(every=every, wait=wait), _prompt(device, keys=keys.active)
        found = rig.identify_by_taps(device, test, prompt, lambda: "s" in keys.pressed())
        own = device.wiring or SensorWiring(grid=device.grid, unit=device.unit, full_scale=device.full_scale)
        written = _write(found, wiring or own, sensor_file)
    if not json:
        out().print("channel that responds at each cell:")
        out().print(channel_map(found))
    file = Row("written", str(sensor_file) if written else None, text=f"order, to {sensor_file}" if written else "")
    print_table([*describe(found), file], json=json)
    return int(not found.sound)


def _prompt(device: devices.SensorDevice, *, keys: bool) -> Callable[[int], None]:
    console = err()

    def prompt(cell: int) -> None:
        row, column = divmod(cell, device.grid.columns)
        hint = "; s: skip it" if keys else ""
        console.print(f"tap row {row}, column {column} ({cell + 1} of {device.grid.count}){hint}")

    console.print("do not touch the sensor for a second")
    return prompt


def _write(found: rig.Identity, wiring: SensorWiring, path: Path | None) -> bool:
    """Write the right order into the sensor file; False if no file was given."""
    if path is None:
        return False
    if found.doubtful or len(found.silent) > 1:
        raise InputError(
            f"{path}: not changed, because the order is uncertain: {'; '.join(rig.assignment_problems(found))}"
        )
    files.save_sensor(replace(wiring, order=tuple(wiring.order[channel] for channel in found.order)), path)
    return True


@describe.register
def _(found: rig.Identity) -> list[Line]:
    problems = rig.assignment_problems(found)
    parts = asdict(found) | {"grid": list(found.grid.shape), "margin": found.margin.tolist(), "findings": problems}
    state = {"sound": found.sound, "in_order": found.in_order, "order": list(found.order)}
    return [parts | state, *(("found", each) for each in problems or ["every channel is in its place"])]


def channel_map(found: rig.Identity) -> Text:
    """The sensor from above: green for the cell's own channel, yellow for another's, -- for none."""
    text = Text()
    for cell, channel in enumerate(found.channel):
        style = "red" if channel is None or cell in found.doubtful else "green" if channel == cell else "yellow"
        text.append(f"{'--' if channel is None else channel:>4}", style=style)
        text.append("?" if cell in found.doubtful else " ")
        if (cell + 1) % found.grid.columns == 0 and cell + 1 < found.grid.count:
            text.append("\n")
    return text
