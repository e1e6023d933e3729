"""Motion stages that draw an object over the sensor."""

from .stage_device import StageDevice as StageDevice
