from typing import get_args

import numpy as np
import pytest

from midair.errors import DeviceError
from midair.model import Event, EventKind, SensorGrid
from midair.rig.takes.meters import Levels
from midair.rig.takes.take_state import Drift, Take, event_message, take_problems

NONE = np.zeros(16, bool)


@pytest.mark.parametrize(
    ("event", "words"),
    [
        (Event(kind="lost", frame=1200, frames=16), "1.200 s: 16 frames (16 ms) were lost"),
        (Event(kind="lost", frame=1200), "1.200 s: frames may be missing: the sensor lost an unknown number, or"),
        (Event(kind="clipped", frame=0, frames=3, channel=6), "0.000 s: channel 6 (row 1, column 2) clips"),
        (Event(kind="dead", frame=0, channel=15), "channel 15 (row 3, column 3) is dead"),
        (Event(kind="stuck", frame=500, channel=0), "0.500 s: channel 0 (row 0, column 0) is stuck"),
        (Event(kind="rate", frame=0, ppm=-3000), "3000 ± 20 ppm slower than 1000 a second"),
        (Event(kind="clock", frame=0, ppm=250), "the sensor's clock runs 250 ± 20 ppm faster"),
        (Event(kind="trigger", frame=64), "0.064 s: touched"),
        (Event(kind="stroke", frame=64, frames=500), "0.064 s: a stroke of 0.500 s"),
        (Event(kind="mended", frame=10, frames=3, channel=6), "3 missing frames of channel 6 (row 1, column 2)"),
        (Event(kind="late", frame=10, frames=2), "0.010 s: 2 frames of live touch were not played in time"),
    ],
)
def test_an_event_is_a_sentence(event, words):
    assert words in event_message(event, 1000.0, SensorGrid(), Drift(ppm=event.ppm, uncertainty=20, span=10))


def test_every_kind_of_event_has_a_sentence():
    for kind in get_args(EventKind):
        assert event_message(Event(kind=kind, frame=1000), 1000.0, SensorGrid()).startswith("1.000 s: ")


def take(**changes):
    levels = Levels(
        rms=np.zeros(16), peak=np.zeros(16), highest=np.zeros(16), clipped=np.zeros(16, int), clipping=NONE, dead=NONE,
        stuck=NONE,
    )  # fmt: skip
    whole = {"path": None, "frames": 1000, "lost": 0, "end": "duration", "error": None, "levels": levels, "lowest": 0.0}
    return Take(**{**whole, "memory": None, "highest": 0.0, "rate": None, "clock": None, **changes})


def test_a_good_take_has_no_problems():
    assert take_problems(take(), 1000.0) == []
    assert take_problems(take(rate=Drift(ppm=5, uncertainty=6, span=10)), 1000.0) == []


def test_each_problem_of_a_take_has_a_line():
    bad = take(lost=16, error=DeviceError("bench: unplugged"), rate=Drift(ppm=3200, uncertainty=6, span=10))
    rows = dict(take_problems(bad, 1000.0))
    assert rows["lost"].startswith("16 frames (1.6 %)")
    assert rows["frames per second"].startswith("1003.2 Hz, +3.2e+03 ± 6 ppm")
    assert rows["ended by"] == "bench: unplugged"
