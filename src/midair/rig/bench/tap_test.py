"""Identify channels from taps on prompted cells, or from one tone in each cell."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from midair.array_types import Array
from midair.devices import GapFiller, SensorDevice
from midair.errors import DeviceError, InputError
from midair.rig.bench.identify import Identity, identify, tone_answers

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


def identify_by_tones(sensor: SensorDevice, frequency: Array, duration: float) -> Identity:
    """Assign channels to cells from a tone in each cell: `frequency` in Hz, in the order of the cells.

    InputError if there is not one frequency for each cell, or `duration` (s) is too short to separate them; DeviceError
    if the sensor ends early.
    """
    if len(frequency) != sensor.grid.count:
        raise InputError(f"tones: expected {sensor.grid.count}, one for each cell, got {len(frequency)}")
    sensor.start()
    try:
        samples = _SensorReader(sensor, TapTest()).take(round(duration * sensor.rate))
    finally:
        sensor.stop()
    answer, noise = tone_answers(samples, sensor.rate, frequency)
    return identify(answer, noise, sensor.grid, signals=samples)


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
