"""The command `play`: play a drive, a recording or a pattern."""

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from midair import devices, files, rig
from midair.cli.comparisons import unreproduced_rows
from midair.cli.console import banner, print_note, print_rows, progress_bars
from midair.cli.exposure_options import AirOptions, ExposureOptions, HeatOptions, print_air
from midair.cli.options import (
    Force,
    Lead,
    PartLength,
    PlaySolveOptions,
    StartAt,
    StopInput,
    options_from,
    settings_from,
)
from midair.cli.output import level_of_file, level_rows, may_write, reserved
from midair.errors import InputError
from midair.model import Acoustics, Drive, Progress
from midair.patterns import PATTERN_ENDINGS, draw_file, load_pattern


@options_from(
    rig.PlaySettings,
    *("device", "array_calibration", "placement", "silencer", "repeats", "delay", "participant", "spread", "seed"),
    *("follow", "tracker_latency", "confidence", "steer_only", "palm_path"),
    array_calibration="Measured transducers of the virtual device, NAME.array.h5 of midair calibrate array.",
)
class PlayOptions:
    """Array and playback."""


def play_command(
    source: Path,
    /,
    *,
    options: PlayOptions | None = None,
    output: Path | None = None,
    force: Force = False,
    correct_air: bool = False,
    exposure: ExposureOptions | None = None,
    air: AirOptions | None = None,
    heat: HeatOptions | None = None,
    stop_input: StopInput = None,
    solve: PlaySolveOptions | None = None,
    start_at: StartAt = 0.0,
    duration: PartLength = None,
    lead: Lead = None,
    drive: Path | None = None,
) -> int | None:
    """Play a drive or a recording on an array; on the virtual array, re-record the pressure.

    If this computer solves a recording more slowly than it plays, it says so, and solves ahead so that no gap follows.
    Refuses drives above the exposure profile on arrays and emulators, unless --override-exposure is given.
    Ctrl-C stops, and so does midair stop in another terminal. The exit status is 1 if more than a tenth of the touch
    was missing.

    Parameters
    ----------
    source
        Drive to play, NAME.drive.h5; recording with a calibration, NAME.h5, which is solved while it plays, with the
        options of midair solve; or pattern with an end, NAME.toml or NAME.adaptics, which is drawn first.
    output
        Re-recording of the virtual device. [default: NAME.rerecorded.h5]
    correct_air
        Correct the phases for the air of the room, exactly at the centre of the control points; needs --temperature.
    air
        Air of the room. A virtual device plays in the drive's own air if it is not stated. The exposure check takes the
        maximum over 2 degrees around it; if not stated, over 14 to 30 degrees.
    drive
        Drive of a recording to write, NAME.drive.h5, the same as by midair solve.

    Examples
    --------
    $ midair play take.drive.h5
    $ midair play take.drive.h5 --device autd3
    $ midair play circle.toml
    $ midair play take.h5 --duration 0.1s --mode quick --drive felt.drive.h5
    """
    air = air or AirOptions()
    room = air.medium()
    settings = settings_from(
        rig.PlaySettings,
        options or PlayOptions(),
        exposure=(exposure or ExposureOptions()).choices(room),
        acoustics=None if room is None else Acoustics(medium=room),
        cooling=(heat or HeatOptions()).cooling(),
    )
    device, target = settings.device, None
    solve, pattern = solve or PlaySolveOptions(), source.suffix.lower() in PATTERN_ENDINGS
    solved = pattern or source.name.lower().endswith(files.DRIVE_SUFFIX)
    if solved and (solve.typed() or drive is not None or start_at or duration is not None or lead is not None):
        raise InputError(f"options of midair solve, --drive: expected a recording with them, got {source}")
    if pattern:
        with TemporaryDirectory() as folder:
            drawn = _drawn_into(Path(folder), source, settings)
            again = Path(f"{source.stem}.rerecorded.h5") if output is None and device == "virtual" else output
            more: dict[str, Any] = {"options": options, "exposure": exposure, "air": air, "heat": heat}
            return play_command(
                drawn, output=again, force=force, correct_air=correct_air, stop_input=stop_input, **more
            )
    if device == "virtual":
        if stop_input is not None:
            raise InputError("--stop-input: expected an array, got --device virtual, which is silent; leave it out")
        if settings.delay:
            raise InputError("--delay: expected an array, got --device virtual, which plays at once; leave it out")
        target = output or Path(source.name.removesuffix(".h5").removesuffix(".drive") + ".rerecorded.h5")
        may_write(target, force)
    elif settings.array_calibration is not None:
        raise InputError(
            f"--array-calibration: expected --device virtual, got {device}; "
            "for a real array use midair solve --array-calibration"
        )
    elif output is not None or (force and drive is None) or settings.seed or settings.spread != "default":
        raise InputError(
            f"--output, --force, --seed, --spread: expected --device virtual, got {device}; "
            "midair loop re-records a real array"
        )
    if correct_air and room is None:
        raise InputError("--correct-air: expected --temperature with it, got none")
    with devices.stop_on_input(stop_input), progress_bars() as stage:
        shown = _Shown(source, device, stage)
        if solved:
            played = rig.play(
                source, correct_air=correct_air, observer=shown, progress=shown.progress, settings=settings
            )
        else:
            if correct_air:
                raise InputError("--correct-air: expected a drive, got a recording; it is solved for --temperature")
            if drive is not None:
                may_write(drive, force, files.DRIVE_SUFFIX)
            solve.refuse_idle_palm()
            solving = solve.settings()
            if room is not None:
                medium = replace(room, alpha=solving.acoustics.medium.alpha)
                solving = solving.but(acoustics=replace(solving.acoustics, medium=medium))
            pressure = rig.pressure_to_solve(source, solving, start_at, duration, lead=lead)
            if device == "virtual":
                like = {"height": solving.target.grid.height, "band": solving.calibration.band}
                settings = settings.but(**like, cells=pressure.sensor)
            print_air(solving.acoustics.medium, stated=room is not None)
            shown.simulated = pressure.provenance.simulated
            how: Any = {"path": drive, "source": source, "observer": shown, "progress": shown.progress}
            with nullcontext() if drive is None else reserved(drive):
                played = rig.play_pressure(pressure, solving, rig.open_rig(settings=settings), **how)
    rows = [] if played.report is None else _played_rows(played.report, played.drive, device)
    if target is not None and played.take is not None:
        heard = played.take.recording
        files.save(heard, target, calibration=played.take.calibration)
        rows = [
            ("played", f"{played.drive.frames} frames at {played.drive.rate:g} Hz on {device}"),
            ("re-recorded", f"{target}, {heard.frames} frames at {heard.rate:g} Hz"),
            ("silencer", str(heard.provenance.steps[-1].settings["silencer"])),
        ]
    if played.reaction is not None:
        middle, most = (1e3 * each for each in played.reaction)
        rows += [("pose to sending", f"median {middle:.1f} ms, 99 % within {most:.1f} ms")]
    if played.error is not None:
        rows += [
            ("E", f"{100 * played.error.mean():.1f} %, mean of all frames"),
            ("drive", str(drive or "not written")),
        ]
    if not shown.verdict:
        verdict = played.exposure.verdict() if target is not None else f"{played.outcome}: {played.exposure.verdict()}"
        rows += [*shown.about(played.drive), ("exposure", f"on a real array: {verdict}" if target else verdict)]
        rows += [("measured in", played.exposure.measured_in), ("heat", played.exposure.heat)]
    print_rows(rows)
    return int(played.report is not None and bool(played.report.broken))


