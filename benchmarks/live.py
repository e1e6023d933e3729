"""Print figures of live touch: late frames, latency measured from outside, error by band, deaths.

All units are emulated on this computer; no real array is used.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import tempfile
import time
from pathlib import Path

import numpy as np
from tests.simulators.udp_proxy import UdpProxy

import midair
from benchmarks.clock import load
from benchmarks.live_outside import Running, SerialSkin, loud, plain, seconds_to_silence, watch_in_time
from midair.calibration import CausalInverse, calibrate, causal_error, causal_fir
from midair.devices import ExposureChoices, stop_playing
from midair.dsp import welch
from midair.errors import MidairError
from midair.files import DEFAULT_PROFILE, profile_named
from midair.model import ControlGrid, TransducerArray
from midair.physics import (
    transfer_matrix,
)

PARTS = ("run", "latency", "bands", "deaths")
THINGS = ("towel", "sponge", "brush")
DELAYS = (0.002, 0.004, 0.006, 0.008, 0.01)
BANDS = ((20.0, 40.0), (40.0, 100.0), (100.0, 470.0))


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.live", description=__doc__.splitlines()[0])
    parser.add_argument("--part", choices=PARTS, nargs="*", default=list(PARTS), help="only these (default all)")
    parser.add_argument(
        "--frames", type=int, default=60_000, help="frames of a run (default 60000; 600000 are ten minutes)"
    )
    parser.add_argument("--priority", type=int, nargs="*", default=[20, 0], help="real-time priorities (default 20 0)")
    parser.add_argument("--hold", type=float, default=6.0, help="hold time of a run in ms (default 6)")
    parser.add_argument("--latency", type=float, help="total latency of a run in ms (default: 13 ms, without it)")
    parser.add_argument("--sensor", default="virtual:towel", help="sensor of a run (default virtual:towel)")
    parser.add_argument("--seconds", type=float, default=12.0, help="duration of the part latency in s (default 12)")
    options = parser.parse_args()
    print(load())
    if "bands" in options.part:
        bands()
    if {"latency", "deaths"} & set(options.part):
        print(f"\nreal-time priority for the wire and the sensor's line: {watch_in_time()}")
    if "latency" in options.part:
        latency(options.seconds)
    if "deaths" in options.part:
        deaths()
    # The busy parts run without real-time priority, which would block other processes.
    plain()
    total = None if options.latency is None else options.latency / 1000
    chosen = {"sensor": options.sensor, "hold": options.hold / 1000, "latency": total}
    if "run" in options.part:
        for priority in options.priority:
            run(options.frames, priority=priority, **chosen)


def run(frames: int, *, priority: int, sensor: str, hold: float, latency: float | None) -> dict | None:
    """Print lost and late frames, and the delay until sending, of a long run to four emulated units."""
    print(f"\n{frames} frames, hold {1e3 * hold:g} ms, priority {priority}")
    before, began = load(), time.monotonic()
    try:
        with tempfile.TemporaryDirectory() as folder:
            session = midair.live(
                sensor,
                "autd3:emulator",
                hold=hold,
                latency=latency,
                duration=frames / 1000,
                keep=Path(folder) / "run.h5",
                exposure=ExposureChoices(profile=profile_named(DEFAULT_PROFILE), override="a benchmark"),
                priority=priority,
            )
            with session:
                while session.wait(0.5):
                    pass
                told = session.statistics.plain() | {
                    "computer": session.opened.granted,
                    "rehearsal": session.opened.rehearsal.words(),
                }
    except MidairError as wrong:
        print(f"  ended early, after {time.monotonic() - began:.0f} s: {wrong}", flush=True)
        return None
    print(f"  {before} before, {load()} after; computer: {told['computer']}")
    print(f"  rehearsal: {told['rehearsal']}")
    names = ("frames", "played", "lost", "late", "hurried", "unanswered", "gaps", "failsafe")
    print("  " + ", ".join(f"{name} {told[name]}" for name in names))
    for name in ("left_ms", "work_ms"):
        print(f"  {name}: " + ", ".join(f"{share} {each}" for share, each in told[name].items()))
    return told


def latency(seconds: float) -> np.ndarray:
    """Delay of bursts on one cell from the sensor's serial line to the phases on the network, in ms.

    The loop's own figures are not used. The pressure on the cell is computed from the phases on the network. The delay
    of a burst is at the maximum of its correlation with the sensor's signal.
    """
    tap = UdpProxy(4)
    skin = SerialSkin(lambda number: np.where(np.arange(16) == 5, _burst(number), 0.0))
    running = Running(tap, skin.name, "--duration", f"{seconds:g}s", "--json")
    try:
        running.until_loud()
        time.sleep(max(0.0, seconds - 1.0))
    finally:
        output, wrong = running.end()
        skin.close()
        tap.close()
    # Analyse only after the run, because computing here would delay the network.
    seen = _frames_of_all(tap)
    grid = ControlGrid()
    G = transfer_matrix(grid.position[_nearest(grid, 5)][None], TransducerArray.autd3())[0]
    times = np.array([at for at, _, _ in seen])
    pressure = np.array([abs(np.exp(2j * np.pi * phases / 256) @ G) * (level > 0) for _, level, phases in seen]) ** 2
    delays = np.array([_delay(number, skin.pushed, times, pressure) for number in skin.pushed if number % EVERY == 100])
    delays = 1e3 * delays[np.isfinite(delays)][5:]
    print(f"\nlatency, measured from outside; {load()}")
    if len(delays) < 3:
        print(f"  too few bursts were detected ({len(delays)}): {wrong[-300:]}")
        return delays
    half, most = np.percentile(delays, [50, 99.9])
    print(f"  {len(delays)} bursts, sensor's line -> phases on the network: median {half:.2f}, 99.9 % {most:.2f} ms,")
    print("  6 ms of it for the filter; the units emit a frame one hold time after it was sampled")
    if not output:
        print(f"  the run ended early: {wrong.strip()[-300:]}")
        return delays
    told = json.loads(output)
    print(f"  the loop's own figures: delay from sampling to sending {told['left_ms']}; late {told['late']}")
    return delays


EVERY, LASTS = 200, 35
"""Frames from burst to burst, and frames of a burst."""


def _burst(number: int) -> float:
    """Pressure of a burst of 100 Hz in Pa, short enough that its autocorrelation has a single peak."""
    at = number % EVERY - 100
    return 60.0 * np.sin(np.pi * at / LASTS) ** 4 * np.sin(2 * np.pi * at / 10) if 0 <= at < LASTS else 0.0


def _delay(first: int, pushed: dict[int, float], times: np.ndarray, pressure: np.ndarray) -> float:
    """Delay of a burst on the network in s; NaN if it was not recorded completely."""
    frames = [number for number in range(first, first + LASTS) if number in pushed]
    began = pushed[first]
    inside = (times > began - 0.05) & (times < began + 0.2)
    if len(frames) < LASTS or inside.sum() < 150 or not pressure[inside].any():
        return np.nan
    grid = began + np.arange(-0.02, 0.12, 1e-4)
    wanted = np.maximum([_burst(number) for number in frames], 0.0)
    into = _held(grid, np.array([pushed[number] for number in frames]), wanted)
    out = _held(grid, times[inside], pressure[inside])
    # The filter alone delays by 6 ms.
    lags = np.arange(40, 400)
    like = [np.corrcoef(into[: len(grid) - lag], out[lag:])[0, 1] for lag in lags]
    return 1e-4 * float(lags[int(np.argmax(like))])


def _held(grid: np.ndarray, times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Last value before each moment of a grid."""
    place = np.searchsorted(times, grid, side="right") - 1
    return np.where(place >= 0, values[np.maximum(place, 0)], 0.0)


