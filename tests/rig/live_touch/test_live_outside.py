"""Live touch seen from outside: how late a tap leaves, and how soon it is silent whatever happens.

By the wire to emulated units and the units' own word, never by the loop's. Bounds are loose, for machines of tests are
busy; `python -m benchmarks.live` prints the figures.
"""

import numpy as np
import pytest
from benchmarks import live as outside

pytest.importorskip("autd3")
pytest.importorskip("serial")

pytestmark = pytest.mark.slow

SOON = {
    "Ctrl-C": 0.6,
    "midair stop": 0.3,
    # A lease lasts half a second without renewal.
    "program that looks on killed": 0.8,
    "program that looks on hangs": 0.8,
    "loop killed": 0.4,
    "loop hangs": 0.4,
    "sensor falls silent": 0.4,
    "cable to the array cut": 0.4,
}


@pytest.mark.parametrize("name", outside.DEATHS)
def test_every_kind_of_end_is_silent(name):
    took, by = outside.deaths((name,))[name]
    assert took < SOON[name], by
    if name.startswith("loop") or name.startswith("cable"):
        assert by == "the units' failsafe"


def test_a_tap_goes_out_on_the_wire_soon_and_after_the_filter_s_delay():
    taps = outside.latency(6.0)
    # The filter alone is 6 ms, and two frames come at once.
    assert 5.0 < np.median(taps) < 30.0
