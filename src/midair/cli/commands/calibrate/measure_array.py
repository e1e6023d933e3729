"""The commands `calibrate array` (each transducer, by a sensor over the array) and `calibrate tracker` (by a palm)."""

import re
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

from midair import files, rig
from midair.calibration import ArrayPlan
from midair.cli.console import print_note, progress_bars
from midair.cli.exposure_options import RoomOptions
from midair.cli.keys import Keys
from midair.cli.options import Device, Force, Json, Length, Placement, Reflection, Seed, Spread, Time, quantity
from midair.cli.output import may_write, print_table
from midair.devices import ArrayDevice, SensorDevice
from midair.errors import InputError, MissingFileError
from midair.model import HEIGHT, RATE, Acoustics
from midair.table import Row, describe


def array_command(
    sensor: str = "virtual",
    output: Path | None = None,
    /,
    *,
    device: Device = "virtual",
    calibration: Path | None = None,
    duration: Time = 8.0,
    top: Annotated[float, quantity("Pa")] = 100.0,
    height: Length = HEIGHT,
    plate: Length = 0.0,
    date: str | None = None,
    check: bool = False,
    placement: Placement = None,
    room: RoomOptions | None = None,
    spread: Spread = "default",
    reflection: Reflection = 0.0,
    seed: Seed = 0,
    force: Force = False,
    json: Json = False,
) -> int | None:
    """Measure strength, phase and resonance of each transducer of an array, with a sensor above it.

    All transducers hold a focus on the centre of the sensor, and each is modulated with its own code.
    Position, angle and time offset of each unit, and the position of the sensor, are estimated as well.
    The result for a real array is stored too: midair solve and loop with this --device then use it by default.

    Parameters
    ----------
    sensor
        virtual, or a sensor as in midair record, lying face down over the centre of the array.
    output
        File to write, NAME.array.h5; with --check the file to check. [default: the array's name and the date]
    calibration
        Calibration of the sensor. [default: that of the virtual sensor]
    duration
        Length of the codes; four times the length halves the uncertainty.
    top
        Highest pressure in the centre of each focus.
    height
        Height of the sensor above the array, to about a millimetre.
    plate
        Diameter of a rigid plate in which the sensor lies flush, as wide as a palm: measures the reflection of the
        array's face, for the echo of a palm.
    date
        Date of the measurement, ISO 8601. [default: today]
    check
        Do not measure: check by two seconds of codes that the calibration still holds. Status 1 if not.

    Examples
    --------
    $ midair calibrate array --duration 12s
    $ midair calibrate array lsl:Skin --device autd3 --calibration palm.calibration.h5
    $ midair calibrate array lsl:Skin --device autd3 --calibration palm.calibration.h5 --check
    """
    room = room or RoomOptions()
    virtual = rig.VirtualRig(seed=seed, height=height, spread=spread, reflection=reflection)
    units = None if placement is None else files.load_placement(placement)
    source, array = rig.bench_devices(sensor, device, virtual, units)
    if calibration is not None:
        source.calibration = files.load_calibration(calibration)
        if source.calibration is None:
            raise MissingFileError(f"{calibration}: expected a calibration in it, found none")
    session = rig.ArraySession(
        height=height,
        plate=plate,
        acoustics=Acoustics(medium=room.assumed()),
        exposure=room.limits(),
        warn=lambda line: print_note(f"midair: warning: {line}", warn=True),
    )
    if check:
        return _check(array, source, device, output, session, json=json)
    day = date or datetime.now(UTC).date().isoformat()
    name = re.sub(r"[^\w.-]+", "-", array.array.name).strip("-") or "array"
    target = output or Path(f"{name}-{day}{files.ARRAY_SUFFIX}")
    may_write(target, force)
    count, frames = array.array.count, round(duration * RATE)
    work = WORK * count * frames
    cpu = f"{work:.0f} to {3 * work:.0f} s of CPU, the more the transducers differ"
    print_note(f"{count} transducers: {duration + 2:.0f} s of silence and codes, then {cpu}")
    with progress_bars() as stage, array, source:
        plan, session = ArrayPlan(duration=duration, top=top), replace(session, stage=stage)
        found = rig.calibrate_array(array, source, plan, session=session, date=day)
    files.save_array_calibration(found, target)
    simulated = found.provenance.simulated
    table = [*describe(found), Row("written", str(target))]
    if not simulated:
        table.append(Row("used by default", f"for --device {device}: {rig.keep_array_calibration(device, found)}"))
    return print_table(table, simulated=simulated, json=json)


WORK = 9e-6
"""CPU time of a fit of four sweeps per transducer and frame, in s, as measured by `benchmarks.unknown_arrays`."""


def _check(
    array: ArrayDevice, source: SensorDevice, device: str, path: Path | None, session: rig.ArraySession, *, json: bool
) -> int:
    """Check a calibration, print what changed, store the result; status 1 if it no longer holds."""
    kept = rig.kept_array_calibration(device) if path is None else None
    if path is not None:
        known = files.load_array_calibration(path)
    elif kept is not None:
        known = kept.known
    else:
        raise InputError(f"--check: expected a calibration of {device}, got none; measure the array, or name its file")
    with progress_bars() as stage, array, source:
        found = rig.check_array_calibration(array, source, known, session=replace(session, stage=stage))
    problems = found.problems()
    result = "; ".join(problems) or "holds"
    if kept is not None:
        rig.keep_array_check(device, result)
    offsets = ", ".join(f"{1e9 * each:+.0f}" for each in found.offset)
    table = [
        Row("calibration", f"{known.identifier}, {known.date or 'no date'}: {result}"),
        Row("silent or changed", f"{len(found.dead)}, {len(found.drifted)} of {array.array.count} transducers"),
        Row("units", f"{offsets} ns out of step, ± {2e9 * found.offset_uncertainty:.0f} ns (k = 2)"),
        Row("air", f"{found.warming:+.1f} K off the stated one, ± {2 * found.warming_uncertainty:.1f} K (k = 2)"),
        {"problems": problems},
    ]
    print_table(table, simulated=source.simulated, json=json)
    return int(bool(problems))


def tracker_command(
    tracker: str,
    output: Path,
    /,
    *,
    device: Device = "virtual",
    top: Annotated[float, quantity("Pa")] = 100.0,
    placement: Placement = None,
    room: RoomOptions | None = None,
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
    top
        Highest pressure in the centre of the focus.

    Examples
    --------
    $ midair calibrate tracker leap: leap.toml --device autd3
    """
    may_write(output, force)
    room = room or RoomOptions()
    units = None if placement is None else files.load_placement(placement)
    _, array = rig.bench_devices("virtual", device, rig.VirtualRig(), units)
    medium = room.assumed()

    def say(at: int) -> None:
        x, y, z = (1e3 * rig.PLACES[at]).round()
        print_note(
            f"place {at + 1} of {len(rig.PLACES)}: hold the palm still at ({x:g}, {y:g}, {z:g}) mm, or press Enter"
        )

    with rig.open_tracker(tracker) as opened, array, Keys() as keys:
        found = rig.calibrate_tracker(
            opened,
            array,
            top=top,
            acoustics=Acoustics(medium=medium),
            exposure=room.limits(),
            say=say,
            entered=lambda: "\n" in keys.pressed(),
        )
    files.save_tracker(found, output)
    uncertainty = f"{2e3 * found.uncertainty:.1f} mm (k = 2)"
    offset = ", ".join(f"{1e3 * each:.1f}" for each in found.offset) + " mm"
    table = [Row("offset", offset), Row("uncertainty", uncertainty), Row("written", str(output))]
    print_table(table, simulated=array.simulated, json=json)
