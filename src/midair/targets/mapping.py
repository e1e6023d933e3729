"""From pressure of both signs to pressure that pushes, cell by cell.

Sound can only push (paper, 4.1). Three ways out, each a pure function of (frame, ...) in Pa and the frame rate:

- `half_wave`, the paper's: what pulls is cut off. ``max(x, 0) = x/2 + |x|/2``: half of the wanted wave is left, and
  harmonics from the other term.
- `constant_offset`: each cell is lifted by what it ever pulls. Nothing is cut; the cell is pushed all the time.
- `slow_bias`: each cell is lifted by what it pulls about now, by a bound that moves too slowly to be felt as vibration.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import cast

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.lazy_filters import with_context
from midair.lazy_frames import LazyFrames, each_frame
from midair.validation import positive

Array = NDArray[np.float64]


def half_wave(pressure: Array, rate: float = 1.0) -> Array:  # noqa: ARG001, all mappings are called alike
    """The positive part, any shape, in Pa: radiation pressure only pushes (paper, 4.1)."""
    return each_frame(pressure, lambda block: np.maximum(block, 0.0))


def constant_offset(pressure: Array, rate: float = 1.0, *, offset: Array | float | None = None) -> Array:  # noqa: ARG001
    """Pressure plus an offset that stays the same; nothing is cut, so no harmonics arise.

    Parameters
    ----------
    pressure : ndarray, shape (frame, ...)
        In Pa.
    rate : float
        Not needed.
    offset : ndarray, shape (...), or float, optional
        In Pa, 0 or more; what pulls harder is cut. What each cell pulls at most if None, which needs the whole
        recording.
    """
    if offset is None:
        lift = np.minimum(pressure.min(axis=0), 0.0)
        return each_frame(pressure, lambda block: block - lift)
    if not (np.isfinite(offset).all() and np.min(offset) >= 0):
        raise InputError(f"offset: expected 0 Pa or more, got {np.min(offset):g} Pa; it can only push")
    return each_frame(pressure, lambda block: np.maximum(block + offset, 0.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowBias:
    """P = max(x + b, 0) with b a smooth upper bound of what the cell pulls within a window.

    b is the sliding maximum of -x over `window`, at least 0, smoothed by a Hann window that is 3 dB down at `corner`
    (its length is .72 / corner: Harris, Proc. IEEE 66(1), 1978). Where b lies below -x after all, the rest is cut; as
    long as `window` is at least the length of the Hann window that never happens.

    Attributes
    ----------
    corner : float
        Corner of the smoothing, in Hz: below what the sensor hears, so that the bias is not felt as vibration.
    window : float or None
        Length of the sliding maximum, in s; that of the Hann window if None.
    """

    corner: float = 8.0
    window: float | None = None

    def __post_init__(self) -> None:
        positive(self.corner, "corner of the bias", "Hz")
        if self.window is not None:
            positive(self.window, "window of the bias", "s")

    @classmethod
    def below(cls, band: tuple[float, float]) -> "SlowBias":
        """The bias for what is felt in a band: its corner is at two fifths of the lower one, 8 Hz below 20.

        From 1 Hz down it is that of 1 Hz: what is slower than that is no vibration.
        """
        return cls(corner=0.4 * max(band[0], 1.0))

    @property
    def seconds(self) -> float:
        """How long before and after a frame decides its bias, in s; so late is a stream."""
        return (0.72 / self.corner if self.window is None else self.window) / 2 + 0.36 / self.corner

    def lengths(self, rate: float) -> tuple[int, int]:
        """Frames of the sliding maximum and of the Hann window, both odd."""
        # Odd lengths have a middle, so that neither shifts the bias by half a frame.
        smooth = 2 * round(0.36 / self.corner * rate) + 1
        return smooth if self.window is None else 2 * round(self.window * rate / 2) + 1, smooth

    def reach(self, rate: float) -> int:
        """How many frames before and after a frame decide its bias; so many a stream is late."""
        return sum(length // 2 for length in self.lengths(rate))

    def lift(self, surrounded: Array, rate: float) -> Array:
        """The mapping of all frames but the first and last `reach`, shape (frame - 2 reach, ...), in Pa."""
        from scipy.ndimage import convolve1d, maximum_filter1d

        longest, smooth = self.lengths(rate)
        pulls = np.asarray(maximum_filter1d(np.maximum(-surrounded, 0.0), longest, axis=0, mode="nearest"), np.float64)
        # Without the two zeros at its ends, which only a delay would come of.
        hann = np.hanning(smooth + 2)[1:-1]
        bias = np.asarray(convolve1d(pulls, hann / hann.sum(), axis=0, mode="nearest"), np.float64)
        reach = self.reach(rate)
        inside = slice(reach, len(surrounded) - reach)
        return np.maximum(surrounded[inside] + bias[inside], 0.0)

    def __call__(self, pressure: Array, rate: float) -> Array:
        """Pressure that pushes, same shape, in Pa; beyond its ends the signal is taken as held."""
        reach = self.reach(rate)
        if isinstance(pressure, LazyFrames):
            return cast("Array", with_context(pressure, reach, lambda around: self.lift(around, rate)))
        ends = [np.repeat(end, reach, axis=0) for end in (pressure[:1], pressure[-1:])]
        return self.lift(np.concatenate([ends[0], pressure, ends[1]]), rate)


slow_bias = SlowBias()
"""The slow bias with a corner of 8 Hz, for what is felt from 20 Hz on."""

MAPPINGS: Mapping[str, Callable[[Array, float], Array]] = MappingProxyType(
    {"half-wave": half_wave, "constant-offset": constant_offset, "slow-bias": slow_bias}
)
"""The ways from signed pressure to pressure that pushes; each takes (frame, row, column) in Pa and the rate in Hz."""


def mapping_of(name: str, band: tuple[float, float] | None = None) -> Callable[[Array, float], Array]:
    """The mapping of this name, for what is felt in a band; from 20 Hz on if None.

    Raises
    ------
    InputError
        If there is none.
    """
    if name not in MAPPINGS:
        raise InputError(f"mapping: expected one of {', '.join(MAPPINGS)}, got {name!r}")
    chosen = MAPPINGS[name]
    return SlowBias.below(band) if band is not None and isinstance(chosen, SlowBias) else chosen
