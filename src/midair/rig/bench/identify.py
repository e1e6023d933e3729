"""Assign channels to cells from the response of every channel to a tap, or to a tone, on each cell.

Neighbouring channels respond too, taps differ in strength, and channels in gain. The assignment as a whole is more
certain than any single pair: the product of the responses along it contains the strength of every tap and the gain of
every channel once, so the largest product does not depend on them (an assignment problem on the logarithms; H. Kuhn,
1955).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import InputError, ShapeError
from midair.model import SensorGrid

HEARD = 5.0
"""A response counts from this multiple of the channel's noise."""
ALIKE = 0.98
"""Correlation over all taps above which two channels carry one signal; neighbours that receive .8 of a tap stay below.
"""
CLEAR = 3.0
"""Margin over the next best channel, in dB, from which an assignment is certain."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Identity:
    """Assignment of channels to cells."""

    grid: SensorGrid
    channel: tuple[int | None, ...]
    """Channel that responds at each cell, row by row; None where no channel responds."""
    margin: Array
    """Margin in dB, shape (cell,): by how much the best order without this pair is worse, divided by the two pairs that
    must change at least; infinite where there is no other order."""
    dead: tuple[int, ...]
    """Channels that never responded."""
    alike: tuple[tuple[int, int], ...]
    """Pairs of channels that carry the same signal."""

    @property
    def doubtful(self) -> tuple[int, ...]:
        """Cells whose channel is not certain."""
        return tuple(int(i) for i in np.flatnonzero(self.margin < CLEAR) if self.channel[int(i)] is not None)

    @property
    def silent(self) -> tuple[int, ...]:
        """Cells without a channel of their own."""
        return tuple(cell for cell, channel in enumerate(self.channel) if channel is None)

    @property
    def sound(self) -> bool:
        """Whether every assignment is certain, without dead or duplicate channels."""
        return not (self.doubtful or self.silent or self.dead or self.alike)

    @property
    def order(self) -> tuple[int, ...]:
        """Channel of each cell; silent cells get the remaining channels, lowest first."""
        left = iter(sorted(set(range(self.grid.count)) - {c for c in self.channel if c is not None}))
        return tuple(next(left) if channel is None else channel for channel in self.channel)

    @property
    def in_order(self) -> bool:
        """Whether every channel that responds has the number of its cell."""
        return all(channel in (None, cell) for cell, channel in enumerate(self.channel))


def identify(answer: Array, noise: Array, grid: SensorGrid, *, signals: Array | None = None) -> Identity:
    """Assign channels from responses (cell, channel), noise (channel,), and signals (frame, channel) to find copies."""
    if answer.shape != (grid.count, grid.count) or noise.shape != (grid.count,):
        raise ShapeError(f"answers: expected {grid.count} cells and channels, got {answer.shape} and {noise.shape}")
    # A channel without noise would have an infinite ratio.
    floor = np.maximum(noise, 1e-9 * answer.max())
    heard = np.asarray((answer > HEARD * floor).any(axis=0))
    if not heard.any():
        raise InputError(
            "expected a response of at least one channel, got none; tap harder, check the power of the sensor"
        )
    alike = () if signals is None else _duplicates(signals, heard)
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


def assignment_problems(identity: Identity) -> list[str]:
    """Problems of an assignment, one sentence each; empty if every channel works and is in its place."""
    said = [f"channel {c} is dead: it never responded; check its wire" for c in identity.dead]
    said += [f"channels {a} and {b} carry the same signal: one wire goes to both" for a, b in identity.alike]
    places = enumerate(np.ndindex(identity.grid.shape))
    names = [f"cell {cell} (row {row}, column {column})" for cell, (row, column) in places]
    said += [f"{names[c]}: no channel of its own responded" for c in identity.silent]
    said += [
        f"{names[c]}: channel {identity.channel[c]} is not certain, "
        f"only {identity.margin[c]:.1f} dB above the next; tap again, harder, and only there"
        for c in identity.doubtful
    ]
    return said if identity.in_order else [*said, _permutation(identity)]


def tone_answers(samples: Array, rate: float, frequency: Array) -> tuple[Array, Array]:
    """Fit the amplitude of every tone in every channel, and the noise of these amplitudes, by least squares.

    The noise of an amplitude is sigma sqrt(2 / frames), with sigma the rms of the residual (D. Rife, R. Boorstyn, IEEE
    Trans. Inf. Theory 20, 1974). `samples` (frame, channel) and `frequency` (tone,) give shapes (tone, channel) and
    (channel,). InputError if a frequency is not between 0 and half the rate, or the recording is too short for them.
    """
    frames, gap = len(samples), float(np.diff(np.sort(frequency)).min(initial=np.inf))
    if not 0 < frequency.min() <= frequency.max() < rate / 2:
        raise InputError(f"tones: expected 0 to {rate / 2:g} Hz, got {frequency.min():g} to {frequency.max():g} Hz")
    # Two periods of the difference frequency separate two tones.
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
    """Margin of a pair in dB: how much worse the best order without it is, per pair that must change (two at least)."""
    other: Any = cost.copy()
    # A higher cost than any order, so that it is chosen only where there is no other.
    forbidden = float(cost.sum()) + 1e6
    other[cell, column] = forbidden
    _, without = _assignment(other)
    return np.inf if without >= forbidden else (without - total) / 2


def _duplicates(signals: Array, heard: NDArray[np.bool_]) -> tuple[tuple[int, int], ...]:
    about = signals - signals.mean(axis=0)
    size = np.sqrt(np.square(about).sum(axis=0))
    about = about / np.where(size > 0, size, 1)
    likeness = np.abs(about.T @ about)
    return tuple(
        (int(a), int(b)) for a, b in np.argwhere(np.triu(likeness > ALIKE, 1)) if heard[int(a)] and heard[int(b)]
    )


def _permutation(identity: Identity) -> str:
    """Describe how the channels are permuted."""
    moved = [(cell, c) for cell, c in enumerate(identity.channel) if c is not None and c != cell]
    for name, order in _orientations(identity.grid).items():
        if all(c in (None, order[cell]) for cell, c in enumerate(identity.channel)):
            return f"the sensor is {name}: {len(moved)} channels are in another place"
    if len(moved) == 2 and moved[0] == moved[1][::-1]:
        return f"channels {moved[0][0]} and {moved[0][1]} are swapped"
    pairs = ", ".join(f"{cell}: {c}" for cell, c in moved)
    return f"{len(moved)} channels are in another place (cell: channel that responds): {pairs}"


def _orientations(grid: SensorGrid) -> dict[str, list[int]]:
    """Channel orders of a sensor that is rotated or mirrored as a whole."""
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
