"""Which channel is which cell: from what every channel said when each cell was tapped, or heard a tone of its own.

Neighbours answer too, taps differ in strength, and channels in gain. A permutation as a whole is more certain than any
of its pairs: the product of the answers along it contains the strength of every tap and the gain of every channel once,
so the largest product does not depend on them (an assignment problem on the logarithms; H. Kuhn, 1955).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError, ShapeError
from midair.model import SensorGrid

Array = NDArray[np.float64]

HEARD = 5.0
"""An answer counts from this many times the channel's noise on."""
ALIKE = 0.98
"""Correlation over all taps from which two channels carry one signal; neighbours that feel .8 of a tap are below it."""
CLEAR = 3.0
"""Distance of a cell's channel from the next best, in dB, from which it is not doubtful."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Identity:
    """Which channel answers at which cell.

    Attributes
    ----------
    grid : SensorGrid
        The cells.
    channel : tuple of int or None
        The channel that answers at each cell, row by row; None where nothing does.
    margin : ndarray, shape (cell,)
        By how much the best order without this cell's channel is worse, in dB, for each of the two or more pairs that
        would have to change; infinite where there is no other.
    dead : tuple of int
        Channels that never answered.
    alike : tuple of (int, int)
        Channels that carry the same signal.
    """

    grid: SensorGrid
    channel: tuple[int | None, ...]
    margin: Array
    dead: tuple[int, ...]
    alike: tuple[tuple[int, int], ...]

    @property
    def doubtful(self) -> tuple[int, ...]:
        """Cells whose channel is not certain."""
        return tuple(int(i) for i in np.flatnonzero(self.margin < CLEAR) if self.channel[int(i)] is not None)

    @property
    def silent(self) -> tuple[int, ...]:
        """Cells at which nothing answered that is not another cell's."""
        return tuple(cell for cell, channel in enumerate(self.channel) if channel is None)

    @property
    def sound(self) -> bool:
        """Whether every channel is certain, alive and itself, wherever it is."""
        return not (self.doubtful or self.silent or self.dead or self.alike)

    @property
    def order(self) -> tuple[int, ...]:
        """The channel of each cell; silent cells get the channels that are left, lowest first."""
        left = iter(sorted(set(range(self.grid.count)) - {c for c in self.channel if c is not None}))
        return tuple(next(left) if channel is None else channel for channel in self.channel)

    @property
    def in_order(self) -> bool:
        """Whether every channel that answers is the one of its cell."""
        return all(channel in (None, cell) for cell, channel in enumerate(self.channel))


def identify(answer: Array, noise: Array, grid: SensorGrid, *, signals: Array | None = None) -> Identity:
    """Which channel is which cell.

    Parameters
    ----------
    answer : ndarray, shape (cell, channel)
        How strongly each channel answered when each cell was touched, 0 or more.
    noise : ndarray, shape (channel,)
        The same figure when nothing is touched.
    grid : SensorGrid
        The cells.
    signals : ndarray, shape (frame, channel), optional
        What the channels said during all touches, to find those that carry the same.

    Raises
    ------
    ShapeError, InputError
        If the shapes do not fit, or nothing answered at all.
    """
    if answer.shape != (grid.count, grid.count) or noise.shape != (grid.count,):
        raise ShapeError(f"answers: expected {grid.count} cells and channels, got {answer.shape} and {noise.shape}")
    # A channel without any noise would be infinitely far above it.
    floor = np.maximum(noise, 1e-9 * answer.max())
    heard = np.asarray((answer > HEARD * floor).any(axis=0))
    if not heard.any():
        raise InputError("expected some channel to answer, none did; tap harder, check the power of the sensor")
    alike = () if signals is None else _alike(signals, heard)
    used = np.array([c for c in np.flatnonzero(heard) if c not in {second for _, second in alike}])
    share = np.maximum(answer, floor)[:, used]
    cost = -20 * np.log10(share / share.max(axis=0))
    best, total = _assignment(cost)
    channel: list[int | None] = [None] * grid.count
    margin = np.full(grid.count, np.inf)
    for cell, column in best.items():
        if answer[cell, used[column]] > HEARD * floor[used[column]]:
            channel[cell] = int(used[column])
            margin[cell] = _margin(cost, cell, column, total)
    dead = tuple(int(c) for c in np.flatnonzero(~heard))
    return Identity(grid=grid, channel=tuple(channel), margin=margin, dead=dead, alike=alike)


def findings(identity: Identity) -> list[str]:
    """What is wrong, one sentence each; empty when every channel is in its place and well."""
    said = [f"channel {c} is dead: it never answered; check its wire" for c in identity.dead]
    said += [f"channels {a} and {b} carry the same signal: one wire goes to both" for a, b in identity.alike]
    said += [f"{_cell(c, identity.grid)}: no channel of its own answered" for c in identity.silent]
    said += [
        f"{_cell(c, identity.grid)}: channel {identity.channel[c]} is not certain, "
        f"only {identity.margin[c]:.1f} dB before the next; tap again, harder, and only there"
        for c in identity.doubtful
    ]
    return said if identity.in_order else [*said, _permutation(identity)]


