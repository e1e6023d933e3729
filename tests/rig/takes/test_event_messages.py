from typing import get_args

import numpy as np

from midair.errors import DeviceError
from midair.model import Event, EventKind, SensorGrid
from midair.rig.takes.meters import Levels
from midair.rig.takes.take_state import Drift, Take, event_message, take_problems

NONE = np.zeros(16, bool)


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


def test_each_problem_of_a_take_has_a_line():
    bad = take(lost=16, error=DeviceError("bench: unplugged"), rate=Drift(ppm=3200, uncertainty=6, span=10))
    rows = dict(take_problems(bad, 1000.0))
    assert rows["lost"].startswith("16 frames (1.6 %)")
    assert rows["frames per second"].startswith("1003.2 Hz, +3.2e+03 ± 6 ppm")
    assert rows["ended by"] == "bench: unplugged"
    assert take_problems(take(), 1000.0) == []
    assert take_problems(take(rate=Drift(ppm=5, uncertainty=6, span=10)), 1000.0) == []
