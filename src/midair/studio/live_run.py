"""Live touch in the player: starts the loop, reads its frames, keeps the last minute.

The loop is a child process, so that nothing here can delay it; it goes silent when the player ends. The sound field
that the page shows is computed here, not in the server.
"""

import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.devices import Cooling, PlayLease, amplitude_of
from midair.errors import DeviceStateError, ExposureError, InputError, MidairError
from midair.model import RATE, ControlGrid
from midair.physics import transfer_matrix
from midair.rig import (
    FRAME_EMITTED,
    FRAME_LATE,
    FRAME_REPEATED,
    LiveSession,
    LiveSettings,
    LiveTake,
    LoopStarted,
    live,
    live_clearance,
    measured_transducers,
)
from midair.solvers import one_blas_thread
from midair.studio.take_data import cleared_facts, exposed
from midair.studio.worker_process import NO_ANSWER, StudioPipe
from midair.view import Kind, Section, encode_counts, fit_interpolation, pack

EVERY = 1 / 120
"""Seconds of frames per message: two 60 Hz clocks would beat against each other."""

PHASES = 15.0
"""Messages with the phases of the array per second; the page draws no more."""

REMEMBERED = 60.0
"""Seconds that can be saved as a take afterwards."""


class RecentFrames:
    """The last `most` frames of a run, which can be saved as a take afterwards."""

    def __init__(self, channels: int, transducers: int, most: int) -> None:
        self._kept = np.dtype(
            [
                ("samples", "f8", (channels,)),
                ("phases", "u1", (transducers,)),
                ("intensity", "u1"),
                ("flags", "u1"),
                ("instant", "i8"),
                ("number", "i8"),
            ]
        )
        self._channels, self._most, self.frames = channels, most, 0
        self._blocks: deque[NDArray[Any]] = deque()

    def add(self, found: NDArray[Any]) -> None:
        """Append frames of the ring."""
        block = np.zeros(len(found), self._kept)
        block["samples"] = found["samples"][:, : self._channels]
        for name in ("phases", "intensity", "flags", "instant", "number"):
            block[name] = found[name]
        self._blocks.append(block)
        self.frames += len(block)
        while self.frames - len(self._blocks[0]) >= self._most:
            self.frames -= len(self._blocks.popleft())

    def clear(self) -> None:
        """Drop all frames: some were missed, and the earlier ones are not contiguous with the next."""
        self._blocks.clear()
        self.frames = 0

    def last(self, frames: int) -> NDArray[Any]:
        """Return a copy of the last frames."""
        blocks = list(self._blocks)
        return np.concatenate(blocks)[-frames:] if blocks else np.zeros(0, self._kept)


