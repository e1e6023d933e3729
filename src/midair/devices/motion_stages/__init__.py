"""Motion stages that draw an object over the sensor."""

from midair.devices.interface import StageDevice as StageDevice
