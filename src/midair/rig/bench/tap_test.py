"""Listening for the taps of somebody who is told which cell comes next."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.devices import GapFiller, SensorDevice
from midair.errors import DeviceError, InputError
from midair.rig.bench.identify import Identity, identify, tone_answers

Array = NDArray[np.float64]
Prompt = Callable[[int], None]
"""Told the cell that is to be tapped now."""
Skip = Callable[[], bool]
"""Whether somebody said that the cell that is due cannot be tapped."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TapTest:
    """How taps are listened for.

    Attributes
    ----------
    quiet : float
        At the beginning nothing is touched for so long, in s: that tells rest and noise.
    window : float
        Length of a tap from its beginning, in s.
    wait : float
        When nothing came for so long, in s, the cell is left out.
    every : float or None
        Taps come in this rhythm, in s, the first one within it after the quiet; None to wait for each.
    level : float
        A tap begins where any channel is this many times its noise away from rest.
    """

    quiet: float = 1.0
    window: float = 0.15
    wait: float = 10.0
    every: float | None = None
    level: float = 8.0


def never_skip() -> bool:
    """Whether a cell is to be left out: never, since nobody looks on."""
    return False


def identify_by_taps(sensor: SensorDevice, test: TapTest, prompt: Prompt, skip: Skip = never_skip) -> Identity:
    """Which channel is which cell, from a tap on each cell in turn, row by row.

    Parameters
    ----------
    sensor : SensorDevice
        Open; it is started and stopped here.
    test : TapTest
        How to listen.
    prompt : callable
        Called with each cell when it is its turn.
    skip : callable
        Asked all the time; True leaves out the cell that is due.

    Raises
    ------
    DeviceError
        If the sensor ends before the first tap.
    InputError
        If nothing answered at all.
    """
    sensor.start()
    try:
        ear = _Ear(sensor, test)
        ear.learn()
        heard: list[Array] = []
        for cell in range(sensor.grid.count):
            prompt(cell)
            heard.append(ear.next_beat() if test.every else ear.next_tap(skip))
    finally:
        sensor.stop()
    return identify(
        np.array([ear.strength(tap) for tap in heard]), ear.noise, sensor.grid, signals=np.concatenate(heard)
    )


def identify_by_tones(sensor: SensorDevice, frequency: Array, duration: float) -> Identity:
    """Which channel is which cell, from a tone in each cell: the first frequency is that of cell 0, and so on.

    Raises
    ------
    InputError
        If there is not one frequency for each cell, or they cannot be told apart.
    DeviceError
        If the sensor ends before.
    """
    if len(frequency) != sensor.grid.count:
        raise InputError(f"tones: expected {sensor.grid.count}, one for each cell, got {len(frequency)}")
    sensor.start()
    try:
        samples = _Ear(sensor, TapTest()).take(round(duration * sensor.rate))
    finally:
        sensor.stop()
    answer, noise = tone_answers(samples, sensor.rate, frequency)
    return identify(answer, noise, sensor.grid, signals=samples)


class _Ear:
    """Reads a sensor frame by frame and knows its rest and its noise."""

    def __init__(self, sensor: SensorDevice, test: TapTest) -> None:
        self._sensor, self._test = sensor, test
        self._seam = GapFiller(sensor.name, sensor.rate)
        self._waiting = np.zeros((0, sensor.grid.count))
        self._ended = False
        self.rest = self.noise = np.zeros(sensor.grid.count)

    def learn(self) -> None:
        """Rest and noise, from the quiet at the beginning."""
        quiet = self.take(self._frames(self._test.quiet))
        self.rest, self.noise = quiet.mean(axis=0), quiet.std(axis=0)

    def take(self, frames: int) -> Array:
        """The next frames, shape (frame, channel).

        Raises
        ------
        DeviceError
            If the sensor ends before.
        """
        while len(self._waiting) < frames and self._more():
            pass
        if len(self._waiting) < frames:
            raise DeviceError(
                f"{self._sensor.name}: expected {frames / self._sensor.rate:.3g} s more, the sensor ended before"
            )
        taken, self._waiting = self._waiting[:frames], self._waiting[frames:]
        return taken

    def next_beat(self) -> Array:
        """The frames of one beat about rest; silence after the end of the source."""
        frames = self._frames(self._test.every or 1.0)
        while len(self._waiting) < frames and self._more():
            pass
        if len(self._waiting) < frames:
            return np.zeros((0, len(self.rest)))
        return self.take(frames) - self.rest

    def next_tap(self, skip: Skip) -> Array:
        """The frames of the next tap about rest, none when it did not come in time; then wait until it is quiet."""
        passed, block = 0, self._frames(0.05)
        while passed < self._frames(self._test.wait) and not skip() and self._fill(block):
            begin = self._begin(self._waiting[:block])
            if begin is None:
                passed += len(self.take(min(block, len(self._waiting))))
                continue
            self.take(begin)
            self._fill(self._frames(self._test.window))
            tap = self.take(min(self._frames(self._test.window), len(self._waiting))) - self.rest
            self._calm(block)
            return tap
        return np.zeros((0, len(self.rest)))

    def strength(self, tap: Array) -> Array:
        """How strongly each channel answered, the rms of a tap beyond its noise, shape (channel,)."""
        if not len(tap):
            return np.zeros(len(self.rest))
        return np.sqrt(np.maximum(np.square(tap).mean(axis=0) - np.square(self.noise), 0))

    def _calm(self, block: int) -> None:
        """Let a tap fade: until a tenth of a second is below half the level, for as long as a tap is waited for."""
        calm = passed = 0
        while calm < self._frames(0.1) and passed < self._frames(self._test.wait) and self._fill(block):
            part = self.take(min(block, len(self._waiting)))
            calm = 0 if self._begin(part, share=0.5) is not None else calm + len(part)
            passed += len(part)

    def _begin(self, samples: Array, *, share: float = 1.0) -> int | None:
        """The first frame at which any channel leaves its rest."""
        # A channel without noise would take the smallest change for a tap.
        floor = np.maximum(self.noise, max(0.1 * float(np.median(self.noise)), 1e-12))
        past = (np.abs(samples - self.rest) > share * self._test.level * floor).any(axis=1)
        return int(past.argmax()) if past.any() else None

    def _fill(self, frames: int) -> bool:
        """Have some frames waiting; False when the source has ended and none is left."""
        while len(self._waiting) < frames and self._more():
            pass
        return len(self._waiting) > 0

    def _more(self) -> bool:
        if self._ended:
            return False
        block = self._sensor.read(max(1, self._frames(0.05)))
        self._ended = not len(block.samples)
        samples = self._seam.add(block).samples
        self._waiting = np.concatenate([self._waiting, samples.reshape(len(samples), self._sensor.grid.count)])
        return not self._ended

    def _frames(self, seconds: float) -> int:
        return max(1, round(seconds * self._sensor.rate))
