"""Playing a recording while it is solved: time to the first sound, gaps and memory of a long one, deaths, starvation.

All units are emulated on this computer, behind a proxy that records every datagram; no real array is used.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import contextmanager, suppress
from multiprocessing import Pipe
from pathlib import Path

import numpy as np
import psutil
from tests.simulators.udp_proxy import UdpProxy

import midair
from benchmarks.clock import load
from midair.files import DEFAULT_PROFILE

ROOT = Path(__file__).parents[1]
PARTS = ("steps", "first", "click", "long", "deaths")
SWITCH, SILENCE = 0x12, 0x16
LIVE = ("--mode", "paper", "--method", "live")
MODES = {"paper's mode, live solver, 1 kHz": LIVE, "quick mode, 1 kHz": ("--mode", "quick", "--rate", "1kHz")} | {
    "best mode, 4 kHz": ()
}


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.play_while_solving", description=__doc__.splitlines()[0]
    )
    parser.add_argument("--part", choices=PARTS, nargs="*", default=list(PARTS), help="only these (default all)")
    parser.add_argument("--seconds", type=float, default=600.0, help="duration of the long recording (default 600)")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        os.environ["MIDAIR_STATE"] = str(Path(folder) / "state")
        os.chdir(folder)
        midair.record("virtual:towel", 3.0, path="take.h5", notes={"object": "towel"})
        for part in options.part:
            print(f"\n{part}; {load()}", flush=True)
            {"steps": steps, "first": first, "click": click, "long": lambda: long(options.seconds), "deaths": deaths}[
                part
            ]()


@contextmanager
def playing(source: str, *words: str, **environment: str):
    """`midair play` on four emulated units, in a process of its own: (process, proxy, time of the order)."""
    tap = UdpProxy(4)
    line = [sys.executable, "-m", "midair", "play", source, "--device", f"autd3:{tap.address}", "-q"]
    began = time.monotonic()
    process = subprocess.Popen(
        [*line, "--override-exposure", "a benchmark on emulated units", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"} | environment,
    )
    try:
        yield process, tap, began
    finally:
        if process.poll() is None:
            process.kill()
        process.wait()
        tap.close()


def until_first(process: subprocess.Popen, tap: UdpProxy, patience: float = 200.0) -> float:
    """Time of the first switch of the units to frames; NaN if there is none."""
    until = time.monotonic() + patience
    while process.poll() is None and time.monotonic() < until:
        for at, _, command, _ in tap.frames():
            if command == SWITCH:
                return at
        time.sleep(0.005)
    return np.nan


def steps() -> None:
    """Print the CPU time of every step until the first frame can play, each mode in a process of its own."""
    for name, words in MODES.items():
        code = f"from benchmarks.play_while_solving import _steps; _steps({words!r})"
        made = subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            text=True,
            check=True,
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)},
        )
        print(f"{name}\n{made.stdout}", end="", flush=True)


def _steps(words: tuple[str, ...]) -> None:
    import midair.cli.commands.solve_play as command
    from midair.cli.app import app
    from midair.cli.options import RecordingOptions
    from midair.devices import ExposureStream, choose_silencer
    from midair.rig import PlaySettings, open_rig

    told: list[tuple[str, float]] = []

    def step(name: str) -> None:
        told.append((name, time.process_time() - sum(each for _, each in told)))

    step("imports")
    _, bound, _ = app.parse_args(["play", "take.h5", *words])
    chosen = (bound.arguments.get("solve") or RecordingOptions()).settings()
    array = midair.TransducerArray.autd3()
    _, _, pressure = command.RecordingPart().pressure(Path("take.h5"), chosen, array, None, "virtual")
    step("calibrated")
    target, parts = command.reproduce_stream(pressure, array, chosen)
    step("target, solver's set-up")
    device = open_rig(settings=PlaySettings()).array
    stream = ExposureStream(device, PlaySettings().exposure, frames=target.frames)
    stream.prepare()
    step("exposure's set-up")
    for number in (1, 2):
        part = next(parts).drive
        step(f"part {number}, {part.frames} frames, {part.frames / part.rate:.2f} s")
        stream.add(part, took=0.0)
        step(f"its check, {stream.admitted} frames so far")
        if number == 1:
            choose_silencer("auto", stream.begun())
            step("silencer")
    print("  " + "; ".join(f"{name} {each:.2f}" for name, each in told) + " s")


def first() -> None:
    """Print the time from Enter to the order that starts the first frame, without and with compiled Python files."""
    print(f"{'s from Enter to the first switch':44}{'cold':>8}{'warm':>8}{'CPU warm':>10}")
    for name, words in MODES.items():
        with tempfile.TemporaryDirectory() as compiled:
            took = []
            for _ in range(2):
                with playing("take.h5", *words, PYTHONPYCACHEPREFIX=compiled) as (process, tap, began):
                    took.append(until_first(process, tap) - began)
                    times = psutil.Process(process.pid).cpu_times() if process.poll() is None else None
            cpu = np.nan if times is None else times.user + times.system
            print(f"{name:44}{took[0]:8.2f}{took[1]:8.2f}{cpu:10.2f}", flush=True)


def click() -> None:
    """Print the times in the studio's running player: until the first part is checked, and until the first switch."""
    from midair.rig import PlayLease
    from midair.studio.player import _Player
    from midair.studio.work import SolveForm
    from midair.studio.worker_process import StudioPipe

    print(f"{'s, the second of two plays':44}{'check':>8}{'play':>8}{'sum':>8}")
    for name, form in (
        ("best mode", {"mode": "best"}),
        ("quick mode", {"mode": "quick"}),
        ("paper's mode, live solver", {"mode": "paper", "method": "live"}),
    ):
        tap, (_, there), permit = UdpProxy(4), Pipe(), PlayLease()
        player = _Player(StudioPipe(there), permit, f"autd3:{tap.address}", 0)
        request = SolveForm(take="take.h5", **form).request(Path("take.h5"), {})
        check = {"profile": DEFAULT_PROFILE, "attenuate": False, "override": "a benchmark", "room": None}
        with player.held:
            player.act({"do": "open"})
            for _ in range(2):
                tap.sent.clear()
                began = time.monotonic()
                found = player.act({"do": "stream", "solve": request, **check})
                checked = time.monotonic()
                leave = permit.arm(lasts=10.0)
                order = {"do": "play", "admission": found["number"], "leave": leave, "output": "", "masked": False}
                ended = threading.Event()

                def watch(ended=ended, tap=tap, permit=permit, seen=(seen := [])) -> None:
                    while not ended.wait(0.005):
                        permit.renew(lasts=2.0)
                        seen += [at for at, _, command, _ in tap.frames()[:400] if command == SWITCH][:1]
                        if seen:
                            permit.stop()
                            return

                thread = threading.Thread(target=watch, daemon=True)
                thread.start()
                with suppress(midair.errors.MidairError):
                    player.act(order)
                ended.set()
                thread.join()
        tap.close()
        sound = seen[0] - checked if seen else np.nan
        print(f"{name:44}{checked - began:8.2f}{sound:8.2f}{checked - began + sound:8.2f}", flush=True)