def _frames_of_all(tap: UdpProxy) -> list[tuple[float, int, np.ndarray]]:
    """(time of the last unit's packet, intensity, phases of all units) of each frame."""
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
    """Control point nearest to a cell of the default sensor."""
    from midair.model import SensorGrid

    sensor = SensorGrid()
    row, column = divmod(cell, sensor.columns)
    return int(np.argmin(np.hypot(grid.position[:, 0] - sensor.x[column], grid.position[:, 1] - sensor.y[row])))


def _felt(thing: str, seconds: float = 3.0):
    """A virtual recording, its calibration, and its pressure from the zero-phase calibration."""
    from midair import record

    take = record(f"virtual:{thing}", seconds)
    return take.recording, take.calibration, calibrate(take.recording, take.calibration).pressure


def _in_band(x: np.ndarray, band: tuple[float, float]) -> float:
    frequency, density = welch(x.reshape(len(x), -1), 1000.0)
    inside = (frequency >= band[0]) & (frequency <= band[1])
    return float(density[inside].mean())


def bands() -> None:
    """Print the error against the zero-phase calibration, with the delay removed."""
    print("\nerror of the causal inverse against the zero-phase one without delay, % (all / 20-40 / 40-100 / 100-470)")
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


def deaths(names: tuple[str, ...] = DEATHS) -> dict[str, tuple[float, str]]:
    """Time in s from each kind of failure to silence, and the source of the silence."""
    print(f"\ndeaths: ms from the event to silence; {load()}")
    return {name: _death(name) for name in names}


def _death(name: str, attempts: int = 4) -> tuple[float, str]:
    """One failure; on a busy machine a run may end before it, then it is repeated."""
    tap = UdpProxy(4)
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
        print(f"  {name:30} repeated, the run ended before: {str(wrong).splitlines()[-1][:100]}", flush=True)
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


if __name__ == "__main__":
    main()
