"""A stage with Grbl, against a stand-in written from Grbl's documentation and not from the driver."""

import threading
import time

import numpy as np
import pytest
from tests.simulators.grbl import GrblSimulator
from tests.waiting import wait_until

from midair.devices import GrblStage, grbl
from midair.errors import DeviceError, HeldError, InputError, LinkLostError
from midair.model import speed_of

FAR = (-0.2, -0.05, -0.001)


@pytest.fixture(autouse=True)
def _state(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))


@pytest.fixture
def machine(request):
    made = getattr(request, "param", GrblSimulator)()
    yield made
    made.close()


def on(make):
    return pytest.mark.parametrize("machine", [make], indirect=True)


def go(stage, target, speed=0.1, stopped=lambda: False):
    stamps = []
    times = stage.move(target, speed, stamp=stamps.append, stopped=stopped)
    return times, stamps


def test_opening_moves_nothing_and_reports_the_position(machine):
    with GrblStage(machine.port) as stage:
        stamp = stage.ready(homing=True)
        assert stamp.position == pytest.approx((-0.001, -0.001, -0.001))
        assert stage.firmware == "Grbl 1.1h.20190825"
    assert machine.moves == []
    assert machine.lines == ["$$", "$I"]


@pytest.mark.long  # It compares a speed with the clock, to 2 %.
def test_a_move_ends_where_and_when_the_machine_does(machine):
    with GrblStage(machine.port) as stage:
        stage.ready(homing=True)
        go(stage, (-0.11, -0.05, -0.001), 0.2)
        times, stamps = go(stage, (-0.06, -0.05, -0.001), 0.05)
    assert machine.place == pytest.approx([-60, -50, -1])
    assert machine.lost == 0
    true = machine.moves[-1]
    # The machine's own beginning and end, by the same clock; what is between is the line and this computer.
    assert true.begun - 0.05 <= times[0] <= true.begun + 0.5
    assert true.begun + true.duration <= times[1] <= true.begun + true.duration + 0.5
    assert speed_of([one for one in stamps if times[0] <= one.time <= times[1]]) == pytest.approx(0.05, rel=0.02)
    for one in stamps:
        assert one.position[0] == pytest.approx(true.at(one.time)[0][0] * 1e-3, abs=0.005)


@pytest.mark.parametrize(
    ("settings", "words"), [({13: 1}, r"got inches; set \$13=0"), ({10: 0}, r"with MPos, got none.*set \$10=1")]
)
def test_reports_in_inches_or_work_coordinates_are_refused(settings, words):
    machine = GrblSimulator(settings=settings)
    try:
        with pytest.raises(DeviceError, match=words), GrblStage(machine.port, search=0.5) as stage:
            stage.ready(homing=True)
    finally:
        machine.close()


def test_a_stop_holds_the_machine_and_cancels_the_rest(machine):
    end = time.monotonic() + 0.4
    with GrblStage(machine.port) as stage:
        stage.ready(homing=True)
        times, _ = go(stage, FAR, 0.05, stopped=lambda: time.monotonic() > end)
        assert times is None
        assert machine.state == "Idle"
        stood = machine.place
        assert -200 < stood[0] < -1
        assert f"x {stood[0]:.3f}" in stage.stands
        # It goes on from there when it is told to, not by itself.
        time.sleep(0.2)
        assert machine.place == pytest.approx(stood)
        go(stage, (stood[0] * 1e-3 + 0.001, -0.01, -0.001))
    assert machine.place[1] == pytest.approx(-10)


@on(lambda: GrblSimulator(settings={20: 1}))
def test_soft_limits_of_grbl_are_reported(machine):
    with GrblStage(machine.port) as stage:
        stage.ready(homing=True)
        with pytest.raises(DeviceError, match=r"ALARM:2, the target is beyond the machine's travel"):
            go(stage, (0.005, 0.0, 0.0))


@pytest.mark.long
@pytest.mark.clock
def test_a_machine_that_falls_silent_is_held_and_given_up_until_it_answers_again(machine):
    with GrblStage(machine.port) as stage:
        stage.ready(homing=True)
        threading.Timer(0.4, lambda: setattr(machine, "mute", True)).start()
        with pytest.raises(LinkLostError, match=r"no answer for 2 s.*may not have reached"):
            go(stage, FAR, 0.02)
        # The hold did reach this one.
        assert machine.state == "Hold:0"
        machine.mute = False
        with pytest.raises(DeviceError, match=r"got Hold:0: it is in a feed hold"):
            stage.ready(homing=True)
        machine._resume()
        wait_until(lambda: machine.state == "Idle", 30)
        time.sleep(0.2)
        stage.ready(homing=True)


class Hal(GrblSimulator):
    """Greets as grblHAL, and can restart in a move without an alarm, as after a loss of power."""

    loses_power = False

    def _greet(self):
        self._say("GrblHAL 1.1f ['$' or '$HELP' for help]")

    def _move(self, now):
        if self.loses_power:
            self.loses_power = False
            self._plan.clear()
            self._now, self._dwell, self._place = None, None, np.zeros(3)
            self._greet()
        super()._move(now)


