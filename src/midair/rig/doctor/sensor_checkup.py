"""Check the software that live sensors need, the connected sensors, and the signals of a named one."""

import importlib.metadata

import numpy as np

from midair.errors import DeviceError, MidairError, MissingExtraError
from midair.model import SensorWiring
from midair.recordings import at_limit
from midair.rig.doctor.check import Check, broken, missing, ok
from midair.rig.names import SENSORS, source_sensor


def sensor_findings() -> list[Check]:
    """Check the virtual sensor, and the package, library and connected devices of each kind of live sensor."""
    return [ok("virtual sensor", "always available, as is replay:FILE"), *(_kind(kind) for kind in SENSORS)]


def is_live_sensor(name: str) -> bool:
    """Whether a name is that of a live sensor rather than of an array."""
    return name.partition(":")[0] in SENSORS


def live_sensor_findings(name: str, wiring: SensorWiring | None = None) -> list[Check]:
    """Open a live sensor, read it for half a second, and check the samples."""
    plain = name.partition("?")[0]
    try:
        with source_sensor(name, wiring=wiring) as sensor:
            sensor.start()
            block = sensor.read(max(2, round(0.5 * sensor.rate)))
            said = sensor.describe()
            unit, full_scale = sensor.unit, sensor.full_scale
    except MidairError as wrong:
        # A message of midair has advice after its semicolon.
        found, _, advice = str(wrong).partition("; ")
        return [broken(plain, found, advice or "see docs, build a sensor")]
    low, high = block.samples.min(axis=0), block.samples.max(axis=0)
    largest = np.maximum(np.abs(low), np.abs(high)).ravel()
    clipping = [] if full_scale is None else [str(each) for each in np.flatnonzero(at_limit(largest, full_scale))]
    still = [str(channel) for channel in np.flatnonzero(low.ravel() == high.ravel())]
    return [
        *(ok(f"{plain}: {subject}", found) for subject, found in said.items()),
        _channel_check(plain, "cells that never change", still, "check their wires and their supply"),
        _channel_check(plain, "cells that clip", clipping, "lower the gain"),
        ok(f"{plain}: samples", f"{low.min():.4g} to {high.max():.4g} {unit}"),
    ]


def _channel_check(name: str, subject: str, cells: list[str], advice: str) -> Check:
    if not cells:
        return ok(f"{name}: {subject}", "none")
    return broken(f"{name}: {subject}", ", ".join(cells), advice)


def _kind(kind: str) -> Check:
    try:
        driver = SENSORS[kind]
        found = driver.available()
    except MissingExtraError as wrong:
        found, _, advice = str(wrong).partition("; ")
        return missing(f"{kind}: sensors", found, f"{advice} if you have such a sensor")
    except DeviceError as wrong:
        return missing(f"{kind}: sensors", str(wrong), "only needed if you have such a sensor")
    version = f"{driver.package} {importlib.metadata.version(driver.package)}; " if driver.package else ""
    return ok(f"{kind}: sensors", version + found)
