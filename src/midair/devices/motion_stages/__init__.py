"""Motion stages that draw an object over the sensor."""

from midair.devices.motion_stages.stage_device import StageDevice

__all__ = ["StageDevice"]
