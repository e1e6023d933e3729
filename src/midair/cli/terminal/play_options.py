"""Playing on arrays other than the virtual one: options, order, report."""

from dataclasses import dataclass
from pathlib import Path

from cyclopts import Parameter

from midair.cli.terminal.air_options import note_air
from midair.cli.terminal.console import banner, print_rows, progress_bars
from midair.cli.terminal.exposure_options import ExposureOptions, say_how_long
from midair.cli.terminal.options import Time
from midair.cli.terminal.rows import level_of_file, level_rows
from midair.devices import ArrayDevice, ExposureClearance, PlayReport, SilencerChoice, check_exposure
from midair.files import check_fits, load_placement, load_solution, load_target
from midair.model import Drive, Medium
from midair.rig import array_named, play_cleared, room_air


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class PlayOptions(ExposureOptions):
    """How a drive is played, and what it may expose people to.

    Parameters
    ----------
    repeats
        How often, one time after the other without a gap.
    delay
        Before the first frame.
    silencer
        How the array spreads phase steps: auto takes the one with the least simulated error of the pressure; off,
        quarter and half of a frame; default is the firmware's own 1 ms.
    placement
        TOML file with position and rotation of the units; two by two side by side if not given.
    """

    repeats: int = 1
    delay: Time = 0.0
    silencer: SilencerChoice = "auto"
    placement: Path | None = None

    def admit(self, drive: Drive, device: ArrayDevice, room: Medium | None) -> ExposureClearance:
        """The drive, once its exposure on this device is checked in the air of the room."""
        choices = self.choices(room)
        say_how_long(drive, choices.profile, room=room)
        return check_exposure(drive, device, choices, repeats=self.repeats)


def say_room(drive: Drive, source: Path, room: Medium | None, *, simulated: bool = False) -> None:
    """Say on the error stream what the air of the room does to the drive of a file."""
    found = room_air(drive, room, lambda: load_target(source, streamed=True), simulated=simulated)
    note_air(found.said, warn=found.warns)


def play_on_array(source: Path, device: str, options: PlayOptions, room: Medium | None) -> None:
    """Play a drive's file on a device that is not virtual, in the air of a room, and print how it went."""
    placement = None if options.placement is None else load_placement(options.placement)
    array = array_named(device, placement, silencer=options.silencer)
    # Reserved before a long drive is read and checked, so that this can be stopped too, and nobody else gets the units.
    with array.reserved():
        drive = load_solution(source, streamed=True).drive
        if not array.streams:
            # Phases, and what the driver makes of them.
            check_fits(
                2 * drive.phase.nbytes, f"{source}, to be played on {device}", "cut it, or play it on AUTD3 units"
            )
            drive = load_solution(source).drive
        admission = options.admit(drive, array, room)
        say_room(drive, source, room)
        rows = [("exposure", admission.verdict()), ("measured in", admission.exposure.measured_in)]
        print_rows([*level_rows(level_of_file(source)), *rows])
        with progress_bars() as stage, array:
            # Only now the units have said whether they are real.
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
        ("silencer", report.silencer),
        ("units", report.units or "cannot be asked"),
    ]
