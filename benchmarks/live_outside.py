"""Test equipment for live touch: a simulated serial sensor, a tap on the emulated units, and the live command."""

from __future__ import annotations

import contextlib
import gc
import os
import signal
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from tests.simulators.udp_proxy import UdpProxy

from midair.devices.sensors.serial_frames import encode

SILENT_PATTERN, FAILSAFE = 0x16, 0x80
"""Command of a single frame; bit of the FPGA's state that is set when the failsafe has silenced the unit."""

FULL = 100.0
"""Full-scale pressure of the converter in Pa."""


class SerialSkin:
    """A sensor of 4 x 4 cells at 1 kHz on a pseudo-terminal, which sends two frames at a time.

    Parameters
    ----------
    pressure : callable
        Returns the pressure on the 16 cells in Pa for a frame number.
    """

    def __init__(self, pressure: Callable[[int], np.ndarray], *, block: int = 2) -> None:
        self._pressure, self._block = pressure, block
        self._ours, self._theirs = os.openpty()
        tty.setraw(self._theirs)
        os.set_blocking(self._ours, False)
        self.name = f"serial:{os.ttyname(self._theirs)}?unit=Pa&full_scale={FULL:g}"
        self.pushed: dict[int, float] = {}
        self.speaks, self._ends = True, False
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._ends = True
        self._thread.join()
        os.close(self._ours)
        os.close(self._theirs)

    def _run(self) -> None:
        number, begin = 0, time.monotonic()
        while not self._ends:
            due = begin + (number + self._block) / 1000
            time.sleep(max(0.0, due - time.monotonic()))
            frames = b""
            for each in range(number, number + self._block):
                counts = np.rint(self._pressure(each) * 32767 / FULL).astype(int)
                frames += encode(counts, counter=each, time_us=1000 * each)
            now = time.monotonic()
            if self.speaks:
                # There may be no reader yet, and a serial line does not wait.
                with contextlib.suppress(BlockingIOError):
                    os.write(self._ours, frames)
            for each in range(number, number + self._block):
                self.pushed[each] = now
            number += self._block


def watch_in_time() -> str:
    """Request real-time priority for the tap and the serial line, and disable the garbage collector; return the result.

    With the packets of ten seconds in memory, the collector would delay the network by 50 ms, and the units would fall
    silent.
    """
    gc.disable()
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(30))
    except OSError as wrong:
        return f"not granted: {wrong.strerror}"
    return "granted"


def plain() -> None:
    """Drop the real-time priority; the measured program requests its own."""
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


class Running:
    """`midair live` in a separate process, whose only child is the process of the loop.

    Parameters
    ----------
    tap : UdpTap
        Tap on its units.
    sensor : str
        Name of its sensor.
    """

    def __init__(self, tap: UdpProxy, sensor: str, *options: str, folder: Path | None = None) -> None:
        line = [sys.executable, "-m", "midair", "live", "--device", f"autd3:{tap.address}", "--sensor", sensor]
        line += ["--override-exposure", "a benchmark on emulated units", *options]
        self.tap, self.began = tap, time.monotonic()
        self.process = subprocess.Popen(
            line,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=folder,
            start_new_session=True,
            preexec_fn=plain,
        )

    def until_loud(self, patience: float = 60.0) -> None:
        """Wait until the array emits sound."""
        until = time.monotonic() + patience
        while not loud(self.tap):
            if self.process.poll() is not None or time.monotonic() > until:
                raise RuntimeError(self.process.communicate()[1])
            time.sleep(0.02)

    @property
    def child(self) -> int:
        """PID of the loop's process (the child that multiprocessing spawned); 0 if it has ended."""
        found = Path(f"/proc/{self.process.pid}/task")
        children = [int(pid) for task in found.iterdir() for pid in (task / "children").read_text().split()]
        loops = [pid for pid in children if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()]
        return loops[0] if loops else 0

    def end(self) -> tuple[str, str]:
        """Interrupt the program and return its output; kill it after a timeout."""
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.process.pid, signal.SIGCONT)
            self.process.send_signal(signal.SIGINT)
        try:
            return self.process.communicate(timeout=15)
        except subprocess.TimeoutExpired:
            self.process.kill()
            return self.process.communicate()


def frames_on(tap: UdpProxy, since: int = 0, unit: int | None = None) -> Iterator[tuple[float, int, int, np.ndarray]]:
    """(time, instant in µs, intensity, phases) of every frame of one unit that the client sent."""
    for at, port, datagram in list(tap.sent)[since:]:
        if datagram[1] == 0 and datagram[5] == SILENT_PATTERN and (unit is None or port == unit):
            instant = int.from_bytes(datagram[6:10], "little")
            yield at, instant, datagram[-249], np.frombuffer(datagram[20:269], np.uint8)


def loud(tap: UdpProxy) -> bool:
    """True if one of the last frames has sound."""
    return any(intensity > 0 for _, _, intensity, _ in frames_on(tap, max(0, len(tap.sent) - 40)))


def seconds_to_silence(tap: UdpProxy, since: float, patience: float = 3.0) -> tuple[float, str]:
    """Time from an event to silence, and its source: a silent frame without a later loud one, or the units.

    Units report when their failsafe has acted. A query counts as traffic for them, so they are queried only after 60 ms
    without traffic, and at most every 60 ms. The time is therefore an upper limit.
    """
    until, asked = since + patience, since
    while time.monotonic() < until:
        time.sleep(0.005)
        seen = [(at, intensity) for at, _, intensity, _ in frames_on(tap, max(0, len(tap.sent) - 4000))]
        last_loud = max((at for at, intensity in seen if intensity), default=0.0)
        silent = [at for at, intensity in seen if not intensity and at > max(last_loud, since)]
        now = time.monotonic()
        if silent and now - last_loud > 0.1:
            return silent[0] - since, "a silent frame"
        reached = seen[-1][0] if seen and tap.passes else since
        # After a silent frame, wait 100 ms for a loud one; the failsafe acts in the meantime.
        if not silent and seen and now - max(reached, asked) > 0.06:
            asked = time.monotonic()
            states = tap.states()
            if states and all(state & FAILSAFE for state in states):
                return asked - since, "the units' failsafe"
            asked = time.monotonic()
    return np.inf, "none"