class _Shown(rig.PlayObserver):
    """Prints what happens in a session: notes on stderr, and the verdict on a drive before it sounds."""

    def __init__(self, source: Path, device: str, stage: Callable[[str], Progress]) -> None:
        self._source, self._device, self._stage = source, device, stage
        self._bar: Progress | None = None
        self.simulated = False
        """Whether the touch was simulated."""
        self.verdict = False
        """Whether the verdict has been printed."""

    def note(self, text: str, *, warns: bool = False) -> None:
        """Print the line."""
        print_note(text, warn=warns)

    def opened(self, array: devices.ArrayDevice | devices.ImmediateArray) -> None:
        """Print that what follows is simulated, if it is."""
        banner(array.simulated or self.simulated)

    def cleared(
        self, array: devices.ArrayDevice | devices.ImmediateArray, drive: Drive, clearance: devices.ExposureClearance
    ) -> None:
        """Print the level, and the verdict for an array that emits sound."""
        if self._device == "virtual":
            return
        self.verdict, found = True, clearance.exposure
        rows = [("exposure", clearance.verdict()), ("measured in", found.measured_in), ("heat", found.heat)]
        print_rows([*self.about(drive), *rows, ("checkup", rig.checkup_line(array.name, self._device))])

    def about(self, drive: Drive) -> list[tuple[str, str]]:
        """Level of the drive of a file, and what a drive does not reproduce."""
        solved = self._source.name.lower().endswith(files.DRIVE_SUFFIX)
        level = level_rows(level_of_file(self._source, limits=False)) if solved else []
        return [*level, *unreproduced_rows(drive.provenance)]

    def progress(self, done: int, total: int, /) -> None:
        """Draw the bar from the first frame on."""
        self._bar = self._bar or self._stage("play")
        self._bar(done, total)


def _drawn_into(folder: Path, source: Path, settings: rig.PlaySettings) -> Path:
    """The drive of a pattern for the array that will play it, in a folder."""
    array = rig.transducers_of(settings.device, settings.placement)
    if settings.device != "virtual":
        known = rig.array_calibration_for(settings.device)
        array = array if known is None else known.known.applied(array)
    foci, target = load_pattern(source).foci(), folder / f"{source.stem}.drive.h5"
    with progress_bars() as stage:
        draw_file(foci, source, target, array, medium=settings.exposure.room, progress=stage("draw"))
    return target


def _played_rows(report: devices.PlayReport, drive: Drive, device: str) -> list[tuple[str, str]]:
    start = "unknown" if report.start is None else f"{report.start} ns of device time"
    return [
        *([("BROKEN", report.broken)] if report.broken else []),
        ("played", f"{report.frames} frames at {drive.rate:g} Hz on {device}, {report.duration:g} s"),
        ("first frame", start),
        ("timing", f"{report.late} late, {report.repeated} repeated, {1e3 * report.gap:g} ms of gaps"),
        *([("paused", f"{report.paused:.1f} s in silence, since units were too hot")] if report.paused else []),
        ("silencer", report.silencer),
        ("units", report.units or "not reported"),
    ]
