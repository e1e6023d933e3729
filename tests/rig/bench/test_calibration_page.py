from dataclasses import replace

import numpy as np
import pytest

from midair.calibration import measure_calibration
from midair.calibration.measure.referenced_take import noise_signal
from midair.dsp import resample
from midair.errors import InputError, MismatchError, UnitError
from midair.files import save
from midair.model import Recording, SensorGrid
from midair.physics import SensorModel
from midair.rig.bench.calibration_page import (
    CalibrationBench,
    ReferenceChoice,
    calibration_rows,
    read_takes,
    write_calibration_page,
)


@pytest.fixture(scope="module")
def measured():
    bench = CalibrationBench(
        model=SensorModel(grid=SensorGrid(rows=2, columns=2, name="palm 3")), reference_uncertainty=0.01
    )
    rng = np.random.default_rng(0)
    takes = [bench.take(noise_signal(level, 8, rng=rng), number=level) for level in (1, 2, 4, 8, 16)]
    takes += [bench.take(noise_signal(8, 8, rng=rng), cell=cell) for cell in range(4)]
    return measure_calibration(takes, quiet=bench.quiet(8), date="2026-01-31", version=2)


def test_the_rows_have_the_main_figures(measured):
    rows = dict(calibration_rows(measured))
    assert rows["identifier"] == f"{measured.identifier}, version 2, 2026-01-31"
    assert rows["uncertainty"].startswith("± 2 % of the response (k = 2, median over 20 to 470 Hz), 2 % of it shared")
    # 20 uV/sqrt(Hz) and the converter's steps over about 20 mV/Pa in 450 Hz
    assert rows["noise-equivalent pressure"].startswith("22")
    assert rows["linearity"].startswith("5 levels")
    assert "crosstalk" in rows


@pytest.mark.long
def test_the_page_holds_every_channel_with_uncertainties(measured, tmp_path):
    write_calibration_page(measured, tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]
    assert "SIMULATED" in page
    assert page.count('<tr><td class="n">') == 4
    assert page.count("±") > 4 * 5
    assert "data:image/png;base64," in page
    assert "http" not in page


CHOICE = ReferenceChoice(sensitivity=50e-3, uncertainty=0.01, name="force cell 7")


@pytest.fixture
def lab(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    bench = CalibrationBench()
    recording, reference = bench.recordings(noise_signal(5, 8, rng=np.random.default_rng(0)))
    save(recording, tmp_path / "a.h5")
    save(reference, tmp_path / "ref.h5")
    return bench, recording, reference, tmp_path


def take_of(folder, choice=CHOICE, reference="ref.h5", **options):
    takes, notes = read_takes([folder / "a.h5"], [folder / reference] if reference else [], choice, **options)
    return takes[0], notes


def test_a_pair_of_files_is_a_take(lab):
    _, recording, reference, folder = lab
    take, notes = take_of(folder)
    assert notes == []
    assert (take.recording.samples == recording.samples).all()
    assert take.reference.pressure == pytest.approx(reference.samples.ravel() / 50e-3)
    assert (take.reference.uncertainty, take.reference.name, take.cell) == (0.01, "force cell 7", None)
    assert take.recording.provenance.source == "a.h5"
    assert take_of(folder, cells=[3])[0].cell == 3
    with pytest.raises(UnitError, match="--reference-sensitivity 50mV/Pa"):
        take_of(folder, ReferenceChoice())
    save(replace(reference, unit="Pa"), folder / "ref.h5")
    assert take_of(folder, ReferenceChoice())[0].reference.pressure == pytest.approx(reference.samples.ravel())
    save(replace(reference, samples=reference.samples[:-20]), folder / "ref.h5")
    take, notes = take_of(folder)
    assert take.recording.frames == 7980
    assert "cut to 7980 frames" in notes[0]
    save(replace(reference, samples=reference.samples[:-800]), folder / "ref.h5")
    with pytest.raises(MismatchError, match=r"8\.000 s, got 7\.200 s"):
        take_of(folder)


def test_the_notes_say_which_cell(lab):
    bench, _, _, folder = lab
    recording, reference = bench.recordings(noise_signal(5, 8, rng=np.random.default_rng(0)), cell=7)
    save(recording, folder / "a.h5")
    save(reference, folder / "ref.h5")
    assert take_of(folder)[0].cell == 7
    odd = replace(recording, provenance=replace(recording.provenance, notes={"pressed": "the corner"}))
    save(odd, folder / "a.h5")
    with pytest.raises(InputError, match="'the corner'; give --cell"):
        take_of(folder)


def test_a_reference_on_a_spare_channel_equals_a_file(lab):
    _, recording, reference, folder = lab
    both = np.concatenate([recording.samples.reshape(-1, 16), reference.samples.reshape(-1, 1)], axis=1)
    sensor = SensorGrid(rows=1, columns=17, name="box")
    save(Recording(samples=both[:, None], rate=1000.0, sensor=sensor), folder / "a.h5")
    take, _ = take_of(folder, replace(CHOICE, channel=16), None)
    assert take.recording.sensor.shape == (4, 4)
    assert take.reference.pressure == pytest.approx(reference.samples.ravel() / 50e-3)


def test_a_reference_of_another_rate_is_resampled_and_gives_the_same(lab):
    _, _, reference, folder = lab
    finer = resample(reference.samples, 1000.0, 4000.0)
    save(replace(reference, samples=finer, rate=4000.0), folder / "fine.h5")
    take, notes = take_of(folder, reference="fine.h5")
    assert len(notes) == 1
    assert "4000 to 1000 Hz" in notes[0]
    once, again = measure_calibration([take_of(folder)[0]]), measure_calibration([take])
    band = np.linspace(25, 450, 50)
    assert again.response_at(band) == pytest.approx(once.response_at(band), rel=0.01)
