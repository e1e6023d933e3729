"""Settings, state and result of a take, drift of its clocks, its observers, and event messages."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import scipy

from midair.errors import MidairError
from midair.files import OpenedTake, load_sensor
from midair.model import Event, SensorGrid, SensorWiring
from midair.rig.takes.meters import Levels
from midair.validation import Declared, check_settings, documented, setting

LARGEST = 256
"""Maximum number of points of the fitted line; beyond it, neighbours are merged, which bounds the memory."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Drift:
    """Drift of a clock against this computer's."""

    ppm: float
    """Drift in parts per million; positive if the clock is faster."""
    uncertainty: float
    """Two standard errors of the slope, in parts per million."""
    span: float
    """Observed time in s."""
    points: int = 1000
    """Number of points of the line."""

    @property
    def certain(self) -> bool:
        """Whether the drift exceeds rounding, and by Student's t what jitter alone causes in one of 10,000 looks.

        A recording looks again every second, so that a limit of two standard errors would soon be exceeded by chance.
        """
        errors = float(scipy.special.stdtrit(self.points - 2, 1 - 0.5e-4))
        return abs(self.ppm) > max(errors * self.uncertainty / 2, 0.01)


class ClockWatch:
    """Compares a device's clock, or its frame count over its rate, with this computer's.

    Blocks arrive with varying delay, never early. So of each second only the least delayed reading counts (the lower
    envelope of the delay; V. Paxson, "On calibrating measurements of packet transit times", SIGMETRICS 1998), and the
    drift is the slope of a least-squares line through them.
    """

    def __init__(self, *, every: float = 1.0) -> None:
        self._every = every
        self._begin: tuple[float, float] | None = None
        self._points: list[tuple[float, float]] = []  # (host time, lead of the device) since begin, in s
        self._cell, self._best = 0, (0.0, -np.inf)

    def add(self, device: float, host: float) -> None:
        """Add a reading of both clocks in s."""
        if self._begin is None:
            self._begin = device, host
        t = host - self._begin[1]
        ahead = device - self._begin[0] - t
        if int(t / self._every) > self._cell:
            self._keep()
            self._cell = int(t / self._every)
        if ahead > self._best[1]:
            self._best = t, ahead

    def drift(self) -> Drift | None:
        """Drift so far; None before there are five points."""
        if len(self._points) < 5:
            return None
        t, ahead = np.array(self._points).T
        t = t - t.mean()
        slope = float(t @ ahead / (t @ t))
        rest = ahead - ahead.mean() - slope * t
        error = float(np.sqrt(rest @ rest / (len(t) - 2) / (t @ t)))
        return Drift(ppm=1e6 * slope, uncertainty=2e6 * error, span=float(np.ptp(t)), points=len(t))

    def _keep(self) -> None:
        if self._best[1] > -np.inf:
            self._points.append(self._best)
        self._best = 0.0, -np.inf
        if len(self._points) >= LARGEST:
            pairs = zip(self._points[::2], self._points[1::2], strict=True)
            self._points = [max(pair, key=lambda point: point[1]) for pair in pairs]
            self._every *= 2


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class RecordSettings(Declared):
    """Settings of one take of a sensor or of several, in SI units; InputError if a value is out of range."""

    sensor: str = setting("virtual:towel", "Sensor, as in midair record.", option="")
    duration: float | None = setting(None, "Length of a take.", unit="s", limits=(0, np.inf), above=True)
    level: float | None = setting(
        None,
        "Start when any channel differs from its resting value by this much, such as 50mV or 300count.",
        limits=(0, np.inf),
        above=True,
        option="trigger",
        # Read once the sensor, and so its unit, is known.
        typed=str | None,
    )
    pre_roll: float = setting(0.2, "Time to keep before the start, with --trigger or a key.", unit="s", limits=(0, 60))
    post_roll: float | None = setting(
        0.5,
        "With --trigger: end the take when the signal stays below the trigger level for this long.",
        unit="s",
        limits=(0, np.inf),
        above=True,
    )
    repeats: int = setting(
        1, "Number of takes; the paper made five strokes per object and surface.", limits=(1, np.inf)
    )
    pause: float | None = setting(None, "Pause between takes that start automatically.", unit="s", limits=(0, np.inf))
    wiring: SensorWiring | None = setting(
        None,
        "Sensor file NAME.toml: the cell of each channel, unit and full scale.",
        load=load_sensor,
        option="sensor-file",
    )
    real_time: bool = setting(False, "Let a virtual or replayed sensor run in real time.")
    seed: int = setting(0, "Random seed of a virtual sensor: noise and texture.")

    def __post_init__(self) -> None:
        check_settings(self)