@pytest.mark.parametrize("machine", [GrblSimulator, Hal], indirect=True)
def test_an_answer_that_is_lost_ends_the_move_after_its_time(machine, monkeypatch):
    """Before, the stage waited for it without end."""
    monkeypatch.setattr(grbl, "ANSWER", 0.5)
    say = machine._say
    with GrblStage(machine.port) as stage:
        stage.ready(homing=True)
        machine._say = lambda line: None if line == "ok" and machine.lines[-1].startswith("G4") else say(line)
        said = (
            r"answer to G4P0\.01 within 0\.[0-9]+ s, got none; it reports Idle at x -2\.000.*was stopped at x -2\.000"
        )
        with pytest.raises(LinkLostError, match=said):
            go(stage, (-0.002, -0.001, -0.001), 0.1)
        machine._say = say
        assert go(stage, (-0.003, -0.001, -0.001))[0] is not None


@on(Hal)
def test_a_machine_that_restarts_in_a_move_is_noticed(machine):
    with GrblStage(machine.port) as stage:
        stage.ready(homing=True)
        threading.Timer(0.2, setattr, (machine, "loses_power", True)).start()
        with pytest.raises(DeviceError, match="was reset or restarted; home it again"):
            go(stage, FAR, 0.05)


def test_the_error_of_a_lost_port_names_the_remaining_motion(machine):
    with GrblStage(machine.port) as stage:
        stage.ready(homing=True)
        threading.Timer(0.4, machine.unplug).start()
        with pytest.raises(LinkLostError, match=r"lost the port.*may finish its current move; switch it off"):
            go(stage, FAR, 0.02)


@on(lambda: GrblSimulator(homed=False))
def test_homing_can_be_stopped_and_is_then_not_done(machine):
    with GrblStage(machine.port) as stage, pytest.raises(DeviceError, match="its position is unknown"):
        stage.home(lambda: True)


@on(lambda: GrblSimulator(settings={22: 0}))
def test_a_machine_without_switches_needs_homing_by_hand(machine):
    with GrblStage(machine.port) as stage:
        with pytest.raises(DeviceError, match="by hand"):
            stage.ready(homing=True)
        stage.ready(homing=False)
        with pytest.raises(DeviceError, match=r"rejected \$H: error:5, homing is disabled"):
            stage.home(lambda: False)


class Damaging(GrblSimulator):
    """Sends answers to nothing when it starts, and `damaged` of its status reports with one wrong letter."""

    damaged = 0

    def _greet(self):
        self._say("error:7")
        self._say("ok")
        super()._greet()

    def _say(self, line):
        if self.damaged and line.startswith("<"):
            self.damaged -= 1
            line = line.replace("Run", "Rvn").replace("Idle", "Sdle")
        super()._say(line)


@on(Damaging)
def test_answers_from_before_the_opening_are_ignored_and_a_damaged_report_is_queried_again(machine, monkeypatch):
    with GrblStage(machine.port) as stage:
        assert stage.ready(homing=True).position == pytest.approx((-0.001, -0.001, -0.001))
        machine.damaged = 1
        times, _ = go(stage, (-0.02, -0.001, -0.001), 0.05)
        assert times is not None
        monkeypatch.setattr(grbl, "ANSWER", 0.2)
        machine.damaged = 1
        with pytest.raises(LinkLostError, match=r"no answer for 0\.2 s.*was stopped at x -"):
            go(stage, FAR, 0.05)
    assert machine.state == "Idle"


def test_a_speed_it_does_not_reach_and_a_second_program_are_refused(machine):
    with GrblStage(machine.port) as stage:
        stage.ready(homing=True)
        stage.check_speed(0.05, 0.12, 0)
        for speed, words in ((0.21, "up to 200 mm/s"), (0.2, "less than half of 120 mm")):
            with pytest.raises(InputError, match=words):
                stage.check_speed(speed, 0.12, 0)
        with pytest.raises(HeldError), GrblStage(machine.port):
            pass


def test_a_port_that_is_missing_or_silent_is_named(machine):
    with pytest.raises(DeviceError, match="expected a port"), GrblStage("/dev/no-such-port"):
        pass
    machine.mute = True
    with pytest.raises(DeviceError, match=r"got none in 0\.5 s"), GrblStage(machine.port, search=0.5):
        pass


@pytest.mark.parametrize("count", [3, pytest.param(20, marks=pytest.mark.slow)])
def test_random_stops_never_leave_it_moving(machine, count):
    rng = np.random.default_rng(0)
    with GrblStage(machine.port) as stage:
        for _ in range(count):
            stage.ready(homing=True)
            end = time.monotonic() + rng.uniform(0, 0.6)
            x, y, z = (float(part) * 1e-3 for part in rng.uniform(-200, -1, 3))
            go(stage, (x, y, z), 0.1, stopped=lambda end=end: time.monotonic() > end)
            assert machine.state == "Idle"


def test_status_reports_of_the_documentation():
    found = grbl.REPORT.fullmatch("<Hold:0|MPos:-2.500,0.000,11.000,4.0|FS:500,8000|Pn:PZ|WCO:0.000,1.551,5.664>")
    assert found is not None
    assert found.groups() == ("Hold:0", "-2.500", "0.000", "11.000", "|FS:500,8000|Pn:PZ|WCO:0.000,1.551,5.664")
    wrong = [
        "ok",
        "<Idle>",
        "<Idle|MPos:1,2>",
        "<Idle|MPos:a,b,c|F:0>",
        "<Idle|MPos:0,0,0",
        "<Sdle|MPos:0,0,0|F:0>",
        "",
    ]
    assert [line for line in wrong if grbl.REPORT.fullmatch(line)] == []
