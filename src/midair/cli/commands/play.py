"""The command `play`: play a drive, a recording or a pattern."""

import shlex
from collections.abc import Callable
from dataclasses import replace
from math import log10
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from midair import devices, files, rig
from midair.cli.console import print_answer, print_grid, print_note, progress_bars
from midair.cli.exposure_options import HeatOptions, RoomOptions, print_air
from midair.cli.options import Force, PlayTakeOptions, StopInput, given, options_from, settings_from
from midair.cli.output import describe_drive, left_out_row, may_write, next_row, print_table
from midair.errors import ExposureError, InputError
from midair.evaluate import Felt, felt, too_loud, ways_to_play
from midair.model import Acoustics, Drive, Medium, Progress
from midair.patterns import PATTERN_ENDINGS, draw_file, load_pattern
from midair.pressure_level import predicted
from midair.settings import Settings
from midair.table import Details, Line


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
    room: RoomOptions | None = None,
    heat: HeatOptions | None = None,
    stop_input: StopInput = None,
    solve: PlayTakeOptions | None = None,
    drive: Path | None = None,
    plan: bool = False,
) -> int | None:
    """Play a drive or a recording on an array; on the virtual array, re-record the pressure.

    If solving is slower than playing, the command prints that and solves ahead, so that no gap follows.
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
    drive
        Drive of a recording to write, NAME.drive.h5, the same as by midair solve.
    plan
        Play nothing: solve a recording, also for quiet ears, and print by how many people each way to play it is felt.

    Examples
    --------
    $ midair play take.drive.h5
    $ midair play take.drive.h5 --device autd3
    $ midair play circle.toml
    $ midair play take.h5 --duration 0.1s --mode quick --drive felt.drive.h5
    $ midair play --plan take.h5
    """
    room = room or RoomOptions()
    medium = room.medium()
    settings = settings_from(
        rig.PlaySettings,
        options or PlayOptions(),
        exposure=room.limits(),
        acoustics=None if medium is None else Acoustics(medium=medium),
        cooling=(heat or HeatOptions()).cooling(),
    )
    device, target = settings.device, None
    solve, pattern = solve or PlayTakeOptions(), source.suffix.lower() in PATTERN_ENDINGS
    solved = pattern or source.name.lower().endswith(files.DRIVE_SUFFIX)
    if solved and (named := given(solve) or "--drive" * (drive is not None)):
        raise InputError(f"{named}: only for a recording; {source} is already solved and is played whole")
    if plan:
        if solved:
            raise InputError(f"--plan: expected a recording, got {source}, which is solved; name its recording")
        return _print_plan(source, solve, settings)
    if pattern:
        with TemporaryDirectory() as folder:
            drawn = _drawn_into(Path(folder), source, settings)
            again = Path(f"{source.stem}.rerecorded.h5") if output is None and device == "virtual" else output
            more: dict[str, Any] = {"options": options, "room": room, "heat": heat}
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
    if correct_air and medium is None:
        raise InputError("--correct-air: expected --temperature with it, got none")
    with devices.stop_on_input(stop_input), progress_bars() as stage:
        shown = _Shown(source, device, stage)
        if solved:
            try:
                played = rig.play(
                    source, correct_air=correct_air, observer=shown, progress=shown.progress, settings=settings
                )
            except ExposureError as refused:
                if refused.exposure is None or not _print_ways(source, refused.exposure.excess):
                    raise
                raise ExposureError(f"not played: {refused.exposure.verdict()}") from refused
        else:
            if correct_air:
                raise InputError("--correct-air: expected a drive, got a recording; it is solved for --temperature")
            if drive is not None:
                may_write(drive, force, files.DRIVE_SUFFIX)
            solve.refuse_idle_palm()
            solving = _solving(solve, medium)
            # Beside the reading of the recording, so that the check does not delay the first sound.
            array = rig.transducers_of(device, settings.placement)
            ready = rig.prepare_check(array, settings.exposure, solving.target.rate)
            pressure = rig.pressure_to_solve(source, solving, solve.start_at, solve.duration, lead=solve.lead)
            if device == "virtual":
                height, band = solving.target.grid.height, solving.calibration.band
                settings = settings.but(height=height, band=band, cells=pressure.sensor)
            player = rig.open_rig(settings=settings)
            print_air(solving.acoustics.medium, stated=medium is not None)
            shown.simulated = pressure.provenance.simulated
            how: Any = {"path": drive, "source": source, "observer": shown, "progress": shown.progress, "ready": ready}
            played = rig.play_pressure(pressure, solving, player, **how)
    part = played.report.duration if played.report else played.drive.frames / played.drive.rate
    found, table = played.exposure, list[Line]()
    answer, ears = f"played {part:.4g} s on {device}", ("ears", found.verdict())
    if played.report is not None:
        answer, table = played.report.broken or answer, _report_lines(played.report)
    elif played.take is not None and target is not None:
        heard = played.take.recording
        files.save(heard, target, calibration=played.take.calibration, force=True)
        answer = f"played {part:.4g} s on the virtual array"
        ears = ("ears", f"on a real array {too_loud(found.sound_excess)}")
        if played.drive.provenance.last("draw"):
            # Cells would spread the foci of a drawing.
            by = describe_drive(source)[1][0]
        else:
            came = rig.rerecorded_pressure(played.take, played.drive)
            by = ("felt", str(felt(came.pressure, came.rate, came.sensor.pitch)))
        table = [
            ("re-recorded", str(target)),
            by,
            Details([("silencer", str(heard.provenance.steps[-1].settings["silencer"]))]),
        ]
    if played.reaction is not None:
        middle, most = (1e3 * each for each in played.reaction)
        table.append(("pose to sending", f"median {middle:.1f} ms, 99 % within {most:.1f} ms"))
    if played.error is not None:
        mean = ("field error", f"{100 * played.error.mean():.1f} %, mean of all frames")
        table += [mean, ("drive", str(drive or "not written, --drive FILE keeps it"))]
    if not shown.verdict:
        table += [
            left_out_row(played.drive.provenance),
            ears,
            Details([("computed for", found.measured_in), ("heat", found.heat)]),
        ]
    original = source.with_name(source.name.replace(files.DRIVE_SUFFIX, ".h5"))
    table += [next_row("compare", original, target)] if target is not None and original.exists() else []
    print_table(table, answer=answer, simulated=shown.simulated, json=False)
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
        """Note whether the result is simulated."""
        self.simulated = self.simulated or array.simulated

    def cleared(
        self, array: devices.ArrayDevice | devices.ImmediateArray, drive: Drive, clearance: devices.ExposureClearance
    ) -> None:
        """Print the level, and the verdict for an array that emits sound."""
        if self._device == "virtual":
            return
        self.verdict, found = True, clearance.exposure
        more = Details([("computed for", found.measured_in), ("heat", found.heat)])
        checkup = ("checkup", rig.checkup_line(array.name, self._device))
        about: list[Line] = [left_out_row(drive.provenance)]
        if self._source.name.lower().endswith(files.DRIVE_SUFFIX):
            factor: Any = (clearance.drive or drive).provenance.last("attenuate").get("factor", 1.0)
            # Pressure goes with the square of the level.
            first, *others = describe_drive(self._source, change=40 * log10(factor))[1]
            about = [first, Details(others)]
        print_table([*about, ("ears", clearance.verdict()), more, checkup], json=False)

    def progress(self, done: int, total: int, /) -> None:
        """Draw the bar from the first frame on."""
        self._bar = self._bar or self._stage("play")
        self._bar(done, total)


