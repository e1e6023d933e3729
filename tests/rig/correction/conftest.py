import pytest

from midair.model import ControlGrid, TransducerArray
from midair.pipeline import calibrated_pressure
from midair.rig import OpenRig, record
from midair.rig import loop as run_loop
from midair.rig.names.sensor_names import VirtualRig
from midair.settings import Settings

SETTINGS = Settings().but(grid=ControlGrid(rows=6, columns=6, pitch=11e-3), method="lm", iterations=2)


@pytest.fixture(scope="session")
def loop():
    rig = VirtualRig(array=TransducerArray.autd3(columns=1, rows=1))
    skin = rig.skin()
    with rig.touched_by("towel", duration=0.6) as sensor:
        original = calibrated_pressure(record(sensor, 0.6).recording, sensor.calibration, SETTINGS).cut(0.4, 0.06)
    with OpenRig(array=rig.array_device(skin), sensor=rig.sensor(skin)) as opened:
        return run_loop(original, SETTINGS, opened, lead=0.0)