def long(seconds: float) -> None:
    """Print late frames, gaps and the memory of the process while a long recording plays."""
    midair.record("virtual:towel", 3.0, path="piece.h5", notes={"object": "towel"})
    piece = midair.open_take("piece.h5")
    samples = np.tile(piece.recording.samples, (round(seconds / 3), 1, 1))
    from dataclasses import replace

    midair.save(replace(piece.recording, samples=samples), "long.h5", calibration=piece.calibration)
    with playing("long.h5", *LIVE) as (process, tap, began):
        start, peaks = until_first(process, tap), []
        while process.poll() is None:
            if len(peaks) < int((time.monotonic() - start) / (seconds / 6)) + 1:
                peaks.append(psutil.Process(process.pid).memory_info().rss / 1e6)
                tap.sent.clear()
            time.sleep(0.1)
        output, wrong = process.communicate()
    print(f"{seconds:g} s of recording at 1 kHz, first switch after {start - began:.1f} s; status {process.returncode}")
    print("memory in MB at each sixth: " + ", ".join(f"{each:.0f}" for each in peaks))
    print(wrong[-400:] if process.returncode else _row(output, "timing"))


def _row(output: str, name: str) -> str:
    return " ".join(line.strip() for line in output.splitlines() if line.startswith(name))


def _spin() -> None:
    while True:
        np.linalg.norm(np.arange(1000.0))


def deaths() -> None:
    """Print what sounds and what is written after each end of a play that also writes its drive."""
    print(f"{'':26}{'status':>8}{'last switch':>13}{'silence':>9}  files, end in the log, timing")
    for name in ("to its end", "starved by 2 busy", "Ctrl-C", "midair stop", "killed"):
        Path("take.drive.h5").unlink(missing_ok=True)
        words = (*LIVE, "--drive", "take.drive.h5")
        with playing("take.h5", *words) as (process, tap, _):
            until_first(process, tap)
            spinning = [multiprocessing.Process(target=_spin, daemon=True) for _ in range(2 if "busy" in name else 0)]
            for each in spinning:
                each.start()
            time.sleep(1.0)
            at = time.monotonic()
            if name == "Ctrl-C":
                process.send_signal(signal.SIGINT)
            elif name == "killed":
                process.kill()
            elif name == "midair stop":
                subprocess.run([sys.executable, "-m", "midair", "stop"], capture_output=True, check=False)
            output, _ = process.communicate()
            for each in spinning:
                each.kill()
            time.sleep(0.6)
            orders = [(when - at, command) for when, _, command, _ in tap.frames()]
            switched = max((when for when, command in orders if command == SWITCH), default=np.nan)
            silent = max((when for when, command in orders if command == SILENCE), default=np.nan)
        log = [json.loads(line) for line in (Path("state") / "played.jsonl").read_text(encoding="utf-8").splitlines()]
        ended = log[-1].get("outcome", "none") if log[-1]["event"] == "end" else "none"
        kept = ", ".join(sorted(path.name for path in Path().glob("*.drive.h5"))) or "no drive"
        print(
            f"{name:26}{process.returncode:8}{switched:11.2f} s{silent:7.2f} s  {kept}; {ended}; "
            + _row(output, "timing"),
            flush=True,
        )


if __name__ == "__main__":
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    main()