def _print_ways(source: Path, excess: float) -> bool:
    """Print what a person may do about a refused drive, `excess` dB too loud, and who feels it; False if unknown."""
    solution, target = files.load_solution(source, streamed=True), files.load_target(source, streamed=True)
    if target is None:
        return False
    _, whole = predicted(source, solution, target)
    original = source.with_name(source.name.replace(files.DRIVE_SUFFIX, ".h5"))
    recording = shlex.quote(str(original)) if original.exists() else "RECORDING"
    ways = ways_to_play(whole, excess, source="" if target.provenance.last("draw") else recording)
    print_grid(_WAYS, [way.row for way in ways])
    return True


def _solving(options: PlayTakeOptions, medium: Medium | None) -> Settings:
    """Settings of a solve, for the stated air of the room."""
    made = options.settings()
    if medium is None:
        return made
    like = replace(medium, alpha=made.acoustics.medium.alpha)
    return made.but(acoustics=replace(made.acoustics, medium=like))


_WAYS = ("what you can do", "felt by", "option")


def _print_plan(source: Path, solve: PlayTakeOptions, settings: rig.PlaySettings) -> None:
    """Solve a recording as it is and for quiet ears, and print by how many people each way to play it is felt."""
    array, found, loud = rig.transducers_of(settings.device, settings.placement), list[Felt](), 0.0
    answer, limits = "", settings.exposure
    modes = {"solve": solve, "solve for quiet ears": replace(solve, mode="quiet", settings_file=None)}
    with TemporaryDirectory() as folder, progress_bars() as stage:
        for name, options in modes.items():
            own, path = _solving(options, limits.room), Path(folder) / f"{name}.drive.h5"
            pressure = rig.pressure_to_solve(source, own, options.start_at, options.duration, lead=options.lead)
            target, solution = rig.solve_to_file(pressure, array, own, path, progress=stage(name))
            found.append(predicted(path, solution, target)[1])
            if not answer:
                sound = devices.measure_exposure(solution.drive, array, limits.profile, room=limits.room)
                answer, loud = f"nothing was played; {sound.verdict()}", sound.excess
    print_answer(answer, simulated=True)
    if loud > 0:
        ways = ways_to_play(found[0], loud, source=shlex.quote(str(source)), quiet=found[1])
        print_grid(_WAYS, [way.row for way in ways])


def _drawn_into(folder: Path, source: Path, settings: rig.PlaySettings) -> Path:
    """The drive of a pattern for the array that will play it, in a folder."""
    array = rig.measured_transducers(settings.device, settings.placement)
    foci, target = load_pattern(source).foci(), folder / f"{source.stem}.drive.h5"
    with progress_bars() as stage:
        draw_file(foci, source, target, array, medium=settings.exposure.room, progress=stage("draw"))
    return target


def _report_lines(report: devices.PlayReport) -> list[Line]:
    start = "unknown" if report.start is None else f"{report.start} ns of device time"
    timing = f"{report.late} late, {report.repeated} repeated, {1e3 * report.gap:g} ms of gaps"
    whole = not (report.late or report.repeated or report.gap)
    return [
        ("timing", "every frame in time" if whole else f"{timing}, of {report.frames} frames"),
        ("paused", f"{report.paused:.1f} s in silence, since units were too hot" if report.paused else ""),
        ("units", report.units or "not reported"),
        Details([("frames", str(report.frames)), ("first frame", start), ("silencer", report.silencer)]),
    ]
