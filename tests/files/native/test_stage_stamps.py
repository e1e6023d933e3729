import h5py
import numpy as np
import pytest

from midair.errors import BrokenFileError
from midair.files import RecordingWriter, load
from midair.files.native.journal import with_stage
from midair.model import Event, Provenance, SensorGrid, StageStamp

STAMPS = [StageStamp(time=0.1 * i, position=(0.005 * i, -0.06, -0.02), feed=0.05) for i in range(25)]
"""50 mm/s along x for 2.4 s."""
STROKE = Event(kind="stroke", frame=0, frames=2400)


def writer(path):
    return RecordingWriter(path, rate=1000.0, sensor=SensorGrid(), unit="V", provenance=Provenance())


def written(path):
    with writer(path) as file:
        for first in range(0, 25, 5):
            file.append(np.zeros((500, 4, 4)))
            file.stamp(STAMPS[first : first + 5])
        file.note([STROKE])
    return path


def test_a_recording_with_a_stage_has_positions_strokes_and_speed(tmp_path):
    life = load(written(tmp_path / "a.h5")).provenance
    step = next(step for step in life.steps if step.stage == "stage")
    assert step.settings["strokes"] == 1
    assert step.settings["speed_m_s"] == pytest.approx((0.05,))
    assert len(step.settings["stamps"]) == 25
    assert step.settings["stamps"][3] == pytest.approx((0.3, 0.015, -0.06, -0.02, 0.05))
    events = next(step for step in life.steps if step.stage == "events")
    assert events.settings["strokes"] == ((0, 2400),)


def test_a_recording_without_a_stage_has_nothing_of_it(tmp_path):
    with writer(tmp_path / "a.h5") as file:
        file.append(np.zeros((10, 4, 4)))
        file.stamp([])
    with h5py.File(tmp_path / "a.h5") as file:
        assert not [name for name in file if name.startswith("stage")]
    assert load(tmp_path / "a.h5").provenance.steps == ()


def test_a_place_that_is_no_number_is_a_broken_file(tmp_path):
    with h5py.File(written(tmp_path / "a.h5"), "r+") as file:
        file["stage_y"][3] = np.nan
    with pytest.raises(BrokenFileError, match="stage: expected finite"):
        load(tmp_path / "a.h5")


def test_a_stroke_too_short_to_tell_has_no_speed():
    life = with_stage(Provenance(), STAMPS, [Event(kind="stroke", frame=0, frames=150)], 1000.0)
    assert life.steps[0].settings["speed_m_s"] == (None,)