class LiveView:
    """Converts frames of the ring to sections for the page."""

    def __init__(self, order: LiveSettings) -> None:
        self.array = measured_transducers(order.device, order.placement, order.array_calibration)
        self.grid: ControlGrid = order.grid
        self._acoustics, self._rate, self._channels = order.acoustics, RATE, 1
        matrix = transfer_matrix(self.grid, self.array, acoustics=self._acoustics)
        self._matrix = np.ascontiguousarray(matrix.T, np.complex64)
        self._turns = np.exp(2j * np.pi * np.arange(256) / 256).astype(np.complex64)
        self._strength = amplitude_of(np.arange(256, dtype=np.uint8)).astype(np.float32)
        # Field of the previous frame: the array held it if the next frame was late.
        self._before = np.zeros((1, self.grid.count), np.complex64)
        self._phases_due = 0

    def found(self, opened: LoopStarted) -> None:
        """Set rate and number of channels once the sensor is open."""
        self._rate, self._channels = opened.schedule.formed * opened.rate, opened.sensor.count

    def about(self) -> dict[str, Any]:
        """Return the geometry that the page needs to draw the sections."""
        fine = fit_interpolation(self.grid, self.array, acoustics=self._acoustics)
        return {
            "grid_rows": self.grid.rows,
            "grid_columns": self.grid.columns,
            "grid_pitch_mm": 1e3 * self.grid.pitch,
            "x_mm": 1e3 * self.grid.centre[0],
            "y_mm": 1e3 * self.grid.centre[1],
            "positions_mm": np.round(1e3 * self.array.position[:, :2], 2).ravel().tolist(),
            "down": np.round(fine.down, 6).ravel().tolist(),
            "across": np.round(fine.across, 6).ravel().tolist(),
        }

    def sections(self, found: NDArray[Any]) -> list[Section]:
        """Return pressure (Pa) and sound field of the frames; 15 times per second also the phases."""
        first = int(found["number"][0])
        pressure = found["pressure"][:, : self._channels]
        made = [
            encode_counts(pressure, Kind.SAMPLES, first=first, rate=self._rate),
            encode_counts(self.sound(found), Kind.FIELD, dtype="i1", first=first, rate=self._rate),
        ]
        last = first + len(found) - 1
        if last >= self._phases_due and found["flags"][-1] & FRAME_EMITTED:
            self._phases_due = last + round(self._rate / PHASES)
            steps = np.array(found["phases"][-1:])
            made.append(
                Section(kind=Kind.PHASES, values=steps, unit=2 * np.pi / 256, first=last, time=last / self._rate)
            )
        return made

    def sound(self, found: NDArray[Any]) -> NDArray[np.complex64]:
        """Complex sound pressure in Pa at the control points, shape (frame, point); a late frame repeats the last."""
        q = self._turns[found["phases"]] * self._strength[found["intensity"]][:, None]
        field = np.asarray(q @ self._matrix, np.complex64)
        for frame in np.flatnonzero(found["flags"] & (FRAME_LATE | FRAME_REPEATED)):
            field[frame] = field[frame - 1] if frame else self._before[0]
        self._before = field[-1:].copy()
        return field


