"""The command mend, and import of what is clipped or folded; the rest is in tests of what they share."""

import json
from pathlib import Path

import numpy as np
import pytest
import soundfile
from tests.drives import save_drive

from midair.calibration import calibrate
from midair.cli import run
from midair.files import load, load_solution, open_take
from midair.model import TransducerArray

RNG = np.random.default_rng(0)


def test_mend_fills_gaps_that_import_refuses_and_reports_them(answer, capsys):
    samples = RNG.normal(size=(300, 4, 4))
    samples[100:104, 1, 2] = np.nan
    np.save("a.npy", samples)
    said = ("--unit", "V", "--rate", "1kHz")
    assert run(["import", "a.npy", "a.h5", *said]) == 1
    assert "midair import --mend" in capsys.readouterr().err
    told = answer("import", "a.npy", "a.h5", *said, "--mend", "20ms")
    assert "4 numbers were missing in 1 gaps" in " ".join(told["notes"])
    take = open_take("a.h5")
    assert [(row.kind, row.frame, row.frames, row.channel) for row in take.journal] == [("mended", 100, 4, 6)]
    steps = {step.stage: step.settings for step in take.recording.provenance.steps}
    assert (steps["mend"]["channel_frame_frames"], steps["events"]["mended"]) == (((6, 100, 4),), ((6, 100, 4),))
    kept = np.isfinite(samples)
    np.testing.assert_array_equal(take.recording.samples[kept], samples[kept])
    # A gap of 30 ms is refused, and leaves nothing.
    samples[100:130, 0, 3] = np.nan
    np.save("b.npy", samples)
    assert run(["import", "b.npy", "b.h5", *said, "--mend", "20ms"]) == 1
    assert "got 30 frames (30 ms) from 0.1 s on in channel 3" in capsys.readouterr().err
    assert not Path("b.h5").exists()
    assert run(["import", "b.npy", "b.h5", *said, "--mend", "30ms", "--fill", "line"]) == 0
    assert run(["import", "b.h5", "c.h5", "--mend", "20ms"]) == 1
    assert "has no gaps" in capsys.readouterr().err


def test_a_drive_is_exported_with_phases_and_levels(answer):
    array, drive = TransducerArray.autd3(columns=1, rows=1), Path("a.drive.h5")
    save_drive(drive, RNG.uniform(0, 6.28, (3, array.count)), RNG.uniform(0, 1, (3, array.count)), array=array)
    known = load_solution(drive).drive
    for name in ("a.npz", "a.json"):
        assert answer("export", str(drive), name)["written"] == name
        made = dict(np.load(name)) if name.endswith("z") else json.loads(Path(name).read_text())
        np.testing.assert_allclose(made["phase_rad"], known.phase, atol=1e-4)
        np.testing.assert_allclose(made["level"], known.level, atol=1e-4)
        np.testing.assert_allclose(made["position_m"], known.array.position)
        assert (float(made["rate_hz"]), bool(made["simulated"])) == (known.rate, known.provenance.simulated)


def test_chosen_channels_are_exported_as_flac(answer):
    np.save("a.npy", RNG.normal(size=(300, 4, 4)))
    assert run(["import", "a.npy", "a.h5", "--unit", "V", "--rate", "1kHz"]) == 0
    told = answer("export", "a.h5", "a.flac", "--channels", "9,6")
    assert "Calibration and places of the chosen channels were left out." in told["notes"]
    wanted = load("a.h5").samples.reshape(300, 16)[:, [9, 6]]
    back, full = soundfile.read("a.flac")[0], 2 ** np.ceil(np.log2(np.abs(wanted).max()))
    np.testing.assert_allclose(full * back, wanted, atol=2**-21)


def test_a_stated_peak_needs_no_unit_and_what_is_too_short_to_feel_is_noted(answer):
    np.savetxt("a.csv", np.sin(np.arange(400) / 3), header="skin")
    answer("import", "a.csv", "a.h5", "--rate", "1kHz", "--peak", "40Pa", "--footprint", "circle:20mm")
    take = open_take("a.h5")
    assert take.recording.unit == "count"
    pressure = calibrate(take.recording, take.calibration, band=(0, 500)).pressure
    assert np.abs(pressure).max() == pytest.approx(40, rel=0.05)
    soundfile.write("b.wav", RNG.normal(size=10) / 9, 4000)
    told = answer("import", "b.wav", "b.h5", "--scale", "30Pa", "--footprint", "circle:20mm")
    assert "It lasts 2.5 ms: too short to be felt; is the file complete?" in told["notes"]


def test_empty_fields_of_a_table_are_mended(capsys):
    rows = [f"{i / 100},{np.sin(i)},{'' if i in (0, 20, 21) else i}" for i in range(60)]
    Path("a.csv").write_text("time [s],a [V],b [V]\n" + "\n".join(rows) + "\n")
    words = ("a.csv", "a.h5", "--layout", "1x2:5mm")
    assert run(["import", *words]) == 1
    assert "empty field in line 2" in capsys.readouterr().err
    assert run(["import", *words, "--mend", "20ms", "--fill", "line"]) == 0
    np.testing.assert_allclose(load("a.h5").samples[1:, 0, 1], np.arange(1, 60))
    assert load("a.h5").samples[0, 0, 1] == 1
    Path("a.csv").write_text("time [s],a [V],b [V]\n,1,2\n0.1,1,2\n")
    assert run(["import", "a.csv", "b.h5", "--layout", "1x2:5mm", "--mend", "20ms"]) == 1
    assert "none in row 1" in capsys.readouterr().err


def test_a_clipped_wav_and_a_magnitude_are_named(answer):
    wave = 1.3 * np.sin(2 * np.pi * 83.7 * np.arange(4000) / 8000)
    soundfile.write("a.wav", np.clip(wave, -1, 1), 8000, subtype="PCM_16")
    assert "clipped: 0" in " ".join(answer("import", "a.wav", "a.h5", "--scale", "30Pa")["notes"])
    np.save("b.npy", np.hypot(*RNG.normal(size=(2, 4000))))
    told = answer("import", "b.npy", "b.h5", "--scale", "1Pa", "--rate", "1kHz")
    assert "magnitude" in " ".join(told["notes"])


def test_info_reports_ridges_as_real_and_felt(answer):
    told = answer("import", "sample:ridges")
    assert not told["simulated"]
    assert told["licence"] == "MIT"
    known = answer("info", "ridges.h5")["notes"]
    assert known["licence"] == "MIT"
    assert known["felt"].startswith("by about")
    assert "not measured" in known["level"]


@pytest.mark.slow
def test_metrics_report_that_some_people_would_feel_ridges(answer):
    assert run(["import", "sample:ridges"]) == 0
    assert run(["solve", "ridges.h5", "--mode", "quick"]) == 0
    assert answer("compare", "ridges.h5", "ridges.drive.h5")["verdict"]["felt"]["of_ten"] >= 3


def test_cells_that_a_footprint_passed_by_are_untouched_and_not_dead(answer, capsys):
    soundfile.write("wave.wav", 0.3 * RNG.normal(size=1300).clip(-3, 3), 1000)
    said = ["--scale", "30Pa", "--footprint", "circle:20mm", "--speed", "50mm/s"]
    told = answer("import", "wave.wav", *said)
    assert (told["untouched_cells"], told["dead_channels"]) == ([0, 1, 2, 3, 12, 13, 14, 15], [])
    assert run(["info", "wave.h5"]) == 0
    words = capsys.readouterr().out
    assert "touched  8 of 16 cells" in words
    assert "dead" not in words
