"""Quantities on the command line: a number with a unit, such as 200mm, 20Hz or .5s."""

import math
import re
from collections.abc import Mapping, Sequence
from functools import cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from cyclopts import Parameter, Token

if TYPE_CHECKING:
    import pint

EXAMPLES = {
    "m": "200mm",
    "Hz": "20Hz",
    "s": "0.5s",
    "Pa": "30Pa",
    "count/Pa": "2count/Pa",
    "m/s": "50mm/s",
    "C": "22C",
    "K": "2C",
    "%": "50%",
    "dB": "110dB",
}
"""Example of each unit for messages and help; K is a temperature difference."""

_BY_HAND: Mapping[str, Mapping[str, tuple[float, float]]] = MappingProxyType(
    {
        "C": {"C": (1, 0), "°C": (1, 0), "K": (1, -273.15), "F": (5 / 9, -160 / 9), "°F": (5 / 9, -160 / 9)},
        "K": {"C": (1, 0), "°C": (1, 0), "K": (1, 0), "F": (5 / 9, 0), "°F": (5 / 9, 0)},
        "%": {"%": (0.01, 0)},
        "dB": {"dB": (1, 0)},
    }
)
"""Factor and offset of units that pint reads differently: C is coulomb, F is farad, % is unknown."""


def parse_quantity(text: str, unit: str) -> float:
    """Value in `unit` of a text such as ``200mm``; ValueError without a suitable unit or number."""
    advice = f"expected a quantity such as {EXAMPLES.get(unit, '1' + unit)}, got {text!r}"
    parts = re.fullmatch(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([A-Za-zµ°%]*(?:/[A-Za-zµ]+)?)\s*", text)
    if parts is None:
        raise ValueError(advice)
    written = parts[2] or ("C" if unit == "C" else "")  # A temperature is in degrees Celsius.
    if not written:
        raise ValueError(f"{advice}; add the unit")
    if unit in _BY_HAND:
        if written not in _BY_HAND[unit]:
            raise ValueError(f"{advice}; possible units: {', '.join(_BY_HAND[unit])}")
        factor, offset = _BY_HAND[unit][written]
        value = factor * float(parts[1]) + offset
        if not math.isfinite(value):
            raise ValueError(f"{advice}; it must be finite")
        return value
    # The import of pint takes a quarter of a second.
    prefix = {"": 1.0, "k": 1e3, "m": 1e-3}.get(written.removesuffix(unit)) if written.endswith(unit) else None
    try:
        value = float(parts[1]) * (prefix or float(_units().Quantity(1.0, written).to(unit).magnitude))
    # All errors of pint are one of these.
    except TypeError:
        raise ValueError(f"{advice}; the unit measures another quantity") from None
    except (AttributeError, ValueError):
        raise ValueError(f"{advice}; unknown unit") from None
    if not math.isfinite(value):
        raise ValueError(f"{advice}; it must be finite")
    return value


def quantity(unit: str, *, many: int | None = None) -> Parameter:
    """A command-line parameter that reads `many` quantities (None: one, -1: any number), its default in `unit`."""

    def convert(_: Any, tokens: Sequence[Token]) -> float | tuple[float, ...]:
        values = tuple(_value(token.value, unit) for token in tokens)
        return values if many else values[0]

    def show(value: float | tuple[float, ...] | None) -> str | None:
        if value is None:
            return None
        return " ".join(format_quantity(each, unit) for each in (value if isinstance(value, tuple) else (value,)))

    return Parameter(converter=convert, show_default=show, n_tokens=many or 1, metavar="QUANTITY")


def _value(text: str, unit: str) -> float:
    """Value of a text; a temperature may also be the name of a thermometer, which is read."""
    if unit != "C" or ":" not in text:
        return parse_quantity(text, unit)
    from midair.cli.exposure_options import MeasuredTemperature

    return MeasuredTemperature.read(text)


def format_quantity(value: float, unit: str) -> str:
    """A quantity as text: lengths below a metre in millimetres, fractions in %."""
    if unit in _BY_HAND:
        return f"{100 * value:.6g}%" if unit == "%" else f"{value:.6g}{'dB' if unit == 'dB' else 'C'}"
    return f"{value * 1e3:.6g}mm" if unit == "m" and abs(value) < 1 else f"{value:.6g}{unit}"


@cache
def _units() -> "pint.UnitRegistry[Any]":
    import pint

    return pint.UnitRegistry()
