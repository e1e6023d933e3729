from types import SimpleNamespace

import h5py
import numpy as np
import pytest
import xarray
from hypothesis import given
from hypothesis import strategies as st

from midair.errors import BrokenFileError
from midair.files import RecordingWriter, load, repair, save
from midair.files.native.journal import KINDS, LISTED, journal_from, with_events
from midair.files.native.schema import stored_values
from midair.model import Event, Provenance, SensorGrid

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


def written(path, *, events=EVENTS):
    options = {"rate": 1000.0, "sensor": SensorGrid(), "unit": "V", "provenance": Provenance(source="bench")}
    with RecordingWriter(path, **options) as writer:
        for event in events:
            writer.note([event])
        writer.note([])
        writer.append(np.random.default_rng(0).normal(size=(10, 4, 4)))


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
