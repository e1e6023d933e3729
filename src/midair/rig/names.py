"""Devices by the names that people give them on the command line: ``virtual:towel``, ``replay:take.h5``."""

from midair.devices import ReplaySensor, SensorDevice
from midair.errors import UnknownDeviceError
from midair.rig.virtual import VirtualRig
from midair.store import load, load_calibration


def sensor_named(name: str, rig: VirtualRig, *, duration: float | None = None) -> SensorDevice:
    """The sensor that a name means, not yet open.

    Parameters
    ----------
    name : str
        ``virtual:OBJECT`` with OBJECT one of brush, sponge, towel, each with +groove for the grooved surface, or one of
        am-i, am-ii, am-iii, the modulated foci of section 5.2; or ``replay:FILE``.
    rig : VirtualRig
        What virtual names refer to.
    duration : float, optional
        For how long a virtual object touches, in s.

    Raises
    ------
    UnknownDeviceError
        If nothing answers to the name.
    """
    kind, _, rest = name.partition(":")
    if kind == "virtual" and rest:
        return rig.touched_by(rest, duration=duration)
    if kind == "replay" and rest:
        return ReplaySensor(load(rest), calibration=load_calibration(rest) if rest.endswith(".h5") else None, name=name)
    raise UnknownDeviceError(f"sensor: expected virtual:OBJECT or replay:FILE, got {name!r}; try virtual:towel")


def check_array_name(name: str) -> None:
    """Refuse a name of an array that nothing answers to.

    Raises
    ------
    UnknownDeviceError
        If it is not ``virtual``.
    """
    if name != "virtual":
        raise UnknownDeviceError(f"array: expected virtual, got {name!r}; midair play takes others")
