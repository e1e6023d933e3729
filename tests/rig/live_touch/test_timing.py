import subprocess
import sys

import numpy as np
import pytest

from midair.rig.live_touch.timing import TICK, RateMeter, Timetable

MS = 1_000_000


def test_frames_sound_at_an_even_pace_whatever_the_jitter_of_their_stamps_and_their_clock():
    """Stamps up to 1 ms off: instants a period apart, now and then a tick more or less, and a hold later on average."""
    rng = np.random.default_rng(1)
    taken = 10**9 + np.arange(5000) * MS + rng.integers(0, MS, 5000)
    table = Timetable(MS, 6 * MS)
    instants = np.array([table.instant(number, int(at)) for number, at in enumerate(taken)])
    assert set(np.diff(instants)) <= {MS - TICK, MS, MS + TICK}
    assert np.mean(np.diff(instants) == MS) > 0.9
    assert np.mean(instants[2000:] - taken[2000:]) == pytest.approx(6 * MS, abs=2 * TICK)
    assert (instants % TICK == 0).all()
    for ppm in (-200, 200):  # a sensor whose clock is another
        taken = 10**9 + np.round(np.arange(20000) * MS * (1 + ppm * 1e-6)).astype(int)
        table = Timetable(MS, 6 * MS)
        instants = np.array([table.instant(number, int(at)) for number, at in enumerate(taken)])
        assert np.abs(instants - taken - 6 * MS)[1000:].max() < 4 * TICK


def test_lost_frames_leave_their_place_and_a_long_pause_begins_anew():
    table = Timetable(MS, 6 * MS)
    first = table.instant(0, 10**9)
    assert table.instant(4, 10**9 + 4 * MS) == first + 4 * MS
    assert table.instant(5, 2 * 10**9) == 2 * 10**9 + 6 * MS


@pytest.mark.long
def test_realtime_request_reports_refusals_and_disables_the_garbage_collector():
    """In a process of its own, since it changes the process."""
    code = (
        "import gc, os; from midair.rig.live_touch.timing import request_realtime; said = request_realtime(5);"
        "print(gc.isenabled(), (os.sched_getscheduler(0) == os.SCHED_FIFO) == said.startswith('real-time'))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True"]


def test_a_sensor_s_rate_is_measured_without_its_pauses_and_lost_frames(subtests):
    """20 s with 3 ms of jitter; 500 frames are lost, and once the sensor pauses without counting."""
    for rate in [900.0, 1000.0, 1010.0]:
        with subtests.test(rate=rate):
            rng, meter = np.random.default_rng(1), RateMeter()
            for number in range(round(20 * rate)):
                if not 4000 <= number < 4500:
                    pause = 0.7 if number >= 8000 else 0.0
                    meter.add(number, 100.0 + number / rate + pause + rng.uniform(0, 3e-3))
            assert meter.frames / meter.span == pytest.approx(rate, rel=1e-3)
