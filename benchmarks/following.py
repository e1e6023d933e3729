"""A drive on four emulated AUTD3 units that follows a palm, seen from the wire: `python -m benchmarks.following`.

`silence`: the palm does something wrong .5 s after the first frame, for .4 s. Times in ms from the first wrong pose, or
the last one where they end, until the output of the units begins to fall and until it is silent; and from the first
right pose until it is at full level again. The output is that of the makers' firmware emulator, sampled every 25 us,
which gets the frames of the wire at their instants. `wire`: time from a pose to the datagram of the first frame that is
steered to it, at 1 kHz.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass

import numpy as np
from autd3.commands import Pattern
from autd3_pattern import PhaseBuffer
from numpy.typing import NDArray
from tests.devices.trackers.test_tracker_contract import Leap, Osc
from tests.simulators.autd3_firmware import Autd3Firmware
from tests.simulators.moving_hand import SOLVED, Fault, Hand, palm
from tests.simulators.udp_proxy import UdpProxy

from benchmarks.clock import load
from benchmarks.live_outside import frames_on, watch_in_time
from midair.devices import ExposureChoices, Tracker, autd3_immediate
from midair.devices.arrays.silencer import Silencer
from midair.files import DEFAULT_PROFILE, profile_named
from midair.model import Acoustics, ControlGrid, Drive, PalmPath, Placement
from midair.physics import focus_phase
from midair.rig import PlaySettings, open_tracker
from midair.rig.playing.following import clear_followed, play_followed

Values = NDArray[np.float64]
GRID = ControlGrid(rows=4, columns=4, pitch=5e-3)
BEGIN = 0.5
"""Time of the fault after the first frame, in s."""


def away(metres: float) -> Fault:
    return lambda values, stamp, _: (values + np.r_[metres, np.zeros(8)], stamp, 1.0)


FAULTS: Mapping[str, Fault] = {
    "nothing is wrong": lambda values, stamp, _: (values, stamp, 1.0),
    "leaves the box (60 mm to the side)": away(0.06),
    "confidence .1": lambda values, stamp, _: (values, stamp, 0.1),
    "no more poses": lambda *_: None,
    "freezes": lambda _, stamp, since: (palm(stamp - since), stamp, 1.0),
    "jumps by 1 m": away(1.0),
    "NaN": lambda values, stamp, _: (values * np.nan, stamp, 1.0),
    "time stamps .5 s old": lambda values, stamp, _: (values, stamp - 0.5, 1.0),
    "the service ends": lambda *_: None,
}


def focus(frames: int) -> Drive:
    """A still focus at 1 kHz."""
    array = Placement.grid().array()
    phase = np.broadcast_to(focus_phase(array, SOLVED, acoustics=Acoustics()), (frames, array.count))
    return Drive(phase=phase, level=np.full(frames, 0.5), rate=1000.0, array=array, acoustics=Acoustics())


class Watched(Tracker):
    """A tracker that notes when it was read, and the time of the newest pose then."""

    read: list[tuple[float, float]]

    def poses(self, since: float = -np.inf) -> PalmPath | None:
        found = super().poses(since)
        self.read.append((time.monotonic(), since if found is None else float(found.time[-1])))
        return found


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """A play, as it was on the wire."""

    start: int  # Instant of the first frame, in ns of device time
    ahead: int  # Device time minus the computer's clock, in ns
    wrong: float  # Time of the first wrong pose, or of the last one, on the computer's clock, in s
    right: float  # Time of the first right pose after it
    frames: list[tuple[float, int, int, NDArray[np.uint8]]]  # Time of sending, instant in us, intensity, phases
    read: list[tuple[float, float]]
    late: int


def run(fault: Fault, sender: Leap | Osc, duration: float, *, dies: bool = False) -> Run:
    """Play a focus on four emulated units while the palm of a sender is followed."""
    tap = UdpProxy(4)
    settings = PlaySettings(
        exposure=ExposureChoices(profile=profile_named(DEFAULT_PROFILE), override="a benchmark on emulated units")
    )
    drive, array = focus(round(1000 * duration)), autd3_immediate(tap.address)
    try:
        with array, Hand(sender, fault, dies=dies) as hand, open_tracker(sender.name) as tracker:
            tracker.__class__, tracker.read = Watched, []  # type: ignore[attr-defined]
            clearance = clear_followed(drive, array, settings, GRID, samples=8)
            ahead = array.units.now() - time.monotonic_ns()

            def begun(done: int, _: int) -> None:
                if hand.wrong_at == np.inf and done >= 1000 * BEGIN:
                    hand.wrong_at = time.monotonic()

            report, _ = play_followed(
                drive, array, tracker, settings, clearance, GRID, report=lambda _: None, progress=begun
            )
        units = sorted({port for _, port, _, _ in tap.frames()})
        sent = [each for each in frames_on(tap, unit=units[0]) if each[1] * 1000 >= report.start]
        return Run(
            start=report.start,
            ahead=ahead,
            wrong=hand.wrong,
            right=hand.right,
            frames=sent,
            read=tracker.read,  # type: ignore[attr-defined]
            late=report.late,
        )
    finally:
        tap.close()


def put_out(made: Run) -> tuple[Values, Values]:
    """Time in s on the computer's clock, and strength 0 to 1, of the output of a unit for the frames of the wire."""
    unit = Autd3Firmware(Placement.grid(columns=1, rows=1))
    unit.set_silencer(Silencer(phase=0, intensity=0))
    begin = unit.now()
    for _, instant, intensity, phases in made.frames:
        unit.wait_until(begin + 1000 * instant - made.start)
        unit._open.send(Pattern(PhaseBuffer.from_array(np.array(phases)[None]), intensity))
    unit.wait_until(unit.now() + 1_000_000)
    width = unit.put_out().pulse_width.max(axis=1)
    clock = (made.start - made.ahead) * 1e-9
    return clock + np.arange(len(width)) * 25e-6, np.sin(np.pi * width / 512)


