import numpy as np
import pytest
from tests.devices.sensors.test_streamed_sensor import Script

from midair.devices import StreamedSensor
from midair.devices.sensors.sources import Chunk
from midair.errors import DeviceError, MissingExtraError, UnknownDeviceError
from midair.registry import Registry
from midair.rig.doctor import checkup
from midair.rig.doctor.checkup import Check, device_findings, live_sensor_findings, readiness, run_checks


def by_subject(findings):
    return {finding.subject: finding for finding in findings}


@pytest.fixture
def quick(monkeypatch):
    """Without the solve, which takes most of the time."""
    monkeypatch.setattr(checkup, "_solver", lambda: Check(subject="solve", state="ok", found="", use="solving"))


def test_this_machine_passes_all_checks(quick, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    findings = run_checks()
    assert [finding.subject for finding in findings if finding.state == "broken"] == []
    assert all(finding.advice for finding in findings if finding.state != "ok")
    expected = {"Python", "libraries", "solve", "this folder", "log of what played", "autd3", "numba"}
    assert expected | {"lsl: sensors", "audio: sensors", "serial: sensors", "ni: sensors"} <= set(by_subject(findings))
    assert readiness(findings).startswith("ready for files, solving, ")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.long
def test_the_solve_of_one_point_is_good():
    assert checkup._solver().state == "ok"


def test_what_is_missing_or_too_new_gives_advice_and_ends_the_last_line(quick, tmp_path, monkeypatch):
    import importlib.metadata

    real = importlib.metadata.version

    def version(name):
        if name in ("scipy", "numba"):
            raise importlib.metadata.PackageNotFoundError(name)
        return "0.13.1" if name == "autd3" else real(name)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(importlib.metadata, "version", version)
    findings = run_checks()
    found = by_subject(findings)
    assert (found["libraries"].state, found["libraries"].advice) == ("broken", "pip install scipy")
    assert (found["numba"].state, found["autd3"].state) == ("missing", "broken")
    assert "0.12" in found["autd3"].found
    assert 'pip install "midair[autd3]"' in found["autd3"].advice
    last = readiness(findings)
    assert "live touch" in last.partition("missing: ")[2].partition(";")[0]
    assert last.endswith("broken: libraries, autd3")


def test_a_missing_package_of_a_sensor_gives_advice(monkeypatch):
    package = MissingExtraError(
        'audio: expected the package sounddevice, it is not installed; pip install "midair[audio]"'
    )
    library = DeviceError("audio: expected the library PortAudio (Debian: apt-get install libportaudio2)")
    for wrong, found, advice in (
        (package, "audio: expected the package sounddevice, it is not installed", 'pip install "midair[audio]" if you'),
        (library, str(library), "only needed if you have such a sensor"),
    ):

        class Missing(Registry):
            def __getitem__(self, name, wrong=wrong):
                raise wrong

        monkeypatch.setattr(checkup, "SENSORS", Missing("none", {"audio": "nothing:at_all"}))
        audio = checkup._kind("audio")
        assert (audio.state, audio.found) == ("missing", found)
        assert audio.advice.startswith(advice)


@pytest.mark.long
@pytest.mark.parametrize(("name", "package"), [("autd3:emulator", "autd3"), ("pyautd3:audit", "pyautd3")])
def test_a_device_describes_itself(name, package):
    pytest.importorskip(package)
    found = by_subject(device_findings(name))
    assert "4 answer" in found[f"{name}: units"].found
    assert "mulator" in found[f"{name}: firmware"].found
    assert f"{name}: failsafe" in found
    assert not [each for each in found.values() if each.state == "broken"]


def test_a_missing_device_gives_advice():
    pytest.importorskip("autd3")
    (finding,) = device_findings("autd3:[::1]:9")
    assert finding.state == "broken"
    assert "power" in finding.advice
    with pytest.raises(UnknownDeviceError, match="did you mean autd3"):
        device_findings("autd9")


def test_a_live_sensor_is_read(monkeypatch):
    samples = np.random.default_rng(0).uniform(-1, 1, (500, 4))
    samples[:, 1], samples[7, 2] = 0.25, -2.0
    sick = Script([Chunk(samples=samples, first=0, device_time=0.0, host_time=0.0)], unit="V", full_scale=2.0)
    sick.describe = lambda: {"port": "COM3"}
    monkeypatch.setattr(checkup, "source_sensor", lambda name: StreamedSensor(sick, name=name))
    found = {each.subject.removeprefix("serial:COM3: "): each for each in live_sensor_findings("serial:COM3")}
    assert (found["cells that never change"].state, found["cells that never change"].found) == ("broken", "1")
    assert (found["cells that clip"].state, found["cells that clip"].found) == ("broken", "2")
    assert found["port"].found == "COM3"
    assert found["lost frames"].found == "0"
    assert found["samples"].found.startswith("-2 to ")
