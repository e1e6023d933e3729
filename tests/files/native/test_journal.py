from types import SimpleNamespace

import h5py
import numpy as np
import pytest
import xarray
from hypothesis import given
from hypothesis import strategies as st

from midair.errors import BrokenFileError
from midair.files import RecordingWriter, load, repair, save
from midair.files.native.journal import KINDS, LISTED, journal_from, with_events, with_stage
from midair.files.native.schema import stored_values
from midair.model import Event, Provenance, SensorGrid, StageStamp

EVENTS = (
    Event(kind="trigger", frame=2),
    Event(kind="lost", frame=3, frames=2),
    Event(kind="clipped", frame=4, frames=1, channel=5),
    Event(kind="lost", frame=8, frames=5),
    Event(kind="stuck", frame=6, channel=1),
    Event(kind="rate", frame=9, ppm=12.5),
)
STEP = {
    "lost_frames": 4,
    "lost": ((3, 2), (8, 2)),
    "clipped_frames": 1,
    "clipped": ((5, 4, 1),),
    "stuck": ((1, 6),),
    "rate_ppm": 12.5,
    "trigger": 2,
}


@given(
    st.lists(
        st.builds(
            Event,
            kind=st.sampled_from(KINDS),
            frame=st.integers(0, 2**40),
            frames=st.integers(0, 2**40),
            channel=st.integers(-1, 300),
            ppm=st.floats(-1e6, 1e6),
        )
    )
)
def test_stored_events_are_read_back(events):
    values = stored_values("recording", SimpleNamespace(events=events))
    assert journal_from({name: np.array(value) for name, value in values.items()})[0] == tuple(events)


def test_a_flood_is_counted_and_its_beginning_listed():
    events = [Event(kind="lost", frame=2 * i, frames=1) for i in range(3 * LISTED)]
    settings = with_events(Provenance(), events, 10**6).steps[-1].settings
    assert settings["lost_frames"] == 3 * LISTED
    assert len(settings["lost"]) == LISTED


def writer(path):
    return RecordingWriter(path, rate=1000.0, sensor=SensorGrid(), unit="V", provenance=Provenance(source="bench"))


def written(path):
    with writer(path) as file:
        for event in EVENTS:
            file.note([event])
        file.note([])
        file.append(np.random.default_rng(0).normal(size=(10, 4, 4)))


def test_the_journal_of_a_file_becomes_a_step_that_every_copy_keeps(tmp_path):
    written(tmp_path / "live.h5")
    recording = load(tmp_path / "live.h5")
    assert dict(recording.provenance.steps[-1].settings) == STEP
    save(recording, tmp_path / "copy.h5")
    assert load(tmp_path / "copy.h5").provenance == recording.provenance
    repair(tmp_path / "live.h5")
    assert load(tmp_path / "live.h5").provenance == recording.provenance


@pytest.mark.long
def test_the_journal_opens_in_xarray_with_its_meanings(tmp_path):
    written(tmp_path / "live.h5")
    with xarray.open_dataset(tmp_path / "live.h5", engine="h5netcdf") as table:
        assert table.event_frame.values.tolist() == [event.frame for event in EVENTS]
        meanings = table.event_kind.attrs["flag_meanings"].split()
        assert [meanings[kind] for kind in table.event_kind.values] == [event.kind for event in EVENTS]


@pytest.mark.parametrize(("name", "value"), [("event_kind", 99), ("event_kind", -1), ("event_frame", -5)])
def test_numbers_that_mean_nothing_are_refused(name, value, tmp_path):
    written(tmp_path / "live.h5")
    with h5py.File(tmp_path / "live.h5", "r+") as file:
        file[name][0] = value
    with pytest.raises(BrokenFileError, match=r"live\.h5: (events: expected|expected event_kind 0 to)"):
        load(tmp_path / "live.h5")


STAMPS = [StageStamp(time=0.1 * i, position=(0.005 * i, -0.06, -0.02), feed=0.05) for i in range(25)]
"""50 mm/s along x for 2.4 s."""
STROKE = Event(kind="stroke", frame=0, frames=2400)


def stroked(path):
    with writer(path) as file:
        for first in range(0, 25, 5):
            file.append(np.zeros((500, 4, 4)))
            file.stamp(STAMPS[first : first + 5])
        file.note([STROKE])
    return path


def test_a_recording_with_a_stage_has_positions_strokes_and_speed(tmp_path):
    life = load(stroked(tmp_path / "a.h5")).provenance
    step = next(step for step in life.steps if step.stage == "stage")
    assert step.settings["strokes"] == 1
    assert step.settings["speed_m_s"] == pytest.approx((0.05,))
    assert len(step.settings["stamps"]) == 25
    assert step.settings["stamps"][3] == pytest.approx((0.3, 0.015, -0.06, -0.02, 0.05))
    events = next(step for step in life.steps if step.stage == "events")
    assert events.settings["strokes"] == ((0, 2400),)
    life = with_stage(Provenance(), STAMPS, [Event(kind="stroke", frame=0, frames=150)], 1000.0)
    assert life.steps[0].settings["speed_m_s"] == (None,)
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        file["stage_y"][3] = np.nan
    with pytest.raises(BrokenFileError, match="stage: expected finite"):
        load(tmp_path / "a.h5")


def test_a_recording_without_a_stage_has_nothing_of_it(tmp_path):
    with writer(tmp_path / "a.h5") as file:
        file.append(np.zeros((10, 4, 4)))
        file.stamp([])
    with h5py.File(tmp_path / "a.h5") as file:
        assert not [name for name in file if name.startswith("stage")]
    assert load(tmp_path / "a.h5").provenance.steps == ()
