"""The sensor process: it reads the sensor all the time, sends its frames, and writes takes."""

import os
import sys
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.devices import FrameBlock, SensorDevice, WrappedSensor
from midair.errors import MidairError
from midair.model import Event
from midair.rig import (
    Drift,
    RecordSettings,
    TakeObserver,
    TakeOrder,
    TapTest,
    View,
    VirtualRig,
    assignment_problems,
    event_message,
    identify_by_taps,
    record_take,
    sensor_named,
    streamed,
    take_problems,
)
from midair.studio.worker_process import StudioPipe
from midair.view import Kind, encode_counts, pack

STEP = 1 / 120
"""Seconds of samples per message: two 60 Hz clocks would beat against each other."""


STROKE = 1.6
"""Duration in s of the stroke of a virtual sensor, which is repeated: it computes everything since its start."""


def run_sensor(pipe: StudioPipe, name: str, seed: int) -> None:
    """Main function of the sensor process, which ends with its studio.

    The requests are "take" with `RecordSettings`, path and notes, "toggle" and "taps"; the events are frames,
    levels and messages.
    """
    try:
        with _named(name, seed) as sensor:
            _SensorLoop(pipe, sensor, name, seed).run()
    except MidairError as wrong:
        pipe.send("lost", error=str(wrong))
    finally:
        os._exit(0)


def _named(name: str, seed: int) -> SensorDevice:
    made = sensor_named(name, VirtualRig(seed=seed))
    if name.startswith("virtual:"):
        return streamed(made, longest=STROKE)
    return WrappedSensor(made, paced=True) if made.on_demand else made


class _MirroredSensor(WrappedSensor):
    """Wraps an open sensor and sends a copy of its frames to the page."""

    def __init__(self, sensor: SensorDevice, pipe: StudioPipe) -> None:
        super().__init__(sensor)
        self.calibration, self.wiring, self.on_demand = sensor.calibration, sensor.wiring, sensor.on_demand
        self._pipe = pipe
        self._rest: NDArray[np.float64] | None = None

    def open(self) -> None:
        """Do nothing: the sensor is open."""

    def read(self, frames: int) -> FrameBlock:
        """Return the next frames of the sensor, and send a copy."""
        block = self._sensor.read(frames)
        if len(block.samples):
            rows = block.samples.reshape(len(block.samples), -1)
            mean = rows.mean(axis=0)
            # Traces are drawn around a slow mean, so that an offset does not show as signal.
            rest = self._rest = mean if self._rest is None else 0.99 * self._rest + 0.01 * mean
            section = encode_counts(rows - rest, Kind.SAMPLES, first=block.first, rate=self.rate)
            self._pipe.send("frames", data=[pack([section])])
        return block

    def close(self) -> None:
        """Do nothing: the owner of the sensor closes it."""


class _SensorLoop:
    """Main loop: requests in, frames and takes out."""

    def __init__(self, pipe: StudioPipe, sensor: SensorDevice, name: str, seed: int) -> None:
        self._pipe, self._sensor, self._name, self._seed = pipe, sensor, name, seed

    def run(self) -> None:
        """Read the sensor and record the requested takes."""
        sensor = self._sensor
        self._pipe.send(
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
        while (request := self._wait()) is not None:
            if request["do"] == "taps":
                self._taps()
            elif request["do"] == "take":
                self._take(request)

    def _wait(self) -> dict[str, Any] | None:
        """Send frames until a request comes; uses a take that waits for a key and is never begun."""
        watcher = _PageObserver(self._pipe, self._sensor, idle=True)
        while not watcher.over:
            try:
                record_take(_MirroredSensor(self._sensor, self._pipe), RecordSettings(), watcher, key=True, block=STEP)
            except MidairError as wrong:
                self._pipe.send("lost", error=str(wrong))
                # A sensor that was unplugged may come back.
                if self._pipe.poll(1.0):
                    return self._pipe.receive()
        return watcher.request

    def _take(self, request: Mapping[str, Any]) -> None:
        sensor, watcher = _MirroredSensor(self._sensor, self._pipe), _PageObserver(self._pipe, self._sensor)
        try:
            take = record_take(
                sensor, request["settings"], watcher, path=request["path"], notes=request["notes"], block=STEP
            )
        except MidairError as wrong:
            self._pipe.send("failed", error=str(wrong))
            return
        rate = self._sensor.rate
        self._pipe.send(
            "taken",
            path="" if take.path is None else str(take.path),
            frames=take.frames,
            duration_s=take.frames / rate,
            lost=take.lost,
            end=take.end,
            problems=[list(row) for row in take_problems(take, rate)],
        )

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
            self._pipe.send("failed", error=str(wrong))
            return
        self._pipe.send(
            "identified",
            channel=[-1 if each is None else each for each in found.channel],
            margin=[float(min(each, 99.0)) for each in found.margin],
            dead=list(found.dead),
            doubtful=list(found.doubtful),
            findings=assignment_problems(found),
            in_order=bool(found.in_order),
        )

    def _prompt(self, cell: int) -> None:
        if not self._pipe.send("tap", cell=cell):
            sys.exit()


class _PageObserver(TakeObserver):
    """Observer of a take: requests in, levels and messages out."""

    def __init__(self, pipe: StudioPipe, sensor: SensorDevice, *, idle: bool = False) -> None:
        self._pipe, self._sensor, self._idle = pipe, sensor, idle
        self._shown = 0.0
        self.over = False
        self.request: dict[str, Any] | None = None

    def order(self) -> TakeOrder | None:
        """Return the request that came since the last call."""
        if not self._pipe.poll():
            return None
        request = self._pipe.receive()
        if request is not None and not self._idle and request["do"] == "toggle":
            return "toggle"
        self.over, self.request = True, request
        return "quit"

    def show(self, view: View) -> None:
        """Send the levels 15 times per second."""
        now = time.monotonic()
        if now - self._shown < 1 / 15:
            return
        self._shown = now
        self._pipe.send(
            "levels",
            state="listening" if self._idle else view.state,
            frames=view.frames,
            wanted=view.wanted,
            lost=view.lost,
            drift_ppm=None if view.rate is None or not view.rate.certain else round(view.rate.ppm, 1),
            **{name: np.round(getattr(view.levels, name), 6).tolist() for name in ("rms", "peak", "highest")},
            **{name: getattr(view.levels, name).tolist() for name in ("clipped", "dead", "stuck")},
        )

    def tell(self, event: Event, drift: Drift | None = None, /) -> None:
        """Send an event."""
        said = event_message(event, self._sensor.rate, self._sensor.grid, drift)
        self._pipe.send("event", event=event.kind, channel=event.channel, said=said)