def tone_answers(samples: Array, rate: float, frequency: Array) -> tuple[Array, Array]:
    """Amplitude of every tone in every channel, and what noise alone would give.

    All tones are fitted together by least squares. The noise of an amplitude is sigma sqrt(2 / frames), with sigma the
    rms of what is left (D. Rife, R. Boorstyn, IEEE Trans. Inf. Theory 20, 1974).

    Parameters
    ----------
    samples : ndarray, shape (frame, channel)
        With all tones in it.
    rate : float
        In Hz.
    frequency : ndarray, shape (tone,)
        In Hz, below half the rate.

    Returns
    -------
    answer : ndarray, shape (tone, channel)
    noise : ndarray, shape (channel,)

    Raises
    ------
    InputError
        If a frequency is not between 0 and half the rate, two are closer than the recording can tell apart, or there
        are too few frames.
    """
    frames, gap = len(samples), float(np.diff(np.sort(frequency)).min(initial=np.inf))
    if not 0 < frequency.min() <= frequency.max() < rate / 2:
        raise InputError(f"tones: expected 0 to {rate / 2:g} Hz, got {frequency.min():g} to {frequency.max():g} Hz")
    # Two periods of their difference tell two tones apart.
    if frames < 2 * rate / gap or frames <= 2 * len(frequency) + 1:
        raise InputError(f"tones {gap:g} Hz apart: expected {2 / gap:.3g} s or more, got {frames / rate:.3g} s")
    phase = 2 * np.pi * np.arange(frames)[:, None] / rate * frequency
    basis = np.concatenate([np.cos(phase), np.sin(phase), np.ones((frames, 1))], axis=1)
    part = np.asarray(np.linalg.lstsq(basis, samples, rcond=None)[0], np.float64)
    rest = samples - basis @ part
    count = len(frequency)
    sigma = np.sqrt(np.square(rest).sum(axis=0) / (frames - basis.shape[1]))
    return np.hypot(part[:count], part[count : 2 * count]), sigma * np.sqrt(2 / frames)


def _assignment(cost: Array) -> tuple[dict[int, int], float]:
    from scipy.optimize import linear_sum_assignment

    cells, columns = linear_sum_assignment(cost)
    return {int(k): int(c) for k, c in zip(cells, columns, strict=True)}, float(cost[cells, columns].sum())


def _margin(cost: Array, cell: int, column: int, total: float) -> float:
    """How much worse the best order without a pair is, for each of the two pairs that must change at least."""
    other: Any = cost.copy()
    # Dearer than any order, so that it is taken only where there is no other.
    forbidden = float(cost.sum()) + 1e6
    other[cell, column] = forbidden
    _, without = _assignment(other)
    return np.inf if without >= forbidden else (without - total) / 2


def _alike(signals: Array, heard: NDArray[np.bool_]) -> tuple[tuple[int, int], ...]:
    about = signals - signals.mean(axis=0)
    size = np.sqrt(np.square(about).sum(axis=0))
    about = about / np.where(size > 0, size, 1)
    likeness = np.abs(about.T @ about)
    return tuple(
        (int(a), int(b)) for a, b in np.argwhere(np.triu(likeness > ALIKE, 1)) if heard[int(a)] and heard[int(b)]
    )


def _cell(cell: int, grid: SensorGrid) -> str:
    row, column = divmod(cell, grid.columns)
    return f"cell {cell} (row {row}, column {column})"


def _permutation(identity: Identity) -> str:
    """How the channels are mixed up, in words."""
    moved = [(cell, c) for cell, c in enumerate(identity.channel) if c is not None and c != cell]
    for name, order in _turns(identity.grid).items():
        if all(c in (None, order[cell]) for cell, c in enumerate(identity.channel)):
            return f"the sensor is {name}: {len(moved)} channels are in another place"
    if len(moved) == 2 and moved[0] == moved[1][::-1]:
        return f"channels {moved[0][0]} and {moved[0][1]} are swapped"
    pairs = ", ".join(f"{cell}: {c}" for cell, c in moved)
    return f"{len(moved)} channels are in another place (cell: channel that answers): {pairs}"


def _turns(grid: SensorGrid) -> dict[str, list[int]]:
    """The ways in which a whole sensor can lie wrong."""
    cells = np.arange(grid.count).reshape(grid.shape)
    turns = {
        "turned by 180 degrees": cells[::-1, ::-1],
        "mirrored, left for right": cells[:, ::-1],
        "mirrored, top for bottom": cells[::-1],
    }
    if grid.rows == grid.columns:
        turns |= {
            "turned by 90 degrees": np.rot90(cells),
            "turned by 270 degrees": np.rot90(cells, 3),
            "transposed, rows for columns": cells.T,
            "transposed along the other diagonal": np.rot90(cells, 2).T,
        }
    return {name: turned.ravel().tolist() for name, turned in turns.items()}
