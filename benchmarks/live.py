"""Print what live touch keeps: late frames, latency seen from outside, error by band, deaths, a bad network.

Everything plays on emulated units on this computer; no real array was used.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import signal
import tempfile
import time
from pathlib import Path

import numpy as np

import midair
from benchmarks.clock import load
from benchmarks.live_outside import Running, SerialSkin, UnitsApart, loud, plain, seconds_to_silence, watch_in_time
from benchmarks.standstill import Standstills, beside
from midair.calibration import CausalInverse, calibrate, causal_error, causal_fir
from midair.devices import ExposureChoices, stop_playing
from midair.dsp import welch
from midair.errors import MidairError
from midair.files import DEFAULT_PROFILE, profile_named
from midair.model import ControlGrid, Drive, TransducerArray
from midair.physics import (
    PlaybackChain,
    SensorModel,
    TransducerDynamics,
    Transducers,
    cell_weights,
    focus_amplitude,
    simulate,
    transfer_matrix,
)
from midair.rig.live_touch.touch_ring import LATE, STEP
from midair.testing.udp_tap import UdpTap

PARTS = ("run", "latency", "bands", "spectra", "hurried", "deaths", "network")
THINGS = ("towel", "sponge", "brush")
DELAYS = (0.002, 0.004, 0.006, 0.008, 0.01)
BANDS = ((20.0, 40.0), (40.0, 100.0), (100.0, 470.0))


def main() -> None:
    ask = argparse.ArgumentParser(prog="python -m benchmarks.live", description=__doc__.splitlines()[0])
    ask.add_argument("--part", choices=PARTS, nargs="*", default=list(PARTS), help="only these (default all)")
    ask.add_argument("--frames", type=int, default=60_000, help="of a run (default 60000; 600000 are ten minutes)")
    ask.add_argument("--busy", type=int, default=0, help="processes that are busy beside a run (default 0)")
    ask.add_argument("--priority", type=int, nargs="*", default=[20, 0], help="real-time priorities (default 20 0)")
    ask.add_argument("--hold", type=float, default=6.0, help="of a run, in ms (default 6)")
    ask.add_argument("--apart", action="store_true", help="units of a run in a process of their own, as real ones are")
    ask.add_argument("--sensor", default="virtual:towel", help="of a run (default virtual:towel)")
    ask.add_argument("--seconds", type=float, default=12.0, help="of latency and of each network (default 12)")
    said = ask.parse_args()
    print(load())
    if "bands" in said.part:
        bands()
    if "spectra" in said.part:
        spectra()
    if "hurried" in said.part:
        hurried()
    if {"latency", "deaths", "network"} & set(said.part):
        print(f"\nreal-time priority for the wire, the sensor's line and the network: {watch_in_time()}")
    if "latency" in said.part:
        latency(said.seconds)
    if "deaths" in said.part:
        deaths()
    if "network" in said.part:
        network(said.seconds)
    # What works all the time must not have it: others would stand still.
    plain()
    if "run" in said.part:
        for priority in said.priority:
            run(said.frames, said.busy, priority, said.sensor, hold=said.hold / 1000, apart=said.apart)


def run(frames: int, busy: int, priority: int, sensor: str, *, hold: float, apart: bool) -> None:
    """A long run to four emulated units: lost, late, how long after it was taken a frame has left, and who was late.

    A frame is late by the loop's own doing, or since the computer itself stood still while it was to be formed and
    sent: a thread that comes before all others saw it. Frames up to 50 ms behind a standstill count for it: they are
    what it left to be done.
    """
    spinning = [multiprocessing.Process(target=_spin, daemon=True) for _ in range(busy)]
    for each in spinning:
        each.start()
    units = UnitsApart(4) if apart else None
    where = "in a process of their own" if units else "in the loop's process"
    print(
        f"\n{frames} frames, hold {1e3 * hold:g} ms, priority {priority}, units {where}, {busy} busy processes beside"
    )
    stills, before, late, began = Standstills(), load(), [], time.monotonic()
    try:
        with tempfile.TemporaryDirectory() as folder:
            session = midair.live(
                sensor,
                f"autd3:{units.address}" if units else "autd3:emulator",
                hold=hold,
                duration=frames / 1000,
                keep=Path(folder) / "run.h5",
                exposure=ExposureChoices(profile=profile_named(DEFAULT_PROFILE), override="a benchmark"),
                priority=priority,
            )
            seen, goes = 0, True
            with session:
                while goes:
                    goes = session.wait(0.5)
                    slots, seen, _ = session.since(seen)
                    late.append(slots["taken"][(slots["flags"] & LATE) > 0])
                told = session.statistics.plain() | {"computer": session.opened.granted.words()}
                left = session.ring.histogram("left")
    except MidairError as wrong:
        print(f"  ended early, after {time.monotonic() - began:.0f} s: {wrong}")
        return
    finally:
        still = stills.end(longer=hold / 3)
        if units:
            units.close()
        for each in spinning:
            each.kill()
    print(f"  {before} before, {load()} after; computer: {told['computer']}")
    names = ("frames", "played", "lost", "late", "hurried", "unanswered", "gaps")
    print("  " + ", ".join(f"{name} {told[name]}" for name in names))
    for name in ("left_ms", "work_ms"):
        print(f"  {name}: " + ", ".join(f"{share} {each}" for share, each in told[name].items()))
    wide = round(0.5e-3 / STEP)
    steps = [(0.5 * (place // wide), int(left[place : place + wide].sum())) for place in range(0, len(left), wide)]
    print("  left, frames from each half ms on: " + ", ".join(f"{begin:g}: {count}" for begin, count in steps if count))
    if not stills.granted:
        print("  whether the computer stood still nobody could see: no real-time priority")
        return
    taken = np.concatenate(late)
    every = taken[:1] + np.arange(0.0, frames / 1000, 1e-3)
    innocent, share = (beside(each, still, before=hold, after=0.05) for each in (taken, every))
    lengths = np.concatenate([each[:, 1] - each[:, 0] for each in still])
    print(
        f"  the computer stood still {len(lengths)} times for more than {1e3 * hold / 3:.1f} ms, {lengths.sum():.2f} s "
        f"on all cores together, {1e3 * lengths.max(initial=0.0):.0f} ms at most"
    )
    print(
        f"  of {len(taken)} late frames {innocent.sum()} were taken beside such a moment, "
        f"{len(taken) - innocent.sum()} were not; of all time "
        f"{100 * share.mean() if len(share) else 0:.1f} % is beside one",
        flush=True,
    )


def _spin() -> None:
    plain()
    while True:
        np.linalg.norm(np.arange(1000.0))


def latency(seconds: float) -> np.ndarray:
    """Bursts on one cell: from their going into the sensor's line to their phases on the wire, in ms.

    Nothing is asked of the loop. Pressure at the cell is worked out from the phases that went by on the wire; the delay
    of a burst is that at which it is most like what went into the line.
    """
    tap = UdpTap(4)
    skin = SerialSkin(lambda number: np.where(np.arange(16) == 5, _burst(number), 0.0))
    running = Running(tap, skin.name, "--duration", f"{seconds:g}s", "--json")
    try:
        running.until_loud()
        time.sleep(max(0.0, seconds - 1.0))
    finally:
        said, wrong = running.end()
        skin.close()
        tap.close()
    # Only now: what works here keeps the wire waiting.
    seen = _frames_of_all(tap)
    grid = ControlGrid()
    G = transfer_matrix(grid.position[_nearest(grid, 5)][None], TransducerArray.autd3())[0]
    times = np.array([at for at, _, _ in seen])
    pressure = np.array([abs(np.exp(2j * np.pi * phases / 256) @ G) * (level > 0) for _, level, phases in seen]) ** 2
    delays = np.array([_delay(number, skin.pushed, times, pressure) for number in skin.pushed if number % EVERY == 100])
    delays = 1e3 * delays[np.isfinite(delays)][5:]
    print(f"\nlatency, seen from outside; {load()}")
    if len(delays) < 3:
        print(f"  too few bursts were seen ({len(delays)}): {wrong[-300:]}")
        return delays
    half, most = np.percentile(delays, [50, 99.9])
    print(
        f"  {len(delays)} bursts into the sensor's line -> phases on the wire: median {half:.2f}, 99.9 % {most:.2f} ms,"
    )
    print("  of which the filter is 6; they sound by their instant, a hold after the frame was taken")
    if not said:
        print(f"  it ended early: {wrong.strip()[-300:]}")
        return delays
    told = json.loads(said)
    print(f"  the loop's own word: sent after they were taken {told['left_ms']}; late {told['late']}")
    return delays


EVERY, LASTS = 200, 35
"""Frames from burst to burst, and that one lasts."""


def _burst(number: int) -> float:
    """Pressure of a burst of 100 Hz, in Pa: so short that it is not like itself a period later."""
    at = number % EVERY - 100
    return 60.0 * np.sin(np.pi * at / LASTS) ** 4 * np.sin(2 * np.pi * at / 10) if 0 <= at < LASTS else 0.0


def _delay(first: int, pushed: dict[int, float], times: np.ndarray, pressure: np.ndarray) -> float:
    """By which a burst on the wire is late, in s; NaN where it was not seen whole."""
    frames = [number for number in range(first, first + LASTS) if number in pushed]
    began = pushed[first]
    inside = (times > began - 0.05) & (times < began + 0.2)
    if len(frames) < LASTS or inside.sum() < 150 or not pressure[inside].any():
        return np.nan
    grid = began + np.arange(-0.02, 0.12, 1e-4)
    wanted = np.maximum([_burst(number) for number in frames], 0.0)
    into = _held(grid, np.array([pushed[number] for number in frames]), wanted)
    out = _held(grid, times[inside], pressure[inside])
    # The filter alone takes 6 ms.
    lags = np.arange(40, 400)
    like = [np.corrcoef(into[: len(grid) - lag], out[lag:])[0, 1] for lag in lags]
    return 1e-4 * float(lags[int(np.argmax(like))])


def _held(grid: np.ndarray, times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """What stands at each moment of a grid: the last value before it."""
    place = np.searchsorted(times, grid, side="right") - 1
    return np.where(place >= 0, values[np.maximum(place, 0)], 0.0)


def _frames_of_all(tap: UdpTap) -> list[tuple[float, int, np.ndarray]]:
    """(when the last unit's went by, intensity, phases of all units) of each frame."""
    whole: dict[int, dict[int, tuple[float, int, np.ndarray]]] = {}
    for at, port, datagram in list(tap.sent):
        if datagram[1] == 0 and datagram[5] == 0x16 and any(datagram[6:10]):
            instant = int.from_bytes(datagram[6:10], "little")
            phases = np.frombuffer(datagram[20:269], np.uint8)
            whole.setdefault(instant, {})[port] = (at, datagram[-249], phases)
    ports = sorted({port for one in whole.values() for port in one})
    full = [one for one in whole.values() if len(one) == len(ports)]
    return [
        (max(one[port][0] for port in ports), one[ports[0]][1], np.concatenate([one[port][2] for port in ports]))
        for one in full
    ]


def _nearest(grid: ControlGrid, cell: int) -> int:
    """The control point nearest to a cell of the usual sensor."""
    from midair.model import SensorGrid

    sensor = SensorGrid()
    row, column = divmod(cell, sensor.columns)
    return int(np.argmin(np.hypot(grid.position[:, 0] - sensor.x[column], grid.position[:, 1] - sensor.y[row])))


def _felt(thing: str, seconds: float = 3.0):
    """A virtual recording, its calibration, and its pressure by the zero-phase chain."""
    from midair import record

    take = record(f"virtual:{thing}", seconds)
    return take.recording, take.calibration, calibrate(take.recording, take.calibration).pressure


def _in_band(x: np.ndarray, band: tuple[float, float]) -> float:
    frequency, density = welch(x.reshape(len(x), -1), 1000.0)
    inside = (frequency >= band[0]) & (frequency <= band[1])
    return float(density[inside].mean())


def bands() -> None:
    """Error against what the zero-phase chain would play, at the same moment but for the delay."""
    print(
        "\nerror of the causal inverse against the zero-phase one, delay taken away, % (all / 20-40 / 40-100 / 100-470)"
    )
    print("  delay     even spectrum        " + "".join(f"{thing:>20}" for thing in THINGS))
    felt = {thing: _felt(thing) for thing in THINGS}
    known = felt["towel"][1]
    for delay in DELAYS:
        fir = causal_fir(known, 1000.0, delay=delay)
        even = causal_error(fir, known, 1000.0, delay=delay, parts=((20.0, 470.0), *BANDS))
        cells = []
        for thing in THINGS:
            recording, calibration, wanted = felt[thing]
            given = CausalInverse(calibration, 1000.0, delay=delay).push(recording.samples)
            late = round(1000 * delay)
            got, want = given[300 + late :], wanted[300 : len(wanted) - late]
            whole = np.sqrt(np.mean((got - want) ** 2) / np.mean(want**2))
            parts = [np.sqrt(_in_band(got - want, band) / _in_band(want, band)) for band in BANDS]
            cells.append(" / ".join(f"{100 * each:.0f}" for each in (whole, *parts)))
        print(f"  {1e3 * delay:2.0f} ms  " + " / ".join(f"{100 * each:5.1f}" for each in even), end="")
        print("".join(f"{cell:>20}" for cell in cells))


def spectra() -> None:
    """What a virtual sensor gets of towel, sponge and brush: played live, and by the best offline mode."""
    from midair.pipeline import calibrated_pressure, reproduce
    from midair.rig.live_touch import Touch, TouchSettings
    from midair.settings import MODES

    array, grid = TransducerArray.autd3(), ControlGrid()
    print("\nspectra on a cell, dB against what it felt (20-40 / 40-100 / 100-470 Hz); transducers as modelled")
    for thing in THINGS:
        recording, calibration, wanted = _felt(thing, 1.2)
        settings = TouchSettings()
        touch = Touch(settings, calibration, recording.sensor, 1000.0, array, 1.0)
        phase, level = np.zeros((recording.frames, array.count)), np.zeros(recording.frames)
        for number, sample in enumerate(recording.samples.reshape(recording.frames, -1)):
            touch.feel(sample)
            if touch.form():
                phase[number], level[number] = 2 * np.pi * touch.phases / 256, 1.0
        cell = cell_weights(SensorModel.usual(recording.sensor), grid, between="waves")[5:6]
        played = Drive(phase=phase, level=level, rate=1000.0, array=array, acoustics=settings.acoustics)
        best = MODES["best"]()
        made = reproduce(calibrated_pressure(recording, calibration, best), array, best)
        live, offline = _pressed(played, grid, cell), _pressed(made.solution.drive, grid, cell)
        own = wanted.reshape(len(wanted), -1)[:, 5]
        for name, got in (("live", live), ("best offline", offline)):
            gains = [10 * np.log10(_in_band(got[200:], band) / _in_band(own[200:], band)) for band in BANDS]
            print(f"  {thing:8}{name:14}" + " / ".join(f"{each:+5.1f}" for each in gains))


def hurried() -> None:
    """E of the phases where some frames are in a hurry, in the mean over all that sound, and what a frame takes."""
    from midair.rig.live_touch import Touch, TouchSettings
    from midair.solvers import one_blas_thread

    array, settings = TransducerArray.autd3(), TouchSettings()
    G = transfer_matrix(settings.grid, array) / focus_amplitude(settings.grid, array)
    print("\nE of the phases, % (none, one in four, every second, all in a hurry), and ms a frame (half of them)")
    for thing in THINGS:
        recording, calibration, _ = _felt(thing, 1.5)
        samples, cells = recording.samples.reshape(recording.frames, -1), []
        for every in (0, 4, 2, 1):
            touch = Touch(settings, calibration, recording.sensor, 1000.0, array, 1.0)
            missed, took = [], []
            with one_blas_thread():
                for number, sample in enumerate(samples):
                    touch.feel(sample)
                    began = time.perf_counter()
                    if touch.form(hurried=every > 0 and number % every == 0):
                        took.append(time.perf_counter() - began)
                        field = np.abs(G @ np.exp(2j * np.pi * touch.phases / 256))
                        missed.append(np.linalg.norm(field - touch.wanted) / np.linalg.norm(touch.wanted))
            cells.append(f"{100 * np.mean(missed[20:]):5.1f} % {1e3 * np.median(took):.2f} ms")
        print(f"  {thing:8}" + "   ".join(cells), flush=True)


DEATHS = (
    "Ctrl-C",
    "midair stop",
    "program that looks on killed",
    "program that looks on hangs",
    "loop killed",
    "loop hangs",
    "sensor falls silent",
    "cable to the array cut",
)


def _pressed(drive: Drive, grid: ControlGrid, cell: np.ndarray) -> np.ndarray:
    """Pressure on a cell, means of a millisecond, with frames that are held and transducers that take their time."""
    follow = Transducers.varied(
        drive.array.count, TransducerDynamics(), gain_spread=0.0, resonance_spread=0.0, quality_spread=0.0, seed=0
    )
    G = transfer_matrix(grid, drive.array, acoustics=drive.acoustics)
    moments = simulate(drive, G, chain=PlaybackChain(transducers=follow), rate=8000.0, weights=cell)[:, 0]
    return moments.reshape(-1, 8).mean(axis=1)


def deaths(names: tuple[str, ...] = DEATHS) -> dict[str, tuple[float, str]]:
    """Every way in which it can end: from the event to silence, in s, and by whose word."""
    print(f"\ndeaths: ms from the event to silence; {load()}")
    return {name: _death(name) for name in names}


def _death(name: str, attempts: int = 4) -> tuple[float, str]:
    """On a busy machine a run may end by itself before the event: then once more."""
    tap = UdpTap(4)
    skin = SerialSkin(lambda number: np.full(16, 10.0 * np.sin(2 * np.pi * number / 20)))
    running, child = Running(tap, skin.name, "--mapping", "constant-offset", "--offset", "20Pa"), 0
    try:
        running.until_loud()
        time.sleep(1.2)
        child = running.child
        if not (child and loud(tap)):
            raise RuntimeError(running.end()[1])
        since = time.monotonic()
        _happens(name, running, skin, child)
        took, by = seconds_to_silence(tap, since)
        print(f"  {name:30}{1e3 * took:6.0f} ms   by {by}", flush=True)
        return took, by
    except RuntimeError as wrong:
        if not attempts:
            raise
        print(f"  {name:30} once more, it ended before: {str(wrong).splitlines()[-1][:100]}", flush=True)
        return _death(name, attempts - 1)
    finally:
        if child:
            _kill(child)
        running.end()
        skin.close()
        tap.close()


def _happens(name: str, running: Running, skin: SerialSkin, child: int) -> None:
    match name:
        case "Ctrl-C":
            running.process.send_signal(signal.SIGINT)
        case "midair stop":
            stop_playing()
        case "program that looks on killed":
            running.process.kill()
        case "program that looks on hangs":
            running.process.send_signal(signal.SIGSTOP)
        case "loop killed":
            os.kill(child, signal.SIGKILL)
        case "loop hangs":
            os.kill(child, signal.SIGSTOP)
        case "sensor falls silent":
            skin.speaks = False
        case "cable to the array cut":
            running.tap.passes = False
        case _:
            raise ValueError(name)


def _kill(pid: int) -> None:
    try:
        os.kill(pid, signal.SIGKILL)
    except ProcessLookupError:
        return


def network(seconds: float) -> None:
    """Two sides and a bad way between them: what is felt, and what is refused."""
    from tests.rig.live_touch.test_listening import spoken

    ways = {
        "nothing": {},
        "5 % lost": {"loss": 0.05},
        "10 ms of jitter": {"delay": 0.005, "jitter": 0.01},
        "1 % overtaken": {"reordering": 0.01},
        "all of it": {"loss": 0.05, "delay": 0.005, "jitter": 0.01, "reordering": 0.01},
        "every datagram twice": {"repeating": 1.0},
    }
    print(f"\nnetwork over loopback, jitter buffer 15 ms; {load()}")
    print("  way                     sent   lost  concealed   %  too late  repeated  refused")
    for name, way in ways.items():
        listener, proxy, speaker = spoken(seconds, buffer=0.015, **way)
        told, given = listener.source.counted, max(1, len(listener.got))
        shares = f"{told.concealed:9d} {100 * told.concealed / given:5.1f} {told.tardy:8d} {told.repeated:9d}"
        print(f"  {name:22}{speaker.spoken.frames:6d} {proxy.lost:6d} {shares} {told.refused:8d}", flush=True)


if __name__ == "__main__":
    main()
