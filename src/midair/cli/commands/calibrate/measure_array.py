"""The command `calibrate array`: strength, phase and resonance of each transducer, by a sensor over the array."""

import re
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

from midair.calibration import ArrayPlan
from midair.cli.console import banner, print_json, print_rows, progress_bars
from midair.cli.exposure_options import AirOptions, ExposureOptions, print_air
from midair.cli.options import Force, Json, Length, Time
from midair.cli.output import array_rows, may_write
from midair.cli.quantities import quantity
from midair.devices import ArrayDevice, SensorDevice
from midair.errors import MissingFileError
from midair.files import ARRAY_SUFFIX, load_calibration, save_array_calibration
from midair.model import HEIGHT, Acoustics, Medium
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
    height: Length = HEIGHT,
    date: str | None = None,
    air: AirOptions | None = None,
    exposure: ExposureOptions | None = None,
    seed: int = 0,
    force: Force = False,
    json: Json = False,
) -> None:
    """Measure strength, phase and resonance of each transducer of an array, with a sensor above it.

    All transducers hold a focus on the centre of the sensor, and each is modulated with its own code.
    The position of the sensor is estimated to a few millimetres.
    Use the result with --array-calibration in midair solve, loop, budget and play.

    Parameters
    ----------
    sensor
        virtual, or a sensor as in midair record, lying face down over the centre of the array.
    output
        File to write, NAME.array.h5. [default: the array's name and the date]
    device
        virtual, or an array as in midair play.
    calibration
        Calibration of the sensor. [default: that of the virtual sensor]
    duration
        Length of the codes; four times the length halves the uncertainty.
    top
        Highest pressure in the centre of each focus.
    height
        Height of the sensor above the array, to about a millimetre.
    date
        Date of the measurement, ISO 8601. [default: today]
    air
        Air of the room. [default: 22C and 50%]
    exposure
        Exposure profile; codes that exceed it are refused: lower --top.
    seed
        Random seed of a virtual rig.

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
    print_air(medium, stated=room is not None)
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
    """Sensor and array, not yet open, with the silencer off."""
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
