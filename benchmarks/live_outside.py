"""Live touch seen from outside: a sensor that we play, the wire to the emulated units, and the command between them."""

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

from midair.devices.sensors.serial_frames import encode
from midair.testing.udp_tap import UdpTap

SILENT_PATTERN, FAILSAFE = 0x16, 0x80
"""Command of a single frame; bit of the FPGA's state that says that the failsafe has silenced the unit."""

FULL = 100.0
"""Pressure of the converter's full scale, in Pa."""


class SerialSkin:
    """A sensor of 4 x 4 cells at 1 kHz behind a pty, two frames at a time, as a converter's firmware sends them.

    Parameters
    ----------
    pressure : callable
        Given the number of a frame, pressure on the 16 cells, in Pa.
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
                # Nobody may read yet: a line does not wait.
                with contextlib.suppress(BlockingIOError):
                    os.write(self._ours, frames)
            for each in range(number, number + self._block):
                self.pushed[each] = now
            number += self._block


def watch_in_time() -> str:
    """Real-time priority for the wire and the sensor's line, where it is granted; else why not.

    And no collector of garbage: with all datagrams of ten seconds in memory it holds up the wire for 50 ms, after which
    the units are silent.
    """
    gc.disable()
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(30))
    except OSError as wrong:
        return f"not granted: {wrong.strerror}"
    return "granted"


def plain() -> None:
    """What is measured asks for its priority itself."""
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


UNITS = """
import sys
from autd3 import UdpEmulator
units = UdpEmulator(int(sys.argv[1]))
print(units.option().iface, flush=True)
sys.stdin.read()
"""
"""A program that emulates units until its input ends, and first prints their address."""


class UnitsApart:
    """Emulated units in a process of their own, as real ones are no part of the computer that sends to them.

    With real-time priority where it is granted: a real unit does not wait for anybody.
    """

    def __init__(self, units: int) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-c", UNITS, str(units)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            preexec_fn=watch_in_time,
        )
        assert self._process.stdout is not None
        said = self._process.stdout.readline()
        self.address = "[::1]:" + "".join(filter(str.isdigit, said.rsplit(":", 1)[1]))

    def close(self) -> None:
        self._process.communicate("")


class Running:
    """`midair live` in a process of its own, whose loop's process is its only child.

    Parameters
    ----------
    tap : UdpTap
        Its units.
    sensor : str
        Its sensor.
    """

    def __init__(self, tap: UdpTap, sensor: str, *options: str, folder: Path | None = None) -> None:
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
        """Wait until it sounds."""
        until = time.monotonic() + patience
        while not loud(self.tap):
            if self.process.poll() is not None or time.monotonic() > until:
                raise RuntimeError(self.process.communicate()[1])
            time.sleep(0.02)

    @property
    def child(self) -> int:
        """The process of the loop: the one of its children that multiprocessing has spawned for work; 0 if it ended."""
        found = Path(f"/proc/{self.process.pid}/task")
        children = [int(pid) for task in found.iterdir() for pid in (task / "children").read_text().split()]
        loops = [pid for pid in children if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()]
        return loops[0] if loops else 0

    def end(self) -> tuple[str, str]:
        """What it printed, once it has ended; killed if it does not."""
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.process.pid, signal.SIGCONT)
            self.process.send_signal(signal.SIGINT)
        try:
            return self.process.communicate(timeout=15)
        except subprocess.TimeoutExpired:
            self.process.kill()
            return self.process.communicate()


def frames_on(tap: UdpTap, since: int = 0, unit: int | None = None) -> Iterator[tuple[float, int, int, np.ndarray]]:
    """(when it went by, instant in µs, intensity, phases) of every frame of one unit that the client sent."""
    for at, port, datagram in list(tap.sent)[since:]:
        if datagram[1] == 0 and datagram[5] == SILENT_PATTERN and (unit is None or port == unit):
            instant = int.from_bytes(datagram[6:10], "little")
            yield at, instant, datagram[-249], np.frombuffer(datagram[20:269], np.uint8)


def loud(tap: UdpTap) -> bool:
    """Whether one of the last frames sounds."""
    return any(intensity > 0 for _, _, intensity, _ in frames_on(tap, max(0, len(tap.sent) - 40)))


def seconds_to_silence(tap: UdpTap, since: float, patience: float = 3.0) -> tuple[float, str]:
    """From an event to silence, and by whose word: a silent frame on the wire that no loud one follows, or the units.

    Units whose failsafe has acted say so themselves. A question is a word to them, too: they are asked when nothing has
    reached them for 60 ms, and not again for as long. So the time is one by which they were silent.
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
        # Where a silent frame went by, 100 ms show whether a loud one follows; their failsafe acts meanwhile.
        if not silent and seen and now - max(reached, asked) > 0.06:
            asked = time.monotonic()
            states = tap.states()
            if states and all(state & FAILSAFE for state in states):
                return asked - since, "the units' failsafe"
            asked = time.monotonic()
    return np.inf, "nobody"
