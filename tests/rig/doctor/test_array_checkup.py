import importlib.metadata
import os

import pytest

from midair.devices import autd3_array
from midair.rig.doctor import array_checkup
from midair.rig.doctor.array_checkup import array_findings, device_findings


@pytest.fixture(autouse=True)
def _state(tmp_path, monkeypatch):
    monkeypatch.setenv("MIDAIR_STATE", str(tmp_path / "state"))


def by_subject(findings):
    return {finding.subject: finding for finding in findings}


def test_packages_and_log_are_listed(tmp_path):
    found = by_subject(array_findings())
    assert {"virtual array", "autd3", "pyautd3", "network", "log of what played", "playing now"} <= set(found)
    assert str(tmp_path) in found["log of what played"].found
    assert not [each for each in found.values() if each.state == "broken"]
    assert all(each.advice for each in found.values() if each.state != "ok")


@pytest.mark.parametrize(
    ("version", "state", "word"), [(None, "missing", "not installed"), ("0.13.1", "broken", "0.12")]
)
def test_an_sdk_that_is_not_there_or_too_new(monkeypatch, version, state, word):
    def installed(package):
        if version is None:
            raise importlib.metadata.PackageNotFoundError(package)
        return version

    monkeypatch.setattr(importlib.metadata, "version", installed)
    finding = by_subject(array_findings())["autd3"]
    assert finding.state == state
    assert word in finding.found
    assert 'pip install "midair[autd3]"' in finding.advice


def test_a_log_that_cannot_be_written(tmp_path, monkeypatch):
    (tmp_path / "state" / "played.jsonl").mkdir(parents=True)
    finding = by_subject(array_findings())["log of what played"]
    assert finding.state == "broken"
    assert "MIDAIR_STATE" in finding.advice


def test_only_running_programs_play_now(tmp_path):
    (tmp_path / "state").mkdir()
    (tmp_path / "state" / "playing-1.json").write_text('{"process": 1, "device": "dead"}', encoding="utf-8")
    assert by_subject(array_findings())["playing now"].found == "nothing"
    with autd3_array("eth0").reserved():
        found = by_subject(array_findings())["playing now"].found
    assert found.startswith(f"autd3:eth0 (process {os.getpid()}, ")


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
    (finding,) = device_findings("autd9")
    assert finding.advice


@pytest.mark.parametrize(
    ("key", "well", "unwell"),
    [
        ("firmware", "0.12.0/0.12.0", "0.11.0/0.11.0, but the SDK supports 0.12"),
        (
            "link",
            "19 frames, worst answer 2 ms, 0 heartbeats missed",
            "19 frames, worst answer 2 ms, 10 heartbeats missed",
        ),
        ("failsafe", "it acted 0 times", "it acted 10 times"),
        ("temperature", "fine", "too hot"),
    ],
)
def test_reports_are_judged(key, well, unwell):
    (sound,), (finding,) = (array_checkup.report_findings("x", {key: said}) for said in (well, unwell))
    assert sound.state == "ok"
    assert finding.state == "broken"
    assert finding.advice
