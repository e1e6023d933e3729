"""Frequency weighting of skin displacement for two tactile channels.

Pacinian corpuscles (P) respond from 40 to 800 Hz, best at about 250 Hz; the channel NP I determines thresholds from 10
to 40 Hz (Forta, Griffin and Morioka, Somatosens. Mot. Res. 29(1), 2012, a review). The slopes of P are Verrillo's (J.
Acoust. Soc. Am. 35(12), 1963). Assumed: NP I is flat from 10 to 40 Hz, and has the low-frequency slope of P on both
sides. None of this was measured on people with this array.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchChannel:
    """Frequency weighting with a plateau of highest sensitivity and slopes on both sides."""

    best: tuple[float, float]
    """Lowest and highest frequency of the plateau, in Hz."""
    below: float
    """Slope below the plateau, in dB per octave."""
    above: float
    """Slope above the plateau, in dB per octave."""

    def weight(self, frequency: Array) -> Array:
        """Factor on a displacement, 1 on the plateau, same shape as `frequency` (Hz); 0 at 0 Hz."""
        f = np.asarray(frequency, float)
        with np.errstate(divide="ignore"):
            under, over = np.log2(np.maximum(self.best[0] / f, 1)), np.log2(np.maximum(f / self.best[1], 1))
        return 10 ** (-(self.below * under + self.above * over) / 20)


TOUCH_CHANNELS: dict[Literal["NP I", "P"], TouchChannel] = {
    "NP I": TouchChannel(best=(10.0, 40.0), below=12.0, above=12.0),
    "P": TouchChannel(best=(250.0, 250.0), below=12.0, above=9.0),
}
"""Channels by their names in psychophysics."""