class LiveRun:
    """One run of live touch at a time, whose frames and status go to the studio, and the take of its last seconds."""

    def __init__(self, pipe: StudioPipe, lease: PlayLease) -> None:
        self._pipe, self._lease = pipe, lease
        self._checked: dict[int, LiveSettings] = {}
        self._number = self._seen = 0
        self._past: tuple[LiveSettings, LoopStarted, RecentFrames] | None = None

    def check(self, request: dict[str, Any]) -> dict[str, Any]:
        """Return the worst-case exposure of the level, with a number by which the run may be started."""
        order = LiveSettings().but(**request)
        try:
            clearance = live_clearance(order)
        except ExposureError as wrong:
            # The page shows the excess and the possible remedies.
            return {"number": 0, "refused": wrong.exposure.verdict(), **exposed(wrong.exposure)}
        self._number += 1
        self._checked = {self._number: order}
        return {"number": self._number, "level": clearance.level, **cleared_facts(clearance)}

    @one_blas_thread()
    def play(self, order: dict[str, Any], act: Callable[[dict[str, Any]], Any]) -> dict[str, Any]:
        """Play checked settings with a lease token until the run ends; return the error that ended it, "" without one.

        The event "began" is sent as soon as it plays. Requests other than "end" are handled by `act` meanwhile.
        """
        settings = self._checked.pop(order["clearance"], None)
        if settings is None:
            raise DeviceStateError("live: expected settings that were just checked; check the exposure again")
        self._past = None

        def told(text: str) -> None:
            self._pipe.send("follow" if text.startswith("follow") else "heat", text=text, waits=True)

        token, limit = order["token"], Cooling().limit
        session = live(settings=settings, cooling_limit=limit, lease=(self._lease, token), report=told)
        # Created before the first frame: otherwise frames of that time would arrive all at once.
        sight = LiveView(session.order)
        about = sight.about()
        error = ""
        try:
            with session:
                opened = session.opened
                sight.found(opened)
                most = round(REMEMBERED * opened.schedule.formed * opened.rate)
                kept = RecentFrames(opened.sensor.count, sight.array.count, most)
                self._past = session.order, opened, kept
                self._pipe.send("began", about={**_session_info(session), **about})
                self._watch(session, sight, kept, act)
        except MidairError as wrong:
            if self._past is None:
                raise
            error = str(wrong)
        # Last frames that the loop wrote before it went silent.
        self._hand_on(session, sight, self._past[2])
        self._pipe.send("goes", goes=_status(session), emitting=False)
        return {"error": error}

    def _watch(
        self, session: LiveSession, sight: LiveView, kept: RecentFrames, act: Callable[[dict[str, Any]], Any]
    ) -> None:
        sent, emitting = 0.0, False
        self._seen = 0
        while session.wait(EVERY):
            found = self._hand_on(session, sight, kept)
            emitting = bool(found["intensity"][-1]) if len(found) else emitting
            if time.monotonic() - sent > 0.25:
                sent = time.monotonic()
                self._pipe.send("goes", goes={**_status(session), "remembered": kept.frames}, emitting=emitting)
            while self._pipe.poll():
                order = self._pipe.receive()
                if order is None or order["do"] == "end":
                    return
                self._pipe.handle(order, act)

    def _hand_on(self, session: LiveSession, sight: LiveView, kept: RecentFrames) -> NDArray[Any]:
        """Send new frames to the page and keep them."""
        found, self._seen, missed = session.since(self._seen)
        if missed:
            kept.clear()
        if len(found):
            kept.add(found)
            self._pipe.send("frames", data=[pack([section]) for section in sight.sections(found)])
        return found

    def keep(self, order: dict[str, Any]) -> object:
        """Save the last seconds as a take while the run goes on, and answer then."""
        if self._past is None or not self._past[2].frames:
            raise InputError("keep: expected recorded frames, there are none yet; start live touch first")
        known, opened, kept = self._past
        rate = opened.schedule.formed * opened.rate
        moment = kept.last(round(order["seconds"] * rate))

        def write() -> None:
            with self._pipe.answering(order):
                path, notes = Path(order["path"]), order["notes"]
                take = LiveTake(path, known, opened, lambda seen: (moment[seen:], len(moment), 0), notes)
                take.end()
                take.run()
                take.close()
                found = {"frames": len(moment), "duration_s": len(moment) / rate}
                self._pipe.answer(order, {"name": path.name, **found})

        threading.Thread(target=write, name="keep").start()
        return NO_ANSWER


def _session_info(session: LiveSession) -> dict[str, Any]:
    opened, order = session.opened, session.order
    grid = opened.sensor
    return {
        "sensor": order.sensor,
        "rows": grid.rows,
        "columns": grid.columns,
        "pitch_mm": 1e3 * grid.pitch,
        "rate_hz": opened.schedule.formed * opened.rate,
        "device": order.device,
        "transducers": opened.transducers,
        "simulated": opened.simulated,
        "level": opened.level,
        "exposure": opened.exposure,
        "computer": opened.granted,
        "array_calibration": opened.array_calibration,
        "height_mm": 1e3 * order.height,
        "air_c": order.acoustics.medium.degrees,
        "hold_ms": 1e3 * opened.schedule.hold,
        "errors": [
            [f"{low:g} to {high:g} Hz", round(100 * error, 1)]
            for (low, high), error in zip(opened.parts, opened.error, strict=True)
        ],
    }


def _status(session: LiveSession) -> dict[str, Any]:
    """Return the statistics for the page; the hold time is split into work and waiting."""
    try:
        values = session.statistics.plain()
    except DeviceStateError:
        return {}
    parts, left = dict(values["latency_parts_ms"]), values["left_ms"]["half"]
    hold = parts.pop("hold")
    worked = min(left or 0.0, hold)
    named = []
    for name, value in parts.items():
        if name == "rise and air":
            named += [["work and sending", worked], ["waits its turn", hold - worked]]
        named.append([name, value])
    return {**values, "parts": [[name, round(value, 2)] for name, value in named]}
