"""The loop of live touch: read a frame, process it, compute phases, send them with their instant.

One thread runs the loop, and only the sensor blocks it. A frame that is ready after its instant is not played: the
previous frame stays, and the late frame is counted. Missing frames end in silence. With a latency several frames are
formed for one of the sensor; they wait in the ring until the units can queue them.
"""

import time
from collections import deque
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from midair.devices import ImmediateArray, Put, StreamedSensor, Tracker
from midair.errors import SilentFramesError
from midair.model import Drive, TransducerArray
from midair.rig.live_touch.live_settings import LiveSchedule, LiveSettings
from midair.rig.live_touch.timing import TICK, RateMeter, Timetable
from midair.rig.live_touch.touch import Touch
from midair.rig.live_touch.touch_ring import FRAME_EMITTED, FRAME_LATE, FRAME_REPEATED, TouchRing
from midair.rig.playing.following import Follower, FollowRules


class LiveSteering:
    """Steers frames to the palm of an open tracker as `Follower` does, to its centre; `report` gets one line a change.

    The exposure check of live touch holds for any phases, and therefore for steered frames.
    """

    def __init__(
        self,
        tracker: Tracker,
        array: TransducerArray,
        rate: float,
        order: LiveSettings,
        report: Callable[[str], object],
    ) -> None:
        rules = FollowRules(confidence=order.confidence, fit=False)
        frames = max(1, round(rules.block * rate))
        phase, level = np.zeros((frames, array.count)), np.ones(frames)
        still = Drive(phase=phase, level=level, rate=rate, array=array, acoustics=order.acoustics)
        self._follower = Follower(tracker, still, order.grid, rules=rules, report=report)
        self._rate, self._all, self._later = rate, slice(0, frames), np.arange(frames) / rate
        self._steps = np.zeros((frames, array.count), np.uint8)
        self._gains, self._begin = np.zeros(frames), -np.inf
        self.phases: NDArray[np.uint8] = np.zeros(array.count, np.uint8)
        """Phases of the last frame in steps of 2 pi / 256, steered."""

    def steer(self, phases: NDArray[np.uint8], at: float) -> float:
        """Steer the next frame, which sounds at a time of `time.monotonic`, into `phases`; return its gain."""
        if not 0 <= (at - self._begin) * self._rate < len(self._gains) - 0.5:
            drive, _ = self._follower.steered(self._all, at + self._later)
            np.copyto(self._steps, np.rint(drive.phase * (128 / np.pi)).astype(np.int64), casting="unsafe")
            self._gains, self._begin = np.asarray(drive.level), at
        row = round((at - self._begin) * self._rate)
        # 256 steps are one turn, so that the overflow of a byte is harmless.
        np.add(phases, self._steps[row], out=self.phases)
        return float(self._gains[row])


_NS = 1_000_000_000


