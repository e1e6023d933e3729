"""Playing a recording while it is solved, on four emulated units: `python -m benchmarks.first_sound`.

`start` prints the time from the command to the play order in the log, right after which the sound begins: without
compiled Python files, and with them. `long` plays one recording to its end and prints gaps and memory over time. The
emulated units are part of the same program, so that their processor time counts too.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory

import psutil

from benchmarks.clock import load

MODES = {
    "best": ("--mode", "best"),
    "quick": ("--mode", "quick"),
    "paper, live, 250 Hz": ("--mode", "paper", "--method", "live", "--rate", "250Hz"),
}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.first_sound", description=__doc__.splitlines()[0])
    parser.add_argument("--part", choices=("start", "long"), nargs="*", default=["start"], help="default start")
    parser.add_argument("--seconds", type=float, default=600.0, help="length of the long recording in s (default 600)")
    parser.add_argument("--busy", type=int, default=0, help="number of busy processes beside it (default 0)")
    options = parser.parse_args()
    spin = [sys.executable, "-c", "while True: pass"]
    others = [subprocess.Popen(spin) for _ in range(options.busy)]
    try:
        with TemporaryDirectory() as folder:
            if "start" in options.part:
                start(Path(folder))
            if "long" in options.part:
                long(Path(folder), options.seconds)
    finally:
        for each in others:
            each.kill()
            each.wait()


def start(folder: Path) -> None:
    """Print the time to the first sound for 1 s of touch, cold and warm."""
    take = recorded(folder, 1.0)
    print(f"1 s of a towel: s from the command to the first sound; {load()}")
    for name, mode in MODES.items():
        cold = {"PYTHONPYCACHEPREFIX": str(folder / f"cold-{name}")}
        for label, more in (("cold", cold), ("warm", cold)):
            began = datetime.now(UTC)
            played = play(folder, take, mode, more)
            _, error = played.communicate()
            order, end = last_orders(folder)
            if played.returncode:
                print(f"{name}, {label}: {error.strip()}")
                continue
            waited = (datetime.fromisoformat(order["time"]) - began).total_seconds()
            print(f"{name}, {label}: {waited:.1f} s; {end['late']} late, {end['gap_s']:g} s of gaps", flush=True)


def long(folder: Path, seconds: float) -> None:
    """Play a long recording while it is solved, and print its gaps and its memory."""
    take = recorded(folder, seconds)
    print(f"{seconds:g} s of a towel, {list(MODES)[-1]}; {load()}", flush=True)
    began, start, used = datetime.now(UTC), time.monotonic(), []
    played = play(folder, take, list(MODES.values())[-1], {})
    process, cpu = psutil.Process(played.pid), 0.0
    while played.poll() is None:
        try:
            used.append((time.monotonic() - start, process.memory_info().rss / 2**20))
            cpu = sum(process.cpu_times()[:2])
        except psutil.NoSuchProcess:
            break
        time.sleep(1.0)
    _, error = played.communicate()
    if played.returncode:
        print(f"status {played.returncode}: {error.strip()}")
    order, end = last_orders(folder)
    waited = (datetime.fromisoformat(order["time"]) - began).total_seconds()
    shown = {key: end[key] for key in ("outcome", "frames", "duration_s", "late", "repeated", "gap_s", "units")}
    print(f"first sound after {waited:.0f} s; {shown}; {cpu:.0f} s of CPU time; {load()}")
    for part in range(5):
        of_part = [memory for at, memory in used if part <= 5 * at / used[-1][0] < part + 1]
        print(f"  memory in fifth {part + 1} of {used[-1][0]:.0f} s: {min(of_part):.0f} to {max(of_part):.0f} MiB")


def recorded(folder: Path, seconds: float) -> Path:
    """Record a towel of the virtual sensor."""
    take = folder / f"take-{seconds:g}.h5"
    midair = [sys.executable, "-m", "midair", "record", "virtual:towel", str(take), "--duration", f"{seconds}s"]
    subprocess.run(midair, check=True, capture_output=True)
    return take


def play(folder: Path, take: Path, mode: tuple[str, ...], more: dict[str, str]) -> subprocess.Popen[str]:
    """Start to play a recording on the emulator, with a state folder of its own."""
    midair = [sys.executable, "-m", "midair", "play", str(take), "--device", "autd3:emulator", *mode]
    # The environment may forbid compiled Python files.
    state = os.environ | {"MIDAIR_STATE": str(folder / "state"), "PYTHONDONTWRITEBYTECODE": ""} | more
    how = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True, "env": state}
    return subprocess.Popen([*midair, "--override-exposure", "benchmark"], **how)


def last_orders(folder: Path) -> tuple[dict, dict]:
    """The last order of the log, and its end."""
    *_, order, end = (json.loads(line) for line in (folder / "state" / "played.jsonl").read_text().splitlines())
    return order, end


if __name__ == "__main__":
    main()
