"""Record a tap on each cell of a sensor, and assign channels to cells from the responses of every channel.

Neighbouring channels respond too, taps differ in strength, and channels in gain. The assignment as a whole is more
certain than any single pair: the product of the responses along it contains the strength of every tap and the gain of
every channel once, so the largest product does not depend on them (an assignment problem on the logarithms; H. Kuhn,
1955).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from midair.array_types import Array
from midair.devices import GapFiller, SensorDevice
from midair.errors import DeviceError, InputError, ShapeError
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


def _assignment(cost: Array) -> tuple[dict[int, int], float]:
    cells, columns = scipy.optimize.linear_sum_assignment(cost)
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
    moved = [(cell, c) for cell, c in enumerate(identity.channel) if c is not None and c != cell]
    if len(moved) == 2 and moved[0] == moved[1][::-1]:
        return f"channels {moved[0][0]} and {moved[0][1]} are swapped"
    if all(c in (None, identity.grid.count - 1 - cell) for cell, c in enumerate(identity.channel)):
        return f"the sensor is turned by 180 degrees: {len(moved)} channels are in another place"
    pairs = ", ".join(f"{cell}: {c}" for cell, c in moved)
    return f"{len(moved)} channels are in another place (cell: channel that responds): {pairs}"


Prompt = Callable[[int], None]
"""Function that prompts for a tap on a cell."""
Skip = Callable[[], bool]
"""Function that returns True if the current cell cannot be tapped."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TapTest:
    """Settings of tap detection."""

    quiet: float = 1.0
    """Time without touch at the beginning, in s; it gives the rest values and the noise."""
    window: float = 0.15
    """Length of a tap from its onset, in s."""
    wait: float = 10.0
    """Time without a tap after which the cell is skipped, in s."""
    every: float | None = None
    """Interval between taps in s, the first one within it after the quiet time; None to wait for each."""
    level: float = 8.0
    """Threshold of a tap's onset, as a multiple of any channel's noise."""


def identify_by_taps(sensor: SensorDevice, test: TapTest, prompt: Prompt, skip: Skip = lambda: False) -> Identity:
    """Assign channels to cells from a tap on each cell in turn, row by row.

    The open sensor is started and stopped here. `prompt` is called with each cell when it is to be tapped; the cell is
    skipped when `skip` returns True. DeviceError if the sensor ends before the first tap, InputError if no channel
    responded.
    """
    sensor.start()
    try:
        reader = _SensorReader(sensor, test)
        reader.measure_rest()
        heard: list[Array] = []
        for cell in range(sensor.grid.count):
            prompt(cell)
            heard.append(reader.next_beat() if test.every else reader.next_tap(skip))
    finally:
        sensor.stop()
    return identify(
        np.array([reader.strength(tap) for tap in heard]), reader.noise, sensor.grid, signals=np.concatenate(heard)
    )


class _SensorReader:
    """Read a sensor frame by frame, relative to its rest values and noise."""

    def __init__(self, sensor: SensorDevice, test: TapTest) -> None:
        self._sensor, self._test = sensor, test
        self._gap_filler = GapFiller(sensor.name, sensor.rate)
        self._waiting = np.zeros((0, sensor.grid.count))
        self._ended = False
        self.rest = self.noise = np.zeros(sensor.grid.count)

    def measure_rest(self) -> None:
        """Measure rest values and noise in the quiet time."""
        quiet = self.take(self._frames(self._test.quiet))
        self.rest, self.noise = quiet.mean(axis=0), quiet.std(axis=0)

    def take(self, frames: int) -> Array:
        """Return the next frames, shape (frame, channel); DeviceError if the sensor ends early."""
        if not self._fill_buffer(frames):
            raise DeviceError(
                f"{self._sensor.name}: expected another {frames / self._sensor.rate:.3g} s, the sensor ended early"
            )
        taken, self._waiting = self._waiting[:frames], self._waiting[frames:]
        return taken

    def next_beat(self) -> Array:
        """Return one interval relative to rest; no frames after the end of the source."""
        frames = self._frames(self._test.every or 1.0)
        return self.take(frames) - self.rest if self._fill_buffer(frames) else np.zeros((0, len(self.rest)))

    def next_tap(self, skip: Skip) -> Array:
        """Return the next tap relative to rest, no frames after the timeout; then wait until the signal has decayed."""
        passed, block = 0, self._frames(0.05)
        while (
            passed < self._frames(self._test.wait) and not skip() and (self._fill_buffer(block) or len(self._waiting))
        ):
            begin = self._find_onset(self._waiting[:block])
            if begin is None:
                passed += len(self.take(min(block, len(self._waiting))))
                continue
            self.take(begin)
            self._fill_buffer(self._frames(self._test.window))
            tap = self.take(min(self._frames(self._test.window), len(self._waiting))) - self.rest
            self._wait_for_decay(block)
            return tap
        return np.zeros((0, len(self.rest)))

    def strength(self, tap: Array) -> Array:
        """Response of each channel: rms of a tap beyond its noise, shape (channel,)."""
        if not len(tap):
            return np.zeros(len(self.rest))
        return np.sqrt(np.maximum(np.square(tap).mean(axis=0) - np.square(self.noise), 0))

    def _wait_for_decay(self, block: int) -> None:
        """Wait until a tenth of a second stays below half the level, up to the timeout."""
        calm = passed = 0
        most = self._frames(self._test.wait)
        while calm < self._frames(0.1) and passed < most and (self._fill_buffer(block) or len(self._waiting)):
            part = self.take(min(block, len(self._waiting)))
            calm = 0 if self._find_onset(part, share=0.5) is not None else calm + len(part)
            passed += len(part)

    def _find_onset(self, samples: Array, *, share: float = 1.0) -> int | None:
        """First frame at which any channel exceeds the threshold."""
        # Without a minimum, a channel without noise would detect the smallest change as a tap.
        floor = np.maximum(self.noise, max(0.1 * float(np.median(self.noise)), 1e-12))
        past = (np.abs(samples - self.rest) > share * self._test.level * floor).any(axis=1)
        return int(past.argmax()) if past.any() else None

    def _fill_buffer(self, frames: int) -> bool:
        """Buffer some frames; False when the source has ended before."""
        while len(self._waiting) < frames and self._read_block():
            pass
        return len(self._waiting) >= frames

    def _read_block(self) -> bool:
        if self._ended:
            return False
        block = self._sensor.read(max(1, self._frames(0.05)))
        self._ended = not len(block.samples)
        samples = self._gap_filler.add(block).samples
        self._waiting = np.concatenate([self._waiting, samples.reshape(len(samples), self._sensor.grid.count)])
        return not self._ended

    def _frames(self, seconds: float) -> int:
        return max(1, round(seconds * self._sensor.rate))
