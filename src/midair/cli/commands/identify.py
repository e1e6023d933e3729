"""The command `identify`: a tap or a tone for each cell, a map of what answered, the right order in the sensor file."""

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from rich.text import Text

from midair.cli.terminal import Json, Keys, banner, err, out, print_json, quantity
from midair.devices import SensorDevice
from midair.errors import InputError
from midair.files import load_sensor, save_sensor
from midair.model import SensorWiring
from midair.rig import Identity, TapTest, VirtualRig, findings, identify_by_taps, identify_by_tones, sensor_named

Time = Annotated[float, quantity("s")]


def identify_command(
    sensor: str,
    /,
    *,
    sensor_file: Annotated[Path | None, Parameter(name="--sensor")] = None,
    every: Annotated[float | None, quantity("s")] = None,
    wait: Time = 10.0,
    tones: Annotated[tuple[float, float] | None, quantity("Hz", many=2)] = None,
    duration: Time = 2.0,
    json: Json = False,
    seed: int = 0,
) -> int:
    """Find out which channel is which cell: tap each cell when its turn comes, row by row from the top left.

    Leaves with 1 when a channel is dead, doubled or uncertain; channels in another order are no failure once the order
    is in the sensor file.

    Parameters
    ----------
    sensor
        As for midair record; virtual:taps is a virtual sensor that taps itself once a second, for use with --every 1s.
    sensor_file
        NAME.toml: the order in it is used, and replaced by the right one; it is made if it is not there.
    every
        Tap in this rhythm, instead of waiting for each tap: finds cells that do not answer at all.
    wait
        A cell that does not answer for so long is left out; s leaves it out at once.
    tones
        Instead of taps, a tone in each cell: the frequencies of the first and the last cell, the others evenly between.
    duration
        To listen to the tones.
    seed
        Of a virtual sensor.

    Examples
    --------
    $ midair identify virtual:taps --every 1s
    """
    wiring = load_sensor(sensor_file) if sensor_file is not None and sensor_file.exists() else None
    device = sensor_named(sensor, VirtualRig(seed=seed), wiring=wiring)
    banner(device.simulated)
    with device, Keys() as keys:
        if tones is None:
            test = TapTest(every=every, wait=wait)
            prompt = _prompt(device, keys=keys.active)
            found = identify_by_taps(device, test, prompt, lambda: "s" in keys.pressed())
        else:
            frequency = np.linspace(*tones, device.grid.count)
            found = identify_by_tones(device, frequency, duration)
        written = _write(found, wiring or _plain_wiring(device), sensor_file)
    _print(found, sensor_file if written else None, json=json)
    return int(not found.sound)


def _prompt(device: SensorDevice, *, keys: bool) -> Callable[[int], None]:
    console = err()

    def prompt(cell: int) -> None:
        row, column = divmod(cell, device.grid.columns)
        hint = "; s: leave it out" if keys else ""
        console.print(f"tap row {row}, column {column} ({cell + 1} of {device.grid.count}){hint}")

    console.print("leave the sensor alone for a second")
    return prompt


def _plain_wiring(device: SensorDevice) -> SensorWiring:
    return device.wiring or SensorWiring(grid=device.grid, unit=device.unit, full_scale=device.full_scale)


def _write(found: Identity, wiring: SensorWiring, path: Path | None) -> bool:
    """Put the right order into the sensor file; whether that was done.

    Raises
    ------
    InputError
        If it is not certain.
    """
    if path is None:
        return False
    if found.doubtful or len(found.silent) > 1:
        raise InputError(f"{path}: left as it was, the order is not certain: {'; '.join(findings(found))}")
    save_sensor(wiring.with_order([wiring.order[channel] for channel in found.order]), path)
    return True


def _print(found: Identity, written: Path | None, *, json: bool) -> None:
    said = findings(found)
    if json:
        parts = asdict(found) | {"grid": list(found.grid.shape), "margin": found.margin.tolist()}
        state = {"sound": found.sound, "in_order": found.in_order, "order": list(found.order), "findings": said}
        return print_json(parts | state | {"written": None if written is None else str(written)})
    out().print("channel that answers at each cell:")
    out().print(channel_map(found))
    for sentence in said or ["every channel is in its place"]:
        out().print(sentence)
    if written is not None:
        out().print(f"order written to {written}")
    return None


def channel_map(found: Identity) -> Text:
    """The sensor from above: green where the channel is the cell's own, yellow where it is another's, -- for none."""
    text = Text()
    for cell, channel in enumerate(found.channel):
        style = "red" if channel is None or cell in found.doubtful else "green" if channel == cell else "yellow"
        text.append(f"{'--' if channel is None else channel:>4}", style=style)
        text.append("?" if cell in found.doubtful else " ")
        if (cell + 1) % found.grid.columns == 0 and cell + 1 < found.grid.count:
            text.append("\n")
    return text
