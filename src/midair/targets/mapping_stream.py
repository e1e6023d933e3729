"""Map pressure block by block while it is recorded."""

import numpy as np
from numpy.typing import NDArray

from midair.errors import DeviceStateError, InputError, ShapeError
from midair.targets.mapping import SlowBias, constant_offset, half_wave, mapping_of
from midair.validation import positive

Array = NDArray[np.float64]


class MappingStream:
    """One mapping of a stream of frames; all blocks together equal the mapping of the whole recording.

    `push` takes blocks of any length and returns the frames that are ready, `delay` frames late; `finish` returns the
    rest.

    Parameters
    ----------
    mapping : {"half-wave", "constant-offset", "slow-bias"}
        Name of the mapping.
    rate : float
        Frames per second, in Hz.
    offset : ndarray, shape (row, column), or float, optional
        The constant offset in Pa, since a stream does not know the later minimum of its cells.
    band : tuple of float, optional
        (low, high) in Hz, which determines a slow bias; from 20 Hz on if None.

    Raises
    ------
    InputError
        If the mapping is unknown, or an offset is missing for "constant-offset" or given for another.
    """

    def __init__(
        self,
        mapping: str,
        rate: float,
        *,
        offset: Array | float | None = None,
        band: tuple[float, float] | None = None,
    ) -> None:
        chosen = mapping_of(mapping, band)
        if (mapping == "constant-offset") != (offset is not None):
            raise InputError(
                "offset: expected one in Pa for constant-offset and none for the others, got "
                f"{'none' if offset is None else 'one'} for {mapping}; measure it on an earlier recording"
            )
        self.mapping = mapping
        self._rate, self._offset = positive(rate, "rate", "Hz"), offset
        self._bias = chosen if isinstance(chosen, SlowBias) else None
        self._kept: Array | None = None

    @property
    def delay(self) -> int:
        """Delay in frames: 0 except for the slow bias, 90 ms for 20 Hz."""
        return 0 if self._bias is None else self._bias.reach(self._rate)

    def push(self, block: Array) -> Array:
        """The frames that are ready after this block, shape (frame, ...), in Pa; possibly none."""
        block = np.asarray(block, float)
        if block.ndim < 1 or not len(block):
            raise ShapeError(f"block: expected at least one frame, got shape {block.shape}")
        before = np.repeat(block[:1], self.delay, axis=0) if self._kept is None else self._kept
        have = np.concatenate([before, block])
        # The next frame needs `delay` frames on either side.
        self._kept = have[max(0, len(have) - 2 * self.delay) :]
        if self._bias is not None:
            return self._bias.lift(have, self._rate) if len(have) > 2 * self.delay else have[:0]
        return half_wave(block) if self._offset is None else constant_offset(block, offset=self._offset)

    def finish(self) -> Array:
        """The remaining frames; the stream can then be used again."""
        if self._kept is None:
            raise DeviceStateError("stream: expected at least one push before finish, got none")
        held = np.repeat(self._kept[-1:], self.delay, axis=0)
        rest = self.push(held) if len(held) else self._kept
        self._kept = None
        return rest
