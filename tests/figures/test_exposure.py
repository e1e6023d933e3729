import numpy as np

from midair.figures import exposure_figure, png_bytes
from midair.files import profile_named
from midair.model import Drive, TransducerArray
from midair.physics import exposure

ARRAY = TransducerArray.autd3(columns=1, rows=1)


def test_every_place_has_its_line_and_its_limit():
    drive = Drive(
        phase=np.random.default_rng(0).uniform(0, 6, (50, ARRAY.count)),
        level=np.repeat([0.0, 1.0], 25),
        rate=1000.0,
        array=ARRAY,
    )
    found = exposure(drive, profile_named("occupational-110"))
    figure = exposure_figure(found, simulated=True)
    (axis,) = figure.axes
    assert len(axis.lines) == 8
    assert "dB" in axis.get_ylabel()
    assert "(s)" in axis.get_xlabel()
    drawn = axis.lines[0].get_ydata()
    assert np.isnan(drawn[:25]).all()
    np.testing.assert_allclose(drawn[25:], found.level[25:, 0])
    assert any(text.get_text() == "SIMULATED" for text in figure.texts)
    assert png_bytes(figure).startswith(b"\x89PNG")
