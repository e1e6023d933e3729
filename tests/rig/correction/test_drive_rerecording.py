"""A drive on the virtual rig gives the same recording as a re-recording, and the same palm fidelity as a loop."""

import numpy as np
import pytest

from midair.devices import check_exposure
from midair.model import ControlGrid, Palm
from midair.pipeline import calibrated_pressure, reproduce, required_lead
from midair.rig import VirtualRig, capture_recording, default_exposure, rerecord, rerecord_drive
from midair.settings import paper_mode
from midair.targets import add_lead

SPOT = Palm.disc(50e-3)
SMALL = paper_mode().but(grid=ControlGrid(rows=4, columns=4, pitch=11e-3), method="glide")


@pytest.fixture(scope="module")
def made():
    rig = VirtualRig(seed=3)
    with rig.touched_by("sponge", duration=0.3) as sensor:
        original = calibrated_pressure(capture_recording(sensor, 0.3), sensor.calibration, SMALL).cut(0.2, 0.06)
    asked = add_lead(original, required_lead(SMALL))
    return rig, original, asked, reproduce(asked, rig.array, SMALL).solution.drive


@pytest.mark.long
def test_the_recording_equals_that_of_play(made):
    rig, original, asked, drive = made
    heard = rerecord_drive(drive, original, asked, rig, palm=SPOT)
    skin = rig.skin()
    with rig.array_device(skin) as array, rig.sensor(skin) as sensor:
        again = rerecord(check_exposure(drive, array, default_exposure()), array, sensor)
    np.testing.assert_array_equal(heard.recording.samples, again.samples)
    assert heard.recording.provenance.simulated
    assert heard.calibration is not None


@pytest.mark.long
def test_another_seed_is_another_array(made):
    _, original, asked, drive = made
    first, second = (rerecord_drive(drive, original, asked, VirtualRig(seed=seed), palm=SPOT) for seed in (3, 4))
    assert first.palm.pressure != second.palm.pressure
    assert first.palm.outside == pytest.approx(second.palm.outside, abs=0.1)
