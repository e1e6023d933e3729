"""Loss of a reproduction in a real laboratory: each uncertainty alone, and all together."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from midair.array_types import Array

ALL = "all together"

ADVICE: Mapping[str, str] = {
    "palm sideways": "support the hand and mark its place, or follow it with --follow",
    "palm height": "support the hand at the height of the solve, or follow it with --follow",
    "palm tilt": "support wrist and fingers at the same height, or follow the hand with --follow",
    "palm rotation": "mark the direction of the fingers, or solve for the rotated palm",
    "temperature": "measure it and solve with --temperature, or play with --correct-air",
    "units": "measure their places with midair calibrate array, or state them with --placement",
    "transducers": "measure them with midair calibrate array",
    "dead transducers": "find them with midair calibrate array, which the solver then takes into account",
    "frequency": "measure the frequency of the ultrasound",
    "echo": "tilt the palm or the array by some degrees, or lay a cloth on the array around the transducers",
}
"""What to do about each uncertainty."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LaboratoryLoss:
    """Signal to distortion with one gain for all cells, over random draws of the uncertainties of a laboratory."""

    nominal: float
    """Without any uncertainty, in dB."""
    ratios: Mapping[str, Array]
    """Signal to distortion of each draw in dB, by uncertainty; `ALL` for all of them at once."""
    stated: Mapping[str, str]
    """Size of each uncertainty as text."""
    seed: int
    """Seed of the draws."""
    measured: bool = False
    """Whether the transducers were measured; then only the uncertainty of the measurement remains."""

    @property
    def largest(self) -> str:
        """The uncertainty with the lowest median."""
        return min((name for name in self.ratios if name != ALL), key=lambda name: float(np.median(self.ratios[name])))

    @property
    def advice(self) -> str:
        """One line: the largest uncertainty and what to do about it."""
        name = self.largest
        lost = self.nominal - float(np.median(self.ratios[name]))
        return f"largest: {name} ({self.stated[name]}), which loses {lost:.1f} dB: {ADVICE[name]}"

    def rows(self) -> list[tuple[str, str, float, float, float]]:
        """Name, size, median, 5th and 95th percentile of each uncertainty in dB, the largest loss first."""
        order = sorted(self.ratios, key=lambda name: (name == ALL, float(np.median(self.ratios[name]))))
        found = [(name, np.percentile(self.ratios[name], [50, 5, 95])) for name in order]
        return [(name, self.stated[name], float(mid), float(low), float(high)) for name, (mid, low, high) in found]

    def plain(self) -> dict[str, object]:
        """Values for JSON."""
        return {
            "nominal_db": self.nominal,
            "seed": self.seed,
            "measured_array": self.measured,
            "uncertainties": {
                name: {
                    "stated": said,
                    "median_db": mid,
                    "low_db": low,
                    "high_db": high,
                    "draws": len(self.ratios[name]),
                }
                for name, said, mid, low, high in self.rows()
            },
            "largest": self.largest,
            "advice": ADVICE[self.largest],
        }
