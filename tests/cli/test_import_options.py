import io
from pathlib import Path

import numpy as np
import pytest
import soundfile

from midair.cli import run
from midair.cli.console import PlainConsole
from midair.evaluate import felt
from midair.files import load, load_calibration, load_pressure, save
from midair.model import Calibration, PressureFrames, Provenance, Recording, SensorGrid
from midair.recordings.footprint import Footprint, covered


@pytest.fixture(autouse=True)
def wave():
    """A sweep of two seconds in one channel at 2 kHz, full scale."""
    time = np.arange(4000) / 2000
    samples = 0.5 * np.sin(2 * np.pi * (50 + 40 * time) * time)
    soundfile.write("towel.wav", samples, 2000, subtype="DOUBLE")
    return samples


def test_one_channel_becomes_a_field(wave, answer, capsys):
    words = "--scale 30Pa --footprint circle:20mm --speed 50mm/s"
    told = answer("import", "towel.wav", "towel.h5", *words.split())
    assert told["simulated"] is True
    text = " ".join(told["notes"])
    assert "synthetic field from one channel" in text
    assert "It has left the palm after 1.28 of 2 s" in text
    recording = load("towel.h5")
    share = covered(Footprint(), SensorGrid(), recording.time)
    np.testing.assert_allclose(recording.samples, 30 * wave[:, None, None] * share, atol=1e-12)
    assert recording.unit == "Pa"
    assert recording.provenance.simulated
    assert [step.stage for step in recording.provenance.steps] == ["import", "footprint"]
    assert run(["info", "towel.h5"]) == 0
    assert "SIMULATED" in capsys.readouterr().out


def test_every_word_of_the_footprint_counts(wave, answer):
    words = ["--footprint", "line:5mm", "--speed", "-80mm/s", "--path", "diagonal", "--turn", "back"]
    told = answer("import", "towel.wav", "a.h5", "--unit", "V", "--layout", "2x3:8mm", "--resample", "1kHz", *words)
    assert "leaves the sensor" not in " ".join(told["notes"])
    recording = load("a.h5")
    sensor = SensorGrid(rows=2, columns=3, pitch=8e-3)
    assert (recording.sensor, recording.rate, recording.unit) == (sensor, 1000, "V")
    footprint = Footprint(shape="line", size=5e-3, speed=-80e-3, path="diagonal", turn="back")
    share = covered(footprint, sensor, recording.time)
    assert (recording.samples[share == 0] == 0).all()
    full = share > 0.5
    full[recording.time > 1.95] = False  # the waveform stops abruptly: resampling rings there
    ratio = recording.samples[full] / share[full]
    time = np.broadcast_to(recording.time[:, None, None], share.shape)[full]
    np.testing.assert_allclose(ratio, 0.5 * np.sin(2 * np.pi * (50 + 40 * time) * time), atol=0.01)


def test_a_felt_level_follows_from_the_model_of_skin_and_a_fast_sound_is_resampled(answer):
    soundfile.write("fast.wav", 0.4 * np.sin(2 * np.pi * 150 * np.arange(24000) / 48000), 48000)
    still = ["--footprint", "circle:20mm", "--speed", "0mm/s"]
    for word, people in (("soft", 5), ("medium", 8), ("strong", 9)):
        told = answer("import", "fast.wav", f"{word}.h5", "--felt", word, *still)
        made = load(f"{word}.h5")
        assert (made.rate, felt(made.samples, made.rate, made.sensor.pitch).people[0]) == (4000, people)
    assert "Keep the file's: --resample 48000Hz" in " ".join(told["notes"])
    answer("import", "fast.wav", "whole.h5", "--unit", "V", "--resample", "48kHz", *still)
    assert load("whole.h5").rate == 48000


def test_an_accelerometer_needs_a_stated_scale(capsys):
    Path("imu.csv").write_text("time_ms, accel_x, accel_y,\n0,1,2,\n10,3,5,\n20,4,5,\n", encoding="utf-8")
    assert run(["import", "imu.csv", "a.h5", "--channels", "accel_y"]) == 1
    assert "--scale 1Pa, the pressure of the value 1" in capsys.readouterr().err
    assert run(["import", "imu.csv", "a.h5", "--channels", "accel_y", "--scale", "2Pa"]) == 0
    np.testing.assert_array_equal(load("a.h5").samples.ravel(), [4, 10, 10])
    assert load("a.h5").rate == 100


