"""Event markers: what a real LSL inlet and the other end of a serial line receive."""

import json
import os
import re
import threading
import tty

import numpy as np
import pytest

from midair.errors import DeviceError, InputError
from midair.study.design.plan import draw_plan
from midair.study.design.session_state import answers_table, markers_table
from midair.study.event_markers import EventMarkers
from midair.study.folder import StudyFolder, read_design
from midair.study.session.event_log import read_events
from midair.study.session.presenters import SilentPresenter
from midair.study.session.trials import InstantClock, Reply, Session
from midair.study.tables import write_bids

PLAN = """
name = "marked"
participants = 1
seed = 1
[markers]
{outputs}
[[questions]]
name = "felt"
kind = "yes-no"
text = "Did you feel it?"
timeout_s = 5
[[stimuli]]
name = "towel"
kind = "object"
source = "towel"
code = 20
[[stimuli]]
name = "nothing"
kind = "silence"
[[blocks]]
name = "only"
stimuli = ["towel", "nothing"]
questions = ["felt"]
order = "fixed"
"""


@pytest.fixture
def line():
    far, near = os.openpty()
    tty.setraw(far)
    yield far, os.ttyname(near)
    os.close(far)
    os.close(near)


def study(tmp_path, outputs):
    text = PLAN.format(outputs=outputs)
    folder = StudyFolder.create(tmp_path / "s", text, read_design(text))
    return folder, folder.plan()


def session(folder, plan, markers=None):
    return Session(
        plan, 1, folder.log(1), SilentPresenter(), clock=InstantClock(), **{"markers": markers} if markers else {}
    )


def test_every_event_is_one_byte_on_the_serial_line_and_a_row_of_the_bids_dataset(line, tmp_path):
    far, port = line
    folder, plan = study(tmp_path, f'serial = "{port}"')
    with EventMarkers(plan.design.markers) as markers, session(folder, plan, markers=markers) as one:
        one.present()
        with pytest.raises(InputError, match="expected one of"):
            one.answer(Reply(text="maybe"))
        one.answer(Reply(text="yes"))
        one.present()
        one.answer(Reply(text="", reaction_s=5, late=True))
        assert one.step.kind == "done"
    # trial, towel (code 20), answer; trial, nothing (default code), late answer. An invalid answer has no marker.
    got = b""
    while len(got) < 6:  # a line gives its bytes when it has them
        got += os.read(far, 100)
    assert list(got) == [1, 20, 3, 1, 2, 4]
    sessions = folder.sessions()
    write_bids(answers_table(plan, sessions), plan.design, tmp_path / "bids", markers=markers_table(sessions))
    table = tmp_path / "bids" / "sub-01" / "beh" / "sub-01_task-marked_events.tsv"
    head, *rows = (row.split("\t") for row in table.read_text().splitlines())
    assert head[:2] == ["onset", "duration"]
    assert [row[head.index("value")] for row in rows] == ["1", "20", "3", "1", "2", "4"]
    assert [row[head.index("trial")] for row in rows] == ["1", "1", "1", "2", "2", "2"]
    assert set(head) == set(json.loads(table.with_suffix(".json").read_text()))


def test_a_real_inlet_receives_the_markers_at_the_logged_times(tmp_path):
    pylsl = pytest.importorskip("pylsl")
    name = f"midair test {os.getpid()}"
    folder, plan = study(tmp_path, f'lsl = "{name}"')
    got, clocks = [], []
    ready, ended = threading.Event(), threading.Event()

    def receive():
        inlet = pylsl.StreamInlet(pylsl.resolve_byprop("name", name, 1, 60.0)[0])
        inlet.open_stream(60.0)
        ready.set()
        while len(got) < 6:
            sample, at = inlet.pull_sample(60.0)
            got.append(sample[0])
            clocks.append(at)
        ended.set()

    with EventMarkers(plan.design.markers) as markers:
        threading.Thread(target=receive, daemon=True).start()
        assert ready.wait(60)
        with session(folder, plan, markers=markers) as one:
            while one.step.kind != "done":
                one.present() if one.step.kind == "present" else one.answer(Reply(text="yes"))
        assert ended.wait(60)
    assert got == [f"{code} {kind} p01-t00{n}" for n, own in ((1, 20), (2, 2))
                   for code, kind in ((1, "trial"), (own, "stimulus"), (3, "answer"))]  # fmt: skip
    logged = [event["clock_s"] for event in read_events(folder.log(1)) if event["event"] == "marker"]
    np.testing.assert_allclose(clocks, logged, atol=2e-6)


def test_a_study_without_markers_has_no_table_of_events(tmp_path):
    text = re.sub(r"\[markers\]\n.*\n", "", PLAN)
    folder = StudyFolder.create(tmp_path / "s", text, read_design(text))
    plan = folder.plan()
    with session(folder, plan) as one:
        one.present()
        one.answer(Reply(text="yes"))
    sessions = folder.sessions()
    written = write_bids(answers_table(plan, sessions), plan.design, tmp_path / "bids", markers=markers_table(sessions))
    assert not [path for path in written if "events" in path.name]


def test_an_answer_is_stored_even_if_its_marker_fails(line, tmp_path):
    _, port = line
    folder, plan = study(tmp_path, f'serial = "{port}"')
    with (
        pytest.raises(DeviceError, match="to accept a byte"),
        EventMarkers(plan.design.markers) as markers,
        session(folder, plan, markers=markers) as one,
    ):
        one.present()
        markers.port.close()
        one.answer(Reply(text="yes"))
    assert folder.sessions()[0].answers["p01-t001", "felt"].answer == "yes"
    # A missing port is an error that names it.
    plan = draw_plan(read_design(PLAN.format(outputs='serial = "/dev/none"')))
    with pytest.raises(DeviceError, match="expected the serial port /dev/none"), EventMarkers(plan.design.markers):
        pass
