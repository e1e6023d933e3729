import pytest

from midair.files.importers.header import known_unit


@pytest.mark.parametrize(
    ("text", "unit", "factor"),
    [
        ("V", "V", 1),
        (" Volts ", "V", 1),
        ("mV", "V", 1e-3),
        ("microvolts", "V", 1e-6),
        ("µV", "V", 1e-6),
        ("Pa", "Pa", 1),
        ("kPa", "Pa", 1e3),
        ("counts", "count", 1),
        ("m/s^2", None, 1),
        ("", None, 1),
    ],
)
def test_spellings(text, unit, factor):
    assert known_unit(text) == (unit, factor)
