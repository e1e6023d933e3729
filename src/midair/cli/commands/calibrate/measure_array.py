"""The command `calibrate array`: strength, phase and resonance of each transducer, by a sensor over the array."""

import re
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

from midair.calibration import ArrayPlan
from midair.cli.terminal import (
    AirOptions,
    ExposureOptions,
    Force,
    Json,
    Length,
    Time,
    array_rows,
    banner,
    may_write,
    print_json,
    print_rows,
    progress_bars,
    quantity,
    say_air,
)
from midair.devices import ArrayDevice, SensorDevice
from midair.errors import MissingFileError
from midair.files import ARRAY_SUFFIX, load_calibration, save_array_calibration
from midair.model import Acoustics, Medium
from midair.rig import VirtualRig, array_named, calibrate_array, sensor_named


def array_command(
    sensor: str = "virtual",
    output: Path | None = None,
    /,
    *,
    device: str = "virtual",
    calibration: Path | None = None,
    duration: Time = 8.0,
    top: Annotated[float, quantity("Pa")] = 100.0,
    height: Length = 0.2,
    date: str | None = None,
    air: AirOptions | None = None,
    exposure: ExposureOptions | None = None,
    seed: int = 0,
    force: Force = False,
    json: Json = False,
) -> None:
    """Measure each transducer of an array, its strength, phase and resonance, by the sensor that lies over it.

    All hold a focus on the middle of the sensor, and each adds a code of its own. Where the sensor lies is found, to a
    few millimetres. What is written goes to solve, loop and budget as --array-calibration.

    Parameters
    ----------
    sensor
        virtual, or a sensor as in midair record, lying face down over the centre of the array.
    output
        NAME.array.h5; the array's name and the date if not given.
    device
        virtual, or an array as in midair play.
    calibration
        Of the sensor; the virtual one brings its own.
    duration
        Of the codes: four times as long is twice as sure.
    top
        Highest pressure in the middle of each focus.
    height
        Of the sensor above the array, to a millimetre or so.
    date
        When it was measured, ISO 8601; today if not given.
    air
        Of the room; 22C and 50% if it is not stated.
    exposure
        What the codes may expose people to; those that exceed it are refused: lower --top.
    seed
        Of a virtual rig.
    json
        Print JSON for a program.

    Examples
    --------
    $ midair calibrate array --duration 12s
    """
    room = (air or AirOptions()).medium()
    medium = room or Medium.at(temperature=22.0, humidity=0.5)
    source, array = _devices(sensor, device, calibration, VirtualRig(seed=seed, height=height))
    day = date or datetime.now(UTC).date().isoformat()
    name = re.sub(r"[^\w.-]+", "-", array.array.name).strip("-") or "array"
    target = output or Path(f"{name}-{day}{ARRAY_SUFFIX}")
    may_write(target, force)
    say_air(medium, stated=room is not None)
    with progress_bars() as stage, array, source:
        found = calibrate_array(
            array,
            source,
            ArrayPlan(duration=duration, top=top),
            height=height,
            acoustics=Acoustics(medium=medium),
            exposure=(exposure or ExposureOptions()).choices(room),
            date=day,
            stage=stage,
        )
    save_array_calibration(found, target)
    rows = [*array_rows(found), ("written", str(target))]
    if json:
        return print_json({**dict(rows), "simulated": found.provenance.simulated})
    banner(found.provenance.simulated)
    print_rows(rows)
    return None


def _devices(sensor: str, device: str, calibration: Path | None, rig: VirtualRig) -> tuple[SensorDevice, ArrayDevice]:
    """Sensor and array, neither open yet; nothing spreads what the array plays."""
    skin = rig.skin()
    source = rig.sensor(skin) if sensor == "virtual" else sensor_named(sensor, rig)
    if calibration is not None:
        source.calibration = load_calibration(calibration)
        if source.calibration is None:
            raise MissingFileError(f"{calibration}: expected a calibration in it, found none")
    if device != "virtual":
        return source, array_named(device, silencer="off")
    array = rig.array_device(skin)
    array.silencer = "off"
    return source, array
