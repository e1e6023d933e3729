"""The command `calibrate tracker`: rotation and offset of a tracker, by a palm held where the array marks places."""

from pathlib import Path
from typing import Annotated

from midair.cli.console import print_note
from midair.cli.exposure_options import AirOptions, ExposureOptions, print_air
from midair.cli.keys import Keys
from midair.cli.options import Force, Json, Placement
from midair.cli.output import may_write, print_result
from midair.cli.quantities import quantity
from midair.files import load_placement, save_tracker
from midair.model import Acoustics, Medium
from midair.rig import PLACES, VirtualRig, array_named, calibrate_tracker, open_tracker


def tracker_command(
    tracker: str,
    output: Path,
    /,
    *,
    device: str = "virtual",
    top: Annotated[float, quantity("Pa")] = 100.0,
    placement: Placement = None,
    air: AirOptions | None = None,
    exposure: ExposureOptions | None = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Find rotation and offset between a tracker and an array, from a palm held at four places.

    The array marks each place by a weak focus, modulated at 200 Hz, until the palm is held still there for a second
    with the focus in its middle, or Enter is pressed.

    Parameters
    ----------
    tracker
        leap:, lsl:NAME, osc:PORT or replay:FILE.
    output
        TOML file to write.
    device
        virtual, or an array as in midair play.
    top
        Highest pressure in the centre of the focus.
    placement
        TOML file with position and rotation of the units of a real array.
    air
        Air of the room; it decides where the focus lies. [default: 22C and 50%]
    exposure
        Exposure profile; a focus that exceeds it is refused: lower --top.

    Examples
    --------
    $ midair calibrate tracker leap: leap.toml --device autd3
    """
    may_write(output, force)
    room = (air or AirOptions()).medium()
    medium = room or Medium.at(temperature=22.0, humidity=0.5)
    units = None if placement is None else load_placement(placement)
    rig = VirtualRig()
    array = rig.array_device(rig.skin()) if device == "virtual" else array_named(device, units)
    print_air(medium, stated=room is not None)

    def say(at: int) -> None:
        x, y, z = (1e3 * PLACES[at]).round()
        print_note(f"place {at + 1} of {len(PLACES)}: hold the palm still at ({x:g}, {y:g}, {z:g}) mm, or press Enter")

    with open_tracker(tracker) as opened, array, Keys() as keys:
        found = calibrate_tracker(
            opened,
            array,
            top=top,
            acoustics=Acoustics(medium=medium),
            exposure=(exposure or ExposureOptions()).choices(room),
            say=say,
            entered=lambda: "\n" in keys.pressed(),
        )
    save_tracker(found, output)
    uncertainty = f"{2e3 * found.uncertainty:.1f} mm (k = 2)"
    offset = ", ".join(f"{1e3 * each:.1f}" for each in found.offset) + " mm"
    rows = [("offset", offset), ("uncertainty", uncertainty), ("written", str(output))]
    print_result(rows, simulated=array.simulated, json=json)