def silence() -> None:
    print("| | falls after ms | silent after ms | loud again after ms | late frames |\n|---|---|---|---|---|")
    for name, fault in FAULTS.items():
        dies = name == "the service ends"
        sender = Leap() if dies else Osc()
        with closing(sender):
            made = run(fault, sender, 1.2, dies=dies)
        at, strength = put_out(made)
        full = strength[at < made.wrong].max()
        falls = first(at, (strength < 0.98 * full) & (at > made.wrong)) - made.wrong
        silent = first(at, (strength == 0) & (at > made.wrong)) - made.wrong
        back = first(at, (strength > 0.98 * full) & (at > made.right)) - made.right
        figures = (falls, silent, back if silent > 0 else np.nan)
        texts = ("-" if np.isnan(each) else f"{1e3 * each:.0f}" for each in figures)
        print(f"| {name} | {' | '.join(texts)} | {made.late} |", flush=True)


def first(at: Values, where: NDArray[np.bool_]) -> float:
    return float(at[np.argmax(where)]) if where.any() else np.nan


def wire(seconds: float) -> None:
    sender = Osc()
    with closing(sender):
        made = run(FAULTS["nothing is wrong"], sender, seconds)
    sent = np.sort([at for at, _, _, _ in made.frames])
    found, before = [], -np.inf
    for read, newest in made.read:
        # All frames of earlier blocks have left by then; steering takes longer than what the proxy may be late.
        first = np.searchsorted(sent, read + 3e-4)
        if newest > before and first < len(sent):
            found.append(1e3 * (sent[first] - newest))
        before = max(before, newest)
    middle, most = np.percentile(found, [50, 99])
    print(f"pose to wire: {len(found)} poses, median {middle:.1f} ms, 99 % {most:.1f} ms; {made.late} frames late")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.following", description=__doc__.splitlines()[0])
    parser.add_argument("--part", choices=("silence", "wire"), nargs="+", default=["silence", "wire"])
    parser.add_argument("--seconds", type=float, default=10.0, help="duration of the play of wire in s (default 10)")
    options = parser.parse_args()
    print(f"real-time priority: {watch_in_time()}; {load()}")
    if "silence" in options.part:
        silence()
    if "wire" in options.part:
        wire(options.seconds)


if __name__ == "__main__":
    main()
