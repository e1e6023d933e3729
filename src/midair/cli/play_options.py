"""Playing on real arrays and emulators: options, exposure check, report."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from cyclopts import Parameter

from midair.cli.air_options import note_air
from midair.cli.console import banner, err, print_rows, progress_bars
from midair.cli.exposure_options import ExposureOptions, print_check_time
from midair.cli.options import Time
from midair.cli.rows import level_of_file, level_rows
from midair.devices import ArrayDevice, Cooling, ExposureClearance, PlayReport, SilencerChoice, check_exposure
from midair.files import check_memory_for, load_placement, load_solution, load_target
from midair.model import Drive, Medium
from midair.rig import array_named, check_air, play_cleared


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class PlayOptions(ExposureOptions):
    """Playback options and exposure limits.

    Parameters
    ----------
    repeats
        Number of times to play the drive, without gaps.
    delay
        Time before the first frame.
    silencer
        How the array smooths phase steps; auto: least simulated pressure error; default: the firmware's 1 ms.
    placement
        TOML file with position and rotation of the units. [default: two by two, side by side]
    """

    repeats: int = 1
    delay: Time = 0.0
    silencer: SilencerChoice = "auto"
    placement: Path | None = None

    def admit(self, drive: Drive, device: ArrayDevice, room: Medium | None) -> ExposureClearance:
        """Check the exposure of a drive on this device in the air of the room."""
        choices = self.choices(room)
        print_check_time(drive, choices.profile, room=room)
        return check_exposure(drive, device, choices, repeats=self.repeats)


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class HeatOptions:
    """Action if a unit of the array reports that it is too hot.

    Parameters
    ----------
    when_hot
        stop: end with status 1. wait: pause in silence, and continue once all units have been cool for a second.
    cooling_limit
        Longest pause of --when-hot wait; playback then ends with status 1.
    """

    when_hot: Literal["stop", "wait"] = "stop"
    cooling_limit: Time = 600.0

    def cooling(self) -> Cooling | None:
        """Permission to wait; None to stop. Pauses are printed on stderr."""
        if self.when_hot == "stop":
            return None
        return Cooling(limit=self.cooling_limit, report=lambda text: err().print(f"midair: {text}"))


def print_room_air(drive: Drive, source: Path, room: Medium | None, *, simulated: bool = False) -> None:
    """Print on stderr how the air of the room changes the drive of a file."""
    found = check_air(drive, room, lambda: load_target(source, streamed=True), simulated=simulated)
    note_air(found.said, warn=found.warns)


def play_on_array(
    source: Path, device: str, options: PlayOptions, room: Medium | None, cooling: Cooling | None = None
) -> None:
    """Play the drive of a file on a real array or an emulator, and print the result."""
    placement = None if options.placement is None else load_placement(options.placement)
    array = array_named(device, placement, silencer=options.silencer)
    array.cooling = cooling
    # Reserved before a long drive is read and checked: `midair stop` works, and no other program gets the units.
    with array.reserved():
        drive = load_solution(source, streamed=True).drive
        if not array.streams:
            # Phases, and the driver's copy of them.
            check_memory_for(
                2 * drive.phase.nbytes, f"{source}, to be played on {device}", "cut it, or play it on AUTD3 units"
            )
            drive = load_solution(source).drive
        admission = options.admit(drive, array, room)
        print_room_air(drive, source, room)
        rows = [("exposure", admission.verdict()), ("measured in", admission.exposure.measured_in)]
        rows.append(("heat", admission.exposure.heat))
        print_rows([*level_rows(level_of_file(source, limits=False)), *rows])
        with progress_bars() as stage, array:
            # Known only after opening the device.
            banner(array.simulated)
            report = play_cleared(
                admission, array, source=source, delay=options.delay, progress=stage("play"), room=room
            )
    print_rows(_rows(report, drive, device))


def _rows(report: PlayReport, drive: Drive, device: str) -> list[tuple[str, str]]:
    start = "unknown" if report.start is None else f"{report.start} ns of device time"
    return [
        ("played", f"{report.frames} frames at {drive.rate:g} Hz on {device}, {report.duration:g} s"),
        ("first frame", start),
        ("timing", f"{report.late} late, {report.repeated} repeated, {1e3 * report.gap:g} ms of gaps"),
        *([("paused", f"{report.paused:.1f} s in silence, since units were too hot")] if report.paused else []),
        ("silencer", report.silencer),
        ("units", report.units or "not reported"),
    ]
