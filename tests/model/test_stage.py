import dataclasses

import numpy as np
import pytest

from midair.model import StageSetup, StageStamp, speed_of

HEIGHTS = {"contact": -0.0225, "clear": -0.02, "approach": 0.005, "back": 0.1}
SETUP = StageSetup(heading="+x", start=(-0.18, -0.06), travel=((-0.24, 0.0), (-0.12, 0.0), (-0.06, 0.0)), **HEIGHTS)


def stamps(places, step=0.1):
    return [StageStamp(time=i * step, position=(x, 0.0, 0.0), feed=0.0) for i, x in enumerate(places)]


def test_a_stroke_within_the_travel_is_allowed_to_its_very_end():
    SETUP.check(0.18)
    assert SETUP.end(0.18) == (0.0, -0.06, -0.0225)


def test_the_speed_is_that_of_the_middle_also_with_one_late_stamp():
    # 0 to 100 mm: slow at both ends, 20 mm in each tenth of a second between 25 and 75 mm.
    assert speed_of(stamps([0, 0.001, 0.005, 0.03, 0.05, 0.07, 0.098, 0.1])) == pytest.approx(0.2)
    even = stamps(np.linspace(0, 0.12, 25))
    late = [dataclasses.replace(even[12], time=even[12].time + 0.05), *even[13:]]
    assert speed_of([*even[:12], *late]) == pytest.approx(0.05, rel=0.005)
    few = [[], [0.0], [0.0, 0.1], [0.0, 0.0, 0.0, 0.0]]
    assert [speed_of(stamps(places)) for places in few] == [None] * 4