class LiveLoop:
    """One run of live touch, inside the array's `frames_to_come`.

    `strongest` is the intensity byte of full level; `level` returns the requested level, 0 to 1; `check`, called at
    least every millisecond, raises where playing is no longer allowed; `steering` moves frames to a palm; `pace` holds
    other times than those of the touch.
    """

    def __init__(
        self,
        sensor: StreamedSensor,
        touch: Touch,
        array: ImmediateArray,
        ring: TouchRing,
        *,
        strongest: int,
        level: Callable[[], float],
        check: Callable[[], None],
        steering: LiveSteering | None = None,
        pace: LiveSchedule | None = None,
    ) -> None:
        self._sensor, self._touch, self._array, self._ring = sensor, touch, array, ring
        self._pace = pace = pace or touch.schedule
        self._strongest, self._level, self._check = strongest, level, check
        self._formed = touch.schedule.formed
        self._period = round(_NS / (self._formed * sensor.rate) / TICK) * TICK
        self._times = Timetable(self._period, round(pace.hold * _NS))
        self._steering = steering
        self._phases = touch.phases if steering is None else steering.phases
        # Frames of the ring that are not sent yet: number in the ring and instant.
        self._waiting: deque[tuple[int, int]] = deque()
        self._frame = np.zeros(sensor.grid.count)
        self._next, self._meter = 0, RateMeter()
        # Slots of the frames that were sent, until the time of their sending is known.
        self._put_slots = np.full(64, -1, np.int64)
        self._puts = self._looked = 0
        # Start of the level's rise; None before.
        self._rising: float | None = None
        self._latest = -np.inf
        self._last_sent = 0.0
        # Times at which the units' failsafe acted.
        self._trips: list[float] = []
        self._intensity = self._last_instant = 0
        # Offset from the computer's clock to the units' in ns; updated regularly, since clocks drift.
        self._ahead, self._asked = 0, -np.inf

    def run(self, put: Put, duration: float | None = None) -> None:
        """Play until the duration is over or the ring's end flag is set; then fade.

        DeviceError if the sensor or the array is lost; StoppedError if playing is no longer allowed.
        """
        ring, began = self._ring, time.monotonic()
        while not ring.ends and (duration is None or self._next < duration * self._sensor.rate):
            self._check()
            if self._sensor.ready(1e-3):
                block = self._sensor.read(1)
                lost = block.first - self._next
                if lost > 0:
                    # The last good frame stands for lost ones, so that the filter keeps its timing.
                    for back in range(lost, 0, -1):
                        self._ring.miss("lost", self._next / self._sensor.rate)
                        self._touch.feel(self._frame)
                        for at in range(self._formed):
                            self._write(at, block.host_time - back / self._sensor.rate, 0, FRAME_REPEATED)
                        self._next += 1
                self._frame[:] = block.samples.reshape(-1)
                self._meter.add(block.first, block.host_time)
                self._ring.put("timed", self._meter.frames)
                self._ring.put("span_us", round(1e6 * self._meter.span))
                self._touch.feel(self._frame)
                for at in range(self._formed):
                    self._play(put, at, block.host_time + at / (self._formed * self._sensor.rate))
                self._next = block.first + 1
            # While no frame arrives: fade, then send silent frames that keep the failsafe of the units from acting.
            self._send_waiting(put)
            now = time.monotonic()
            if self._latest > began and self._rising is not None and now - self._latest > self._pace.quiet:
                self._fade(put)
                self._ring.miss("gaps", self._next / self._sensor.rate)
            if self._rising is None and now - self._last_sent > self._pace.word:
                self._intensity = 0
                self._send(put, self._phases, 0, self._array.units.now() + round(self._pace.hold * _NS), -1)
        while self._waiting:
            self._check()
            self._send_waiting(put)
            time.sleep(5e-4)
        self._fade(put)
        time.sleep(self._pace.hold)
        self._collect_sending_times()

    def _play(self, put: Put, at: int, taken: float) -> None:
        """Form and send the frame `at` of those of a sensor frame; it was sampled at `taken`."""
        began = time.monotonic()
        if began - self._asked > 0.5:
            self._asked = began
            self._ahead = self._array.units.now() - time.monotonic_ns()
        if self._rising is None:
            # Silence hides the step to a new grid, which a pause of the sensor may require.
            self._times.restart()
        instant = self._times.instant(self._formed * self._next + at, round(taken * _NS) + self._ahead)
        flags = 0
        left = (instant - time.monotonic_ns() - self._ahead) / _NS
        if left <= self._pace.enough:
            self._ring.miss("late", self._next / self._sensor.rate)
            self._write(at, taken, instant, FRAME_LATE)
            return
        if self._rising is None:
            self._rising = taken
        hurried = left < self._pace.hold / 2
        if self._array.paused:
            # Units are too hot: the frame is dropped, and the level rises again afterwards.
            self._intensity, self._rising = 0, None
            self._ring.add("hot")
        elif self._touch.form(at, hurried=hurried):
            self._ring.add("hurried", int(hurried))
            gain = self._level_rise(taken) * min(1.0, self._level())
            if self._steering is not None:
                gain *= self._steering.steer(self._touch.phases, (instant - self._ahead) / _NS)
            self._intensity = int(self._strongest * gain)
            flags |= FRAME_EMITTED if self._intensity else 0
        else:
            self._intensity = 0
        self._waiting.append((self._ring.count("head"), instant))
        self._write(at, taken, instant, flags)
        self._send_waiting(put)
        self._ring.time("work", time.monotonic() - began)
        self._collect_sending_times()

    def _send_waiting(self, put: Put) -> None:
        """Send the frames that the units can queue now."""
        while self._waiting:
            number, instant = self._waiting[0]
            left = (instant - time.monotonic_ns() - self._ahead) / _NS
            if left > self._pace.ahead:
                return
            slot = self._ring[number]
            if left <= 0:
                self._ring.miss("late", self._next / self._sensor.rate)
                self._ring.add("played", -int(slot["flags"] & FRAME_EMITTED > 0))
                slot["flags"] |= FRAME_LATE
            elif self._send(put, slot["phases"], int(slot["intensity"]), instant, number) and not self._array.paused:
                self._latest = time.monotonic()
            else:
                self._silence_waiting()
            self._waiting.popleft()

    def _silence_waiting(self) -> None:
        """Take the sound from frames that are not sent, since the level rises again."""
        for number, _ in self._waiting:
            slot = self._ring[number]
            self._ring.add("played", -int(slot["flags"] & FRAME_EMITTED > 0))
            slot["flags"], slot["intensity"] = int(slot["flags"]) & ~FRAME_EMITTED, 0

    def _level_rise(self, taken: float) -> float:
        """Fraction of the level's rise at a frame, 0 to 1; with jitter a time stamp may precede the first."""
        if self._rising is None or self._pace.rise <= 0:
            return 1.0
        return min(1.0, max(0.0, (taken - self._rising) / self._pace.rise))

    def _send(self, put: Put, phases: NDArray[np.uint8], intensity: int, instant: int, slot: int) -> bool:
        """Send phases and store the frame's number in the ring; return False if the units are silent."""
        try:
            put(phases.reshape(self._array.placement.units, -1), intensity, instant)
        except SilentFramesError as silenced:
            self._resume(silenced)
            return False
        self._last_instant = instant
        self._put_slots[self._puts % 64] = slot
        self._puts += 1
        self._last_sent = time.monotonic()
        return True

    def _resume(self, silenced: SilentFramesError) -> None:
        """Continue after the units' failsafe has silenced them, because this computer was busy; the level rises."""
        now = time.monotonic()
        self._trips = [*(at for at in self._trips if at > now - 10), now]
        if len(self._trips) > self._pace.trips:
            raise silenced
        self._array.resume()
        self._intensity, self._rising = 0, None

    def _write(self, at: int, taken: float, instant: int, flags: int) -> None:
        ring = self._ring
        slot = ring.next_slot()
        slot["number"], slot["taken"] = self._formed * self._next + at, taken
        slot["instant"], slot["left"] = instant, 0
        count = len(self._frame)
        slot["samples"][:count], slot["pressure"][:count] = self._frame, self._touch.pressure[at]
        slot["flags"], slot["intensity"] = flags, self._intensity if flags & FRAME_EMITTED else 0
        slot["phases"] = self._phases
        ring.publish()
        ring.add("frames")
        if flags & FRAME_EMITTED and not flags & FRAME_LATE:
            ring.add("played")

    def _collect_sending_times(self) -> None:
        while self._looked < self._puts:
            left = self._array.units.sent(self._looked)
            if not left and self._puts - self._looked < 32:
                break
            number = int(self._put_slots[self._looked % 64])
            self._looked += 1
            if number < 0:
                continue
            slot = self._ring[number]
            slot["left"] = left
            if left:
                self._ring.time("left", left * 1e-9 - float(slot["taken"]))
        told = self._array.units.counts()
        self._ring.put("unanswered", told["lost"] + told["late"] + told["crowded"])
        self._ring.put("failsafe", told["failsafe"])

    def _fade(self, put: Put) -> None:
        """Fade to silence; the level rises again afterwards."""
        self._silence_waiting()
        self._waiting.clear()
        loud, steps = self._intensity, max(1, round(self._pace.fade * _NS / self._period))
        soon = self._array.units.now() + round(min(self._pace.hold, self._pace.ahead) * _NS / 2)
        # After all frames that the units still hold.
        begin = max(soon, self._last_instant + self._period)
        for step in range(1, steps + 1):
            self._intensity = loud * (steps - step) // steps
            if not self._send(put, self._phases, self._intensity, begin + (step - 1) * self._period, -1):
                break
            time.sleep(self._period / _NS)
        self._rising = None
