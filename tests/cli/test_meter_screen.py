import io

import numpy as np
from rich.console import Console

from midair.cli.commands.record import MeterScreen, meters
from midair.cli.keys import Keys, Signals
from midair.devices import ReplaySensor
from midair.model import Event, Recording, SensorGrid
from midair.rig.takes.meters import Meters
from midair.rig.takes.take_state import Drift, View


def sensor_of(rows=4, columns=4):
    grid = SensorGrid(rows=rows, columns=columns)
    sensor = ReplaySensor(Recording(samples=np.zeros((1, rows, columns)), rate=1000.0, sensor=grid))
    sensor.full_scale = 1.0
    return sensor


def view(sensor, *, state="recording", rate=None):
    """Channel c: a sine of -6 c dB under full scale; 2 is dead, 3 clips."""
    t, count = np.arange(1000) / 1000, sensor.grid.count
    samples = 0.99 * np.sin(2 * np.pi * 50 * t)[:, None] * 10 ** (-6 * np.arange(count) / 20)
    samples[:, 2] = 0.1
    samples[:, 3] = np.clip(2 * np.sin(2 * np.pi * 50 * t), -1, 1)
    levels = Meters(count, 1000.0, full_scale=1.0)
    levels.add(samples.reshape(-1, *sensor.grid.shape))
    return View(state=state, frames=12_345, wanted=20_000, lost=16, levels=levels.levels, rate=rate, clock=None)


def drawn(picture, width=80):
    console = Console(file=io.StringIO(), width=width, force_terminal=False)
    console.print(picture)
    return console.file.getvalue()


def test_the_picture_has_a_meter_for_each_cell_where_the_cell_is():
    sensor = sensor_of()
    text = drawn(meters(view(sensor, rate=Drift(ppm=12.3, uncertainty=2.1, span=10)), sensor, "towel-03.h5", keys=True))
    lines = text.splitlines()
    assert lines[0].startswith("● REC towel-03.h5")
    assert "SIMULATED" not in lines[0]
    assert lines[1].startswith(" 0 ████████   -3 "), "a peak of full scale is 3 dB less as rms; the bar is full"
    assert lines[1].rstrip().endswith("3 ████████ CLIP")
    assert " 2 dead" in lines[1]
    assert lines[2].startswith(" 4 █████·|·  -27 "), "24 dB less: 53 of 80 dB are 5 of 8, the peak is 56 dB"
    assert [line.split()[0] for line in lines[1:5]] == ["0", "4", "8", "12"]
    assert "12.3 of 20.0 s, lost 16 frames, frames +12 ± 2 ppm" in text
    assert "space or Enter: stop, q: end" in text
    assert max(len(line) for line in lines) <= 80


def test_a_simulated_sensor_is_called_that():
    sensor = sensor_of()
    sensor.simulated = True
    text = drawn(meters(view(sensor, state="waiting"), sensor, "x"))
    assert "SIMULATED" in text
    assert "not yet recording" in text


def test_any_grid_fits_eighty_columns():
    for shape in ((1, 4), (8, 8), (2, 8), (4, 5)):
        sensor = sensor_of(*shape)
        text = drawn(meters(view(sensor), sensor, "x"))
        assert f"{sensor.grid.count - 1} " in text, shape
        assert max(len(line) for line in text.splitlines()) <= 80, shape


def screen(*, terminal, quiet=False, every=0.0):
    console = Console(file=io.StringIO(), width=80, force_terminal=terminal, soft_wrap=True)
    return MeterScreen(sensor_of(), console, Keys(io.StringIO()), Signals(), quiet=quiet, every=every), console


def test_without_a_terminal_lines_are_printed_and_no_meters():
    shown, console = screen(terminal=False)
    with shown.take("towel-03.h5, take 3 of 5"):
        shown.show(view(sensor_of()))
        shown.show(view(sensor_of()))
        shown.tell(Event(kind="lost", frame=1200, frames=16))
    lines = console.file.getvalue().splitlines()
    assert (lines[0], lines[1]) == ("towel-03.h5, take 3 of 5", "12.3 of 20.0 s, lost 16 frames")
    assert lines[2].startswith("1.200 s: 16 frames")
    assert "\x1b" not in console.file.getvalue()


def test_quiet_prints_only_problems():
    shown, console = screen(terminal=True, quiet=True)
    with shown.take("towel-03.h5"):
        shown.show(view(sensor_of()))
        shown.tell(Event(kind="trigger", frame=3))
        shown.tell(Event(kind="dead", frame=0, channel=3))
    assert [line.partition(":")[2] for line in console.file.getvalue().splitlines()] == [
        " channel 3 (row 0, column 3) is dead: it has never changed; check its wire"
    ]


def test_clipping_of_a_channel_is_printed_once_per_take():
    shown, console = screen(terminal=False, quiet=True)
    with shown.take("x"):
        for frame in range(0, 5000, 50):
            shown.tell(Event(kind="clipped", frame=frame, frames=3, channel=6))
    assert len(console.file.getvalue().splitlines()) == 1
    with shown.take("y"):
        shown.tell(Event(kind="clipped", frame=0, frames=3, channel=6))
    assert len(console.file.getvalue().splitlines()) == 2


def test_signals_and_keys_become_orders(monkeypatch):
    shown, _ = screen(terminal=False)
    assert shown.order() is None
    for key, order in ((" ", "toggle"), ("\n", "toggle"), ("q", "quit"), ("x", None), (" q", "quit")):
        monkeypatch.setattr(Keys, "pressed", lambda _, key=key: key)
        assert shown.order() == order
    shown._signals.came = "SIGTERM"
    assert shown.order() == "kill"
