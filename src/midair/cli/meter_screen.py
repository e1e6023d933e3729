"""Level meters in the terminal during a take, or plain lines without a terminal."""

import time
from collections.abc import Generator
from contextlib import contextmanager

import numpy as np
from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from midair.cli.keys import Keys, Signals
from midair.cli.options import Quiet
from midair.devices import SensorDevice
from midair.files import printable
from midair.model import Event
from midair.rig import Drift, Levels, TakeOrder, View, event_message

WIDTH = 8
"""Width of a bar in characters."""
RANGE = 80.0
"""Range of a bar in dB."""


class MeterScreen:
    """The watcher of a take: draws meters, prints events, and turns keys and signals into orders."""

    def __init__(
        self,
        sensor: SensorDevice,
        console: Console,
        keys: Keys,
        signals: Signals,
        *,
        quiet: Quiet = False,
        every: float = 10.0,
    ) -> None:
        self._sensor, self._console, self._keys, self._signals = sensor, console, keys, signals
        self._quiet, self._every = quiet, every
        self._title = ""
        self._shown = -np.inf
        self._clipped: set[int] = set()
        self._live: Live | None = None

    @contextmanager
    def take(self, title: str) -> Generator[None]:
        """Watch a take of this name; the meters disappear at the end."""
        self._title, self._shown = title, -np.inf
        self._clipped.clear()
        if not (self._console.is_terminal and not self._quiet):
            if not self._quiet:
                self._say(title)
            yield
            return
        with Live(console=self._console, auto_refresh=False, transient=True) as self._live:
            try:
                yield
            finally:
                self._live = None

    def order(self) -> TakeOrder | None:
        """Order given by a key or a signal."""
        if self._signals.came:
            return "kill"
        keys = self._keys.pressed()
        if "q" in keys or "Q" in keys:
            return "quit"
        return "toggle" if set(keys) & {" ", "\n", "\r"} else None

    def ends(self) -> bool:
        """Whether a key or a signal ends the session."""
        return self.order() in ("quit", "kill")

    def asks(self, question: str) -> bool:
        """Wait for a key to continue, if keys can be read; False if a key or a signal ends the session."""
        if self._keys.active:
            self._say(f"{question}, q: end")
            while (order := self.order()) is None:
                time.sleep(0.05)
            return order == "toggle"
        return not self.ends()

    def show(self, view: View) -> None:
        """Draw the meters at most ten times a second, or print a line every `every` seconds."""
        now = time.monotonic()
        if self._live is not None and now - self._shown >= 0.1:
            self._shown = now
            self._live.update(meters(view, self._sensor, self._title, keys=self._keys.active), refresh=True)
        elif self._live is None and not self._quiet and now - self._shown >= self._every:
            if self._shown > 0:
                self._say(f"{state_line(view, self._sensor.rate)}, lost {view.lost} frames")
            self._shown = now

    def tell(self, event: Event, drift: Drift | None = None) -> None:
        """Print an event; clipping of a channel is printed once per take."""
        if event.kind == "clipped":
            if event.channel in self._clipped:
                return
            self._clipped.add(event.channel)
        if not (self._quiet and event.kind == "trigger"):
            self._say(event_message(event, self._sensor.rate, self._sensor.grid, drift))

    def _say(self, line: str) -> None:
        self._console.print(printable(line), markup=False, highlight=False)


def meters(view: View, sensor: SensorDevice, title: str, *, keys: bool = False) -> RenderableType:
    """State, a meter for each cell in its position, and the lost frames."""
    head = Text.assemble(
        ("● REC " if view.state == "recording" else "○ waiting ", "bold red" if view.state == "recording" else "bold"),
        (printable(title), ""),
        ("  SIMULATED" if sensor.simulated else "", "bold red"),
    )
    foot = Text(", ".join((state_line(view, sensor.rate), f"lost {view.lost} frames", *clock_lines(view))))
    hint = "space or Enter: " + ("stop" if view.state == "recording" else "start") + ", q: end"
    return Group(head, _grid(view.levels, sensor), foot, *((Text(hint, style="dim"),) if keys else ()))


def state_line(view: View, rate: float) -> str:
    """Recorded time, and the total if known."""
    if view.state == "waiting":
        return "not yet recording"
    whole = "" if view.wanted is None else f" of {view.wanted / rate:.1f}"
    return f"{view.frames / rate:.1f}{whole} s"


def clock_lines(view: View) -> list[str]:
    """Measured clock drifts."""
    named = (("frames", view.rate), ("clock", view.clock))
    return [f"{name} {drift.ppm:+.0f} ± {drift.uncertainty:.0f} ppm" for name, drift in named if drift is not None]


def decibels(level: float, reference: float) -> float:
    """A level in dB re `reference`, at least -99."""
    return max(-99.0, 20 * float(np.log10(max(level, 1e-30) / reference)))


def _grid(levels: Levels, sensor: SensorDevice) -> RenderableType:
    """A meter for each cell; wide grids are broken into lines of four."""
    columns = min(sensor.grid.columns, 4)
    reference = sensor.full_scale or max(float(levels.highest.max()), 1e-30)
    table = Table.grid(padding=(0, 1))
    cells = [_cell(i, levels, reference) for i in range(sensor.grid.count)]
    for first in range(0, len(cells), columns):
        table.add_row(*cells[first : first + columns])
    under = "full scale" if sensor.full_scale else "the strongest so far"
    return Group(table, Text(f"rms in dB under {under} ({reference:.3g} {sensor.unit}); | is the peak", style="dim"))


def _cell(channel: int, levels: Levels, reference: float) -> Text:
    number = f"{channel:2d} "
    for name, flags in (("dead", levels.dead), ("still", levels.stuck)):
        if flags[channel]:
            return Text.assemble((number, "dim"), (f"{name:<{WIDTH}}   -- ", "bold red"))
    rms, peak = (decibels(float(of[channel]), reference) for of in (levels.rms, levels.peak))
    filled = round(WIDTH * min(1.0, max(0.0, 1 + rms / RANGE)))
    mark = min(WIDTH - 1, round(WIDTH * min(1.0, max(0.0, 1 + peak / RANGE))))
    bar = "".join("█" if i < filled else "|" if i == mark else "·" for i in range(WIDTH))
    clips = bool(levels.clipping[channel])
    style = "bold red" if clips else "yellow" if peak > -6 else "green"
    figure = "CLIP" if clips else f"{rms:.0f}"
    return Text.assemble((number, "dim"), (bar, style), (f"{figure:>5} ", style if clips else ""))
