import numpy as np
import pytest

from midair.calibration import measure_calibration
from midair.calibration.measure.referenced_take import noise_signal
from midair.errors import UnknownFormatError
from midair.model import Calibration, SensorGrid
from midair.physics import SensorModel
from midair.rig.bench.calibration_page import CalibrationBench, calibration_rows, write_calibration_page


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


def test_a_stated_calibration_has_unknown_uncertainty():
    rows = dict(calibration_rows(Calibration.flat(SensorGrid(), sensitivity=2.0, unit="count")))
    assert rows["uncertainty"] == "unknown: stated, not measured"
    assert "reference" not in rows


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


def test_another_ending_is_refused(measured, tmp_path):
    with pytest.raises(UnknownFormatError, match=r"\.png or \.html"):
        write_calibration_page(measured, tmp_path / "page.pdf")
    assert not list(tmp_path.iterdir())
