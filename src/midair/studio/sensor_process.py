"""The sensor process: it reads the sensor all the time, sends its frames, and writes takes."""

import contextlib
import os
import signal
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.devices import FrameBlock, PacedSensor, SensorDevice
from midair.errors import MidairError
from midair.model import Event
from midair.rig import (
    Drift,
    Levels,
    Take,
    TakeOrder,
    TakePlan,
    TapTest,
    View,
    VirtualRig,
    assignment_problems,
    event_message,
    identify_by_taps,
    record_take,
    sensor_named,
    take_problems,
)

STEP = 1 / 120
"""Seconds of samples per message: two 60 Hz clocks would beat against each other."""


class RepeatedStroke(SensorDevice):
    """Repeats one stroke (`duration` in s) of an open virtual sensor endlessly.

    A virtual sensor computes everything since its start, which would take longer and longer.
    """

    def __init__(self, sensor: SensorDevice, duration: float = 1.6) -> None:
        self._sensor, self._duration = sensor, duration
        self.name, self.grid, self.rate, self.unit = sensor.name, sensor.grid, sensor.rate, sensor.unit
        self.calibration, self.simulated, self.full_scale = sensor.calibration, sensor.simulated, sensor.full_scale
        self.stored = sensor.stored
        self._samples: NDArray[np.float64] | None = None
        self._next = 0

    def open(self) -> None:
        """Open the wrapped sensor."""
        self._sensor.open()

    def start(self) -> None:
        """Start at the beginning of the stroke."""
        if self._samples is None:
            self._sensor.start()
            self._samples = np.array(self._sensor.read(round(self._duration * self.rate)).samples)
            self._sensor.stop()
        self._next = 0

    def read(self, frames: int) -> FrameBlock:
        """Return the next frames."""
        if self._samples is None:
            self.start()
        kept = np.zeros((1, *self.grid.shape)) if self._samples is None else self._samples
        first, self._next = self._next, self._next + frames
        now = first / self.rate
        samples = kept[np.arange(first, self._next) % len(kept)]
        return FrameBlock(samples=samples, first=first, device_time=now, host_time=now)

    def stop(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Close the wrapped sensor."""
        self._sensor.close()


@dataclass(frozen=True, slots=True, kw_only=True)
class TakeRequest:
    """A take to record into the file `path`; the fields are those of `TakePlan`."""

    path: str
    start: Any = "at once"
    duration: float | None = None
    level: float | None = None
    pre_roll: float = 0.0
    post_roll: float | None = None
    notes: Mapping[str, str] = field(default_factory=dict[str, str])


def run_sensor(pipe: Connection, name: str, seed: int) -> None:
    """Main function of the sensor process, which ends with its studio.

    The pipe carries a `TakeRequest`, "toggle", "quit" or "taps" in, and frames, levels and messages out.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        sensor = _named(name, seed)
        with sensor:
            _SensorLoop(pipe, sensor, name, seed).run()
    except MidairError as wrong:
        _send(pipe, "lost", error=str(wrong))
    except (EOFError, OSError):
        pass
    finally:
        with contextlib.suppress(OSError):
            pipe.close()
        os._exit(0)


def _named(name: str, seed: int) -> SensorDevice:
    made = sensor_named(name, VirtualRig(seed=seed))
    if name.startswith("virtual:"):
        return PacedSensor(RepeatedStroke(made))
    return PacedSensor(made) if made.on_demand else made


class _MirroredSensor(SensorDevice):
    """Wraps an open sensor and sends a copy of its frames to the page."""

    def __init__(self, sensor: SensorDevice, pipe: Connection) -> None:
        self._sensor, self._pipe = sensor, pipe
        self.name, self.grid, self.rate, self.unit = sensor.name, sensor.grid, sensor.rate, sensor.unit
        self.calibration, self.simulated, self.full_scale = sensor.calibration, sensor.simulated, sensor.full_scale
        self.wiring, self.on_demand, self.stored = sensor.wiring, sensor.on_demand, sensor.stored
        self._rest: NDArray[np.float64] | None = None

    def open(self) -> None:
        """Do nothing: the sensor is open."""

    def start(self) -> None:
        self._sensor.start()

    def read(self, frames: int) -> FrameBlock:
        block = self._sensor.read(frames)
        if len(block.samples):
            rows = block.samples.reshape(len(block.samples), -1)
            mean = rows.mean(axis=0)
            # Traces are drawn around a slow mean, so that an offset does not show as signal.
            rest = self._rest = mean if self._rest is None else 0.99 * self._rest + 0.01 * mean
            _send(self._pipe, "frames", first=block.first, rows=(rows - rest).astype(np.float32))
        return block

    def stop(self) -> None:
        self._sensor.stop()

    def close(self) -> None:
        """Do nothing: the owner of the sensor closes it."""


class _SensorLoop:
    """Main loop: requests in, frames and takes out."""

    def __init__(self, pipe: Connection, sensor: SensorDevice, name: str, seed: int) -> None:
        self._pipe, self._sensor, self._name, self._seed = pipe, sensor, name, seed
        self._shown = 0.0
        self._pending: list[Any] = []

    def run(self) -> None:
        """Read the sensor and record the requested takes."""
        sensor = self._sensor
        _send(
            self._pipe,
            "open",
            sensor=sensor.name,
            rate_hz=sensor.rate,
            rows=sensor.grid.rows,
            columns=sensor.grid.columns,
            pitch_mm=1e3 * sensor.grid.pitch,
            unit=sensor.unit,
            full_scale=sensor.full_scale,
            simulated=sensor.simulated,
            calibrated=sensor.calibration is not None,
        )
        while True:
            request = self._wait()
            if request == "quit":
                return
            if request == "taps":
                self._taps()
            elif isinstance(request, TakeRequest):
                self._take(request)

    def _wait(self) -> Any:
        """Send frames until a request comes; uses a take that waits for a key and is never begun."""
        watcher = _TakeObserver(self._pipe, self._sensor, idle=True)
        nowhere = Path(os.devnull)
        while watcher.request is None:
            try:
                record_take(
                    _MirroredSensor(self._sensor, self._pipe), TakePlan(path=nowhere, start="key", block=STEP), watcher
                )
            except MidairError as wrong:
                _send(self._pipe, "lost", error=str(wrong))
                # A sensor that was unplugged may come back.
                if self._pipe.poll(1.0):
                    return self._pipe.recv()
        return watcher.request

    def _take(self, request: TakeRequest) -> None:
        plan = TakePlan(
            path=Path(request.path),
            start=request.start,
            duration=request.duration,
            level=request.level,
            pre_roll=request.pre_roll,
            post_roll=request.post_roll,
            notes=dict(request.notes),
            block=STEP,
        )
        watcher = _TakeObserver(self._pipe, self._sensor)
        try:
            take = record_take(_MirroredSensor(self._sensor, self._pipe), plan, watcher)
        except MidairError as wrong:
            _send(self._pipe, "failed", error=str(wrong))
            return
        _send(self._pipe, "taken", **_take_info(take, self._sensor.rate))
        if watcher.request is not None:
            self._pending.append(watcher.request)

    def _taps(self) -> None:
        """Identify the channel of each cell by taps; a virtual sensor simulates them."""
        sensor = self._sensor
        try:
            if self._name.startswith("virtual:"):
                with sensor_named("virtual:taps", VirtualRig(seed=self._seed)) as tapped:
                    found = identify_by_taps(tapped, TapTest(every=1.0), self._prompt)
            else:
                found = identify_by_taps(sensor, TapTest(), self._prompt)
        except MidairError as wrong:
            _send(self._pipe, "failed", error=str(wrong))
            return
        _send(
            self._pipe,
            "identified",
            channel=[-1 if each is None else each for each in found.channel],
            margin=[float(min(each, 99.0)) for each in found.margin],
            dead=list(found.dead),
            doubtful=list(found.doubtful),
            findings=assignment_problems(found),
            in_order=bool(found.in_order),
        )

    def _prompt(self, cell: int) -> None:
        _send(self._pipe, "tap", cell=cell)


class _TakeObserver:
    """Observer of a take: requests in, levels and messages out."""

    def __init__(self, pipe: Connection, sensor: SensorDevice, *, idle: bool = False) -> None:
        self._pipe, self._sensor, self._idle = pipe, sensor, idle
        self._shown = 0.0
        self.request: Any = None

    def order(self) -> TakeOrder | None:
        """Return the request that came since the last call."""
        if not self._pipe.poll():
            return None
        said = self._pipe.recv()
        if self._idle:
            self.request = said
            return "quit"
        if said == "toggle":
            return "toggle"
        self.request = said
        return "quit"

    def show(self, view: View) -> None:
        """Send the levels 15 times per second."""
        now = time.monotonic()
        if now - self._shown < 1 / 15:
            return
        self._shown = now
        _send(
            self._pipe,
            "levels",
            state="listening" if self._idle else view.state,
            frames=view.frames,
            wanted=view.wanted,
            lost=view.lost,
            drift_ppm=None if view.rate is None or not view.rate.certain else round(view.rate.ppm, 1),
            **_levels(view.levels),
        )

    def tell(self, event: Event, drift: Drift | None = None) -> None:
        """Send an event."""
        said = event_message(event, self._sensor.rate, self._sensor.grid, drift)
        _send(self._pipe, "event", event=event.kind, channel=event.channel, said=said)


def _levels(levels: Levels) -> dict[str, Any]:
    return {
        "rms": np.round(levels.rms, 6).tolist(),
        "peak": np.round(levels.peak, 6).tolist(),
        "highest": np.round(levels.highest, 6).tolist(),
        "clipped": levels.clipped.tolist(),
        "dead": levels.dead.tolist(),
        "stuck": levels.stuck.tolist(),
    }


def _take_info(take: Take, rate: float) -> dict[str, Any]:
    return {
        "path": "" if take.path is None else str(take.path),
        "frames": take.frames,
        "duration_s": take.frames / rate,
        "lost": take.lost,
        "end": take.end,
        "problems": [list(row) for row in take_problems(take, rate)],
    }


def _send(pipe: Connection, kind: str, **said: Any) -> None:
    pipe.send({"kind": kind, **said})
