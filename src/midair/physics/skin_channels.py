"""How strongly two channels of touch take up a displacement of skin, by its frequency.

Pacinian corpuscles (P) feel 40 to 800 Hz, best about 250 Hz, and the channel called NP I decides what is just felt from
10 to 40 Hz (Forta, Griffin and Morioka, Somatosens. Mot. Res. 29(1), 2012, who sum up others). The slopes of P are
Verrillo's (J. Acoust. Soc. Am. 35(12), 1963). Assumed: that NP I is even from 10 to 40 Hz, and falls by as much an
octave beyond as P does towards it. Nothing here was measured on people with this array.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchChannel:
    """A channel by the plateau where it feels best and the slopes beside it.

    Attributes
    ----------
    best : tuple of float
        Lowest and highest frequency of the plateau, in Hz.
    below, above : float
        By how much less it feels beside it, in dB an octave.
    """

    best: tuple[float, float]
    below: float
    above: float

    def weight(self, frequency: Array) -> Array:
        """Part of a displacement that it takes up, 1 at best, shape of `frequency` (Hz); 0 of what stands still."""
        f = np.asarray(frequency, float)
        with np.errstate(divide="ignore"):
            under, over = np.log2(np.maximum(self.best[0] / f, 1)), np.log2(np.maximum(f / self.best[1], 1))
        return 10 ** (-(self.below * under + self.above * over) / 20)


TOUCH_CHANNELS: dict[Literal["NP I", "P"], TouchChannel] = {
    "NP I": TouchChannel(best=(10.0, 40.0), below=12.0, above=12.0),
    "P": TouchChannel(best=(250.0, 250.0), below=12.0, above=9.0),
}
"""By the names that psychophysics has for them."""
