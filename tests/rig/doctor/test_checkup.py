import numpy as np
import pytest

from midair.devices import StreamedSensor
from midair.devices.sensors.sources import Chunk, Source, Stream
from midair.errors import DeviceError, MissingExtraError
from midair.registry import Registry
from midair.rig.doctor import checkup
from midair.rig.doctor.array_checkup import Check
from midair.rig.doctor.checkup import live_sensor_findings, run_checks, sensor_findings


@pytest.mark.long
def test_the_test_machine_passes_all_checks(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    findings = run_checks()
    assert [finding.subject for finding in findings if finding.state == "broken"] == []
    assert {"Python", "numpy", "field model", "solver", "this folder"} <= {finding.subject for finding in findings}
    assert list(tmp_path.iterdir()) == []


@pytest.mark.long
def test_each_problem_gives_advice(tmp_path, monkeypatch):
    import importlib.metadata

    real = importlib.metadata.version

    def missing(name):
        if name == "scipy":
            raise importlib.metadata.PackageNotFoundError(name)
        return real(name)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(importlib.metadata, "version", missing)
    broken = [finding for finding in run_checks() if finding.state == "broken"]
    assert [finding.subject for finding in broken] == ["scipy"]
    assert all(finding.advice for finding in broken)


def test_every_kind_of_sensor_is_checked_without_an_error():
    found = {finding.subject: finding for finding in sensor_findings()}
    assert set(found) == {"virtual sensor", "lsl: sensors", "audio: sensors", "serial: sensors", "ni: sensors"}
    assert all(finding.state != "broken" and (finding.state == "ok" or finding.advice) for finding in found.values())


@pytest.mark.parametrize(
    ("wrong", "found", "advice"),
    [
        (
            MissingExtraError(
                'audio: expected the package sounddevice, it is not installed; pip install "midair[audio]"'
            ),
            "audio: expected the package sounddevice, it is not installed",
            'pip install "midair[audio]" if you have such a sensor',
        ),
        (
            DeviceError("audio: expected the library PortAudio (Debian: apt-get install libportaudio2)"),
            "audio: expected the library PortAudio (Debian: apt-get install libportaudio2)",
            "only needed if you have such a sensor",
        ),
    ],
)
def test_a_missing_package_gives_advice(wrong, found, advice, monkeypatch):
    class Missing(Registry):
        def __getitem__(self, name):
            raise wrong

    monkeypatch.setattr(checkup, "SENSORS", Missing("none", {"audio": "nothing:at_all"}))
    (audio,) = [finding for finding in sensor_findings() if finding.subject == "audio: sensors"]
    assert (audio.state, audio.found, audio.advice) == ("missing", found, advice)


class Sick(Source):
    def open(self):
        return Stream(channels=4, rate=1000.0, unit="V", full_scale=2.0)

    def start(self):
        self.given = False

    def pull(self, wait):
        if self.given:
            return None
        self.given = True
        samples = np.random.default_rng(0).uniform(-1, 1, (500, 4))
        samples[:, 1] = 0.25
        samples[7, 2] = -2.0
        return Chunk(samples=samples, first=0, device_time=0.0, host_time=0.0)

    def describe(self):
        return {"port": "COM3"}


def test_a_live_sensor_is_read(monkeypatch):
    for slow in ("_folder", "_field", "_solver", "_threads"):
        monkeypatch.setattr(checkup, slow, lambda: Check(subject="left out", state="ok", found=""))
    monkeypatch.setattr(checkup, "source_sensor", lambda name, wiring: StreamedSensor(Sick(), name=name))
    found = {finding.subject.removeprefix("serial:COM3: "): finding for finding in run_checks("serial:COM3")}
    assert (found["cells that never change"].state, found["cells that never change"].found) == ("broken", "1")
    assert (found["cells that clip"].state, found["cells that clip"].found) == ("broken", "2")
    assert found["port"].found == "COM3"
    assert found["lost frames"].found == "0"
    assert found["samples"].found.startswith("-2 to ")


def test_a_missing_live_sensor_is_one_broken_check():
    pytest.importorskip("serial")
    (finding,) = live_sensor_findings("serial:/dev/nothing")
    assert (finding.subject, finding.state) == ("serial:/dev/nothing", "broken")
    assert finding.found.startswith("serial: expected a port /dev/nothing")
    assert finding.advice.startswith("ports here:")
