import sys

import numpy as np
import pytest
from tests.palms import palm_path

import midair
from midair.devices import SensorOptions, Stream
from midair.errors import InputError, MissingExtraError, UnknownDeviceError
from midair.files import save_palm_path
from midair.model import PalmPath, SensorGrid, SensorWiring, TrackerPlacement
from midair.rig.names.sensor_names import VirtualRig, source_sensor, split_name


def test_names_come_apart(subtests):
    for name, parts in [
        ("lsl:Skin", ("lsl", "Skin", {})),
        ("lsl:Skin?unit=V&counter=16", ("lsl", "Skin", {"unit": "V", "counter": "16"})),
        ("serial:/dev/ttyUSB0?baud=2000000", ("serial", "/dev/ttyUSB0", {"baud": "2000000"})),
        ("ni:Dev1/ai0:15", ("ni", "Dev1/ai0:15", {})),
        ("audio:", ("audio", "", {})),
        ("audio:?channels=2", ("audio", "", {"channels": "2"})),
        ("lsl:Who? Me", ("lsl", "Who? Me", {})),
        ("audio:USB (hw:1,0)?rate=1000", ("audio", "USB (hw:1,0)", {"rate": "1000"})),
        ("lsl:a?b?unit=V", ("lsl", "a?b", {"unit": "V"})),
        ("lsl:x?source_id=a=b", ("lsl", "x", {"source_id": "a=b"})),
    ]:
        with subtests.test(name=name):
            assert split_name(name) == parts


def test_options_that_make_no_sense_are_one_clear_line(subtests):
    for name, complaint in [
        ("lsl:Skin?units=V", "expected the options unit, .*source_id, counter, search, got units"),
        ("lsl:Skin?baud=3", "got baud"),
        ("lsl:Skin?unit=mV", "option unit: expected V, count, Pa, got 'mV'"),
        ("audio:USB?channels=none", "option channels: .*, got 'none'"),
        ("audio:USB?rate=-1", "option rate: expected above 0 Hz, got -1 Hz"),
        ("serial:COM3?baud=0", "option baud: expected above 0, got 0"),
    ]:
        with subtests.test(name=name):
            with pytest.raises(InputError, match=complaint) as told:
                source_sensor(name)
            assert "\n" not in str(told.value)


class NoSource(SensorOptions):
    def source(self, place):
        raise UnknownDeviceError(place)


def test_options_override_the_sensor_file_and_that_the_stream():
    stream = Stream(channels=16, rate=1000.0, unit="V")
    file = SensorWiring(grid=SensorGrid(name="palm"), order=tuple(range(15, -1, -1)), unit="V", sensitivity=0.02)
    assert NoSource().wire(stream, None, "lsl:x") == SensorWiring(grid=SensorGrid(name="lsl:x"), unit="V")
    assert NoSource().wire(stream, file, "lsl:x") == file
    stated = NoSource(unit="Pa", pitch_mm=5.0, sensitivity=1.0).wire(stream, file, "x")
    assert (stated.unit, stated.grid.pitch, stated.sensitivity, stated.order) == ("Pa", 5e-3, 1.0, file.order)
    other = NoSource(rows=2, columns=8).wire(stream, file, "x")
    assert (other.grid.shape, other.order) == ((2, 8), tuple(range(16)))


@pytest.mark.parametrize(
    ("kind", "package"), [("lsl", "pylsl"), ("audio", "sounddevice"), ("serial", "serial"), ("ni", "nidaqmx")]
)
def test_a_package_that_is_not_installed_names_its_extra(kind, package, monkeypatch):
    for module in [name for name in sys.modules if name.startswith("midair.devices.") and name.endswith(f".{kind}")]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.delitem(sys.modules, "midair.devices.sensors.serial_port", raising=False)
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingExtraError, match=rf'expected the package {package}.*pip install "midair\[{kind}\]"'):
        source_sensor(f"{kind}:x")


@pytest.fixture
def hand(tmp_path):
    times = np.arange(100) / 100
    centre = np.column_stack([0.1 * times, 0 * times, 0.2 + 0 * times])
    save_palm_path(palm_path(times, centre), tmp_path / "hand.csv")
    return tmp_path / "hand.csv"


def test_a_replayed_pose_arrives_after_its_latency_and_has_the_time_of_the_pose(hand):
    now = [50.0]
    placed = TrackerPlacement(offset=[0, 0, 0.05])
    with midair.open_tracker(f"replay:{hand}?latency_ms=20", placement=placed, clock=lambda: now[0]) as tracker:
        tracker.begin(60.0)
        now[0] = 60.0195
        assert tracker.newest() is None
        now[0] = 60.5205
        newest = tracker.newest()
        assert newest.time[0] == pytest.approx(60.5)
        np.testing.assert_allclose(newest.centre, [[0.05, 0, 0.25]])
        assert len(tracker.poses(since=60.405).time) == 10
        now[0] = 60.6
        assert tracker.status().age == pytest.approx(0.02)
        now[0] = 62.0
        assert tracker.status().state == "waiting"
        assert tracker.events() == []
    with midair.open_tracker(f"replay:{hand}", clock=lambda: now[0]) as tracker:
        now[0] += 9.0
        assert (tracker.status().poses, tracker.status().state) == (100, "waiting")


def test_a_palm_that_faces_away_from_the_array_is_not_re_recorded():
    away = palm_path(np.arange(3) / 100, np.tile([0, 0, 0.2], (3, 1)), tilt=2.0)
    with pytest.raises(InputError, match=r"faces away from the array at 0 s.*\(0, 0, -1\)"):
        VirtualRig(palm=away)


def test_replayed_poses_are_checked_as_live_ones(tmp_path):
    rows = np.array([[n / 100, 1e-4 * n, 0, 0.2, 0, 0, -1, 0, 1, 0, 1] for n in range(100)])
    rows[20:25, 1] += 1.0
    rows[60:, 1] = 0.006
    save_palm_path(PalmPath.from_rows(rows), tmp_path / "faulty.csv")
    now = [0.0]
    with midair.open_tracker(f"replay:{tmp_path / 'faulty.csv'}?freeze=0.1", clock=lambda: now[0]) as tracker:
        now[0] = 0.995
        status = tracker.status()
        assert (status.state, status.refused) == ("frozen", {"jump": 5, "frozen": 29})
        assert len(tracker.events()) == 2