def test_a_field_needs_one_channel_and_the_layout_places_several(capsys):
    Path("imu.csv").write_text("time [s],a [V],b [V]\n0,1,2\n1,3,5\n", encoding="utf-8")
    words = ["import", "imu.csv", "a.h5", "--footprint", "circle:5mm"]
    assert run(words) == 1
    assert "2 channels (a [V], b [V])" in capsys.readouterr().err
    assert run([*words, "--channels", "1"]) == 0
    assert load("a.h5").sensor.count == 16
    soundfile.write("six.wav", np.arange(12).reshape(2, 6) / 16, 1000, subtype="DOUBLE")
    assert run(["import", "six.wav", "b.h5", "--unit", "V", "--layout", "2x3:5mm"]) == 0
    np.testing.assert_array_equal(load("b.h5").samples, np.arange(12).reshape(2, 2, 3) / 16)
    assert load("b.h5").sensor.pitch == 5e-3


def test_export_prints_a_line_for_every_loss(answer, capsys):
    samples = np.random.default_rng(0).normal(size=(300, 4, 4))
    recording = Recording(samples=samples, rate=1000, provenance=Provenance(source="bench"))
    pressure = PressureFrames(pressure=50 * samples, rate=1000, sensor=recording.sensor)
    save(recording, "take.h5", calibration=Calibration.flat(recording.sensor, sensitivity=0.02), pressure=pressure)
    rest = {"provenance", "calibration", "pressure"}
    for ending, known in {"h5": set(), "csv": rest, "npz": rest, "wav": None, "mat": None}.items():
        told = answer("export", "take.h5", f"out.{ending}")
        assert run(["export", "take.h5", f"out.{ending}", "--force"]) == 0
        printed = " ".join(capsys.readouterr().out.split())
        assert [loss["text"] for loss in told["lost"] if f"lost {loss['text']}" not in printed] == [], ending
        lost = {loss["what"] for loss in told["lost"]}
        assert lost == known if known is not None else lost >= {"calibration", "pressure"}, ending
        if known is not None:
            np.testing.assert_array_equal(load(f"out.{ending}").samples, samples)
    told = answer("export", "take.h5", "pressure.csv", "--pressure")
    assert ([loss["what"] for loss in told["lost"]], load("pressure.csv").unit) == (["provenance"], "Pa")
    np.testing.assert_allclose(load("pressure.csv").samples, 50 * samples)
    # A file of midair is imported and exported with its calibration and pressure.
    assert run(["import", "take.h5", "again.h5"]) == 0
    assert load_calibration("again.h5") is not None
    for name in ("again.h5", "out.h5"):
        np.testing.assert_array_equal(load_pressure(name).pressure, 50 * samples)


def test_a_terminal_is_asked_for_what_the_file_lacks(monkeypatch, capsys):
    Path("five.csv").write_text("a,b,c,d,e\n" + "1,2,3,4,5\n2,3,4,5,6\n" * 30)
    answers = io.StringIO("\nloud\n30Pa\n3\n")
    monkeypatch.setattr(answers, "isatty", lambda: True, raising=False)
    monkeypatch.setattr("sys.stdin", answers)
    monkeypatch.setattr(PlainConsole, "is_terminal", True)
    assert run(["import", "five.csv", "five.h5"]) == 0
    shown = capsys.readouterr().err
    assert "The file does not state its frame rate.\nFrame rate [1000Hz]: " in shown
    assert "expected a quantity such as 30Pa, got 'loud'" in shown
    recording = load("five.h5")
    assert (recording.rate, recording.unit, recording.samples[1, 0, 0]) == (1000, "Pa", 150)
    monkeypatch.setattr(answers, "isatty", lambda: False)
    assert run(["import", "five.csv", "six.h5"]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    for part in ("frame rate; give --rate 1000Hz;", "the unit of its samples; give --unit V", "give --channels 0"):
        assert part in line
