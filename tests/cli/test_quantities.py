import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.cli.options import format_quantity, parse_quantity


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("200mm", "m", 0.2),
        ("11 mm", "m", 0.011),
        ("0.2m", "m", 0.2),
        ("20Hz", "Hz", 20),
        ("1kHz", "Hz", 1000),
        ("500ms", "s", 0.5),
        (".5s", "s", 0.5),
        ("30Pa", "Pa", 30),
        ("20mV/Pa", "V/Pa", 0.02),
        ("2count/Pa", "count/Pa", 2),
        ("50mm/s", "m/s", 0.05),
        ("-0.5s", "s", -0.5),
        ("22C", "C", 22),
        ("22", "C", 22),
        ("21.5 °C", "C", 21.5),
        ("295.15K", "C", 22),
        ("71.6F", "C", 22),
        ("-3C", "C", -3),
        ("2C", "K", 2),
        ("2K", "K", 2),
        ("3.6F", "K", 2),
        ("50%", "%", 0.5),
        ("12.5 %", "%", 0.125),
    ],
)
def test_reads(text, unit, value):
    assert parse_quantity(text, unit) == pytest.approx(value)


@pytest.mark.parametrize(
    "text", ["200", "200Pa", "", "mm", "abc", "200 furlongsx", "nan m", "inf m", "1e999m", "()", "2m+"]
)
def test_refuses_with_an_example(text):
    with pytest.raises(ValueError, match="200mm"):
        parse_quantity(text, "m")


@given(st.floats(1e-3, 1e3))
def test_printed_quantities_can_be_parsed(value):
    assert parse_quantity(format_quantity(value, "m"), "m") == pytest.approx(value, rel=1e-5)


@given(st.text(max_size=12))
def test_any_text_is_read_or_refused(text):
    refused = None
    try:
        parse_quantity(text, "m")
    except ValueError as wrong:
        refused = str(wrong)
    assert refused is None or "expected a quantity" in refused


@pytest.mark.parametrize(
    ("text", "unit", "says"),
    [
        ("22", "K", "got '22'; add the unit"),
        ("22mm", "C", "possible units: C, °C, K, F"),
        ("2m", "K", "such as 2C"),
        ("0.5", "%", "such as 50%"),
        ("50C", "%", "such as 50%"),
        ("1e999C", "C", "finite"),
    ],
)
def test_temperatures_and_shares_are_refused_with_an_example(text, unit, says):
    with pytest.raises(ValueError, match=says):
        parse_quantity(text, unit)


@pytest.mark.parametrize("unit", ["C", "K", "%"])
@given(value=st.floats(0, 50))
def test_a_temperature_or_a_share_that_is_shown_can_be_read(value, unit):
    assert parse_quantity(format_quantity(value, unit), unit) == pytest.approx(value, rel=1e-5, abs=1e-9)
