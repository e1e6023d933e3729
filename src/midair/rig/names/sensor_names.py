"""Sensors by name: ``virtual:towel``, ``replay:take.h5``, ``lsl:Skin``."""

from midair.devices import RemappedSensor, ReplaySensor, SensorDevice
from midair.errors import UnknownDeviceError
from midair.files import open_take
from midair.model import SensorWiring
from midair.rig.names.source_names import SENSORS, source_sensor
from midair.rig.names.virtual_rig import VirtualRig


def sensor_named(
    name: str, rig: VirtualRig, *, duration: float | None = None, wiring: SensorWiring | None = None
) -> SensorDevice:
    """Make the sensor that a name stands for, not yet open.

    Parameters
    ----------
    name : str
        ``virtual:OBJECT``, with OBJECT one of brush, sponge, towel (+groove for the grooved surface) or one of am-i,
        am-ii, am-iii, the modulated foci of section 5.2; or ``replay:FILE``; or a live sensor (`source_names`):
        ``lsl:NAME``, ``audio:DEVICE``, ``serial:PORT``, ``ni:CHANNELS``.
    rig : VirtualRig
        Rig of the virtual names.
    duration : float, optional
        Duration of a virtual touch in s.
    wiring : SensorWiring, optional
        Assignment of channels to cells, from a sensor file; cells of a virtual or replayed sensor count as channels.

    Raises
    ------
    UnknownDeviceError
        If the name is unknown.
    MissingExtraError, DeviceError, InputError
        As in `source_sensor`.
    """
    kind, _, rest = name.partition(":")
    if kind not in ("virtual", "replay") and kind in SENSORS and (rest or SENSORS[kind].has_default):
        return source_sensor(name, wiring=wiring)
    made = _on_demand_sensor(kind, rest, name, rig, duration)
    return made if wiring is None else RemappedSensor(made, wiring)


def _on_demand_sensor(kind: str, rest: str, name: str, rig: VirtualRig, duration: float | None) -> SensorDevice:
    if kind == "virtual" and rest:
        return rig.touched_by(rest, duration=duration)
    if kind == "replay" and rest:
        take = open_take(rest)
        return ReplaySensor(take.recording, calibration=take.calibration, name=name)
    others = "".join(f"{kind}:PLACE, " for kind in SENSORS.others)
    raise UnknownDeviceError(
        f"sensor: expected virtual:OBJECT, replay:FILE, {others}lsl:NAME, audio:DEVICE, serial:PORT or ni:CHANNELS, "
        f"got {name!r}; try virtual:towel"
    )
