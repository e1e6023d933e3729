"""One loop that several tests share."""

import pytest

from midair.model import ControlGrid
from midair.pipeline import calibrated_pressure
from midair.rig import record
from midair.rig.correction.correction_loop import run_loop
from midair.rig.names.virtual_rig import VirtualRig
from midair.settings import Settings

SETTINGS = Settings().but(grid=ControlGrid(rows=6, columns=6, pitch=11e-3), method="exact", iterations=2)


@pytest.fixture(scope="session")
def loop():
    rig = VirtualRig()
    skin = rig.skin()
    with rig.touched_by("towel", duration=0.6) as sensor:
        original = calibrated_pressure(record(sensor, 0.6).recording, sensor.calibration, SETTINGS).cut(0.4, 0.06)
    with rig.array_device(skin) as array, rig.sensor(skin) as sensor:
        return run_loop(original, array, sensor, SETTINGS)
