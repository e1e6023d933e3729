"""Spellings of units in files of other programs."""

from collections.abc import Mapping
from types import MappingProxyType

from midair.model import Unit

_SPELLED: Mapping[str, tuple[Unit, float]] = MappingProxyType(
    {
        **dict.fromkeys(("v", "volt", "volts"), ("V", 1.0)),
        **dict.fromkeys(("mv", "millivolt", "millivolts"), ("V", 1e-3)),
        **dict.fromkeys(("uv", "µv", "μv", "microvolt", "microvolts"), ("V", 1e-6)),
        **dict.fromkeys(("pa", "pascal", "pascals"), ("Pa", 1.0)),
        **dict.fromkeys(("kpa", "kilopascal", "kilopascals"), ("Pa", 1e3)),
        **dict.fromkeys(("count", "counts", "raw", "adc", "lsb"), ("count", 1.0)),
    }
)


def known_unit(text: str) -> tuple[Unit | None, float]:
    """Unit of a recording for a spelling, and the factor into it; None and 1 for unknown spellings."""
    return _SPELLED.get(text.strip().lower(), (None, 1.0))