TakeOrder = Literal["toggle", "quit", "kill"]
"""User command: start or stop this take; stop, and make no more takes; stop because of a signal."""
EndReason = Literal["duration", "source", "toggle", "quiet", "quit", "kill", "stroke", "failure"]
"""Reason for the end of a take: duration reached, end of the source, key, silence, quit, signal, end of the stroke,
or failure."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class View:
    """State of a running take, for display."""

    state: Literal["waiting", "recording"]
    frames: int
    """Number of recorded frames so far."""
    wanted: int | None
    """Planned number of frames, if known."""
    lost: int
    """Number of lost frames since the sensor's start."""
    levels: Levels
    rate: Drift | None
    """Drift of the frame count against this computer's clock."""
    clock: Drift | None
    """Drift of the device's clock against this computer's."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Take:
    """Result of a take."""

    path: Path | None
    """Path of the recording; None without a file, or if the take ended before it began."""
    memory: OpenedTake | None
    """The recording, if it was made without a file."""
    frames: int
    """Number of recorded frames."""
    lost: int
    """Number of replaced frames among them."""
    end: EndReason
    """Reason for the end."""
    error: MidairError | None
    """Error that ended the take, if any."""
    levels: Levels
    lowest: float
    """Lowest recorded sample, in the sensor's unit."""
    highest: float
    """Highest recorded sample, in the sensor's unit."""
    rate: Drift | None
    clock: Drift | None

    @property
    def problem(self) -> str:
        """Message of the error that ended the take, or ""."""
        return "" if self.error is None else str(self.error)


class TakeObserver:
    """User interface of a take; gives no commands and shows nothing by itself."""

    def order(self) -> TakeOrder | None:
        """Return the command since the last call."""

    def show(self, view: View) -> None:
        """Display the state; called for every block."""

    def tell(self, event: Event, drift: Drift | None = None, /) -> None:
        """Report an event; its frame is counted from the sensor's start. A DeviceError that it raises ends the take."""


def event_message(event: Event, rate: float, grid: SensorGrid, drift: Drift | None = None) -> str:
    """One sentence for an event of a sensor with `rate` frames per second."""
    row, column = divmod(max(event.channel, 0), grid.columns)
    channel = f"channel {event.channel} (row {row}, column {column})"
    words = {
        "lost": _lost(event, rate),
        "clipped": f"{channel} clips: reduce its gain, or press less",
        "dead": f"{channel} is dead: it has never changed; check its wire",
        "stuck": f"{channel} is stuck: it changed before; check its wire",
        "rate": f"frames come {_drift(event.ppm, drift)} than {rate:g} a second, by this computer's clock",
        "clock": f"the sensor's clock runs {_drift(event.ppm, drift)} than this computer's",
        "trigger": "touched",
        "stroke": f"a stroke of {event.frames / rate:.3f} s",
        "mended": f"{event.frames} missing frames of {channel} were filled",
        "late": f"{event.frames} frames of live touch were not played in time",
    }
    return f"{event.frame / rate:.3f} s: {words[event.kind]}"


def take_problems(take: Take, rate: float) -> list[tuple[str, str]]:
    """Problems of a take as (name, value) pairs; empty for a good take."""
    levels = take.levels
    rows: list[tuple[str, str]] = []
    if take.lost:
        share = 100 * take.lost / max(1, take.frames)
        rows.append(("lost", f"{take.lost} frames ({share:.2g} %), replaced by the last good one; the file lists them"))
    for name, channels in (("clipped", levels.clipped > 0), ("dead", levels.dead), ("stuck", levels.stuck)):
        if channels.any():
            rows.append((f"{name} channels", ", ".join(str(i) for i in channels.nonzero()[0])))
    for name, drift in (("frames per second", take.rate), ("sensor's clock", take.clock)):
        if drift is not None and drift.certain:
            actual = f"{rate * (1 + drift.ppm * 1e-6):.7g} Hz, " if name == "frames per second" else ""
            rows.append((name, f"{actual}{drift.ppm:+.3g} ± {drift.uncertainty:.2g} ppm against this computer's"))
    if take.problem:
        rows.append(("ended by", take.problem))
    return rows


def _lost(event: Event, rate: float) -> str:
    if event.frames == 0:
        return (
            "frames may be missing: the sensor lost an unknown number, or its time stamps jumped; later times are "
            "uncertain"
        )
    return f"{event.frames} frames ({1e3 * event.frames / rate:.4g} ms) were lost; the last good one is repeated"


def _drift(ppm: float, drift: Drift | None) -> str:
    spread = "" if drift is None else f" ± {drift.uncertainty:.2g}"
    return f"{abs(ppm):.4g}{spread} ppm {'faster' if ppm > 0 else 'slower'}"
