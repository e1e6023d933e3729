"""The commands `solve` and `play`."""

from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from cyclopts import Parameter

from midair.cli.comparisons import calibrated_part, unreproduced_rows, with_array_calibration, with_unreproduced
from midair.cli.console import banner, print_json, print_note, print_rows, progress_bars
from midair.cli.exposure_options import (
    AirOptions,
    ExposureOptions,
    HeatOptions,
    air_watched,
    print_air,
    print_check_time,
)
from midair.cli.options import (
    ArrayCalibration,
    Force,
    Json,
    Lead,
    PartLength,
    RecordingOptions,
    SolveOptions,
    StartAt,
    StopInput,
    options_from,
    settings_from,
)
from midair.cli.output import level_of_file, level_rows, may_write, solve_error, warn_level
from midair.cli.time_estimates import workload_of
from midair.devices import ArrayDevice, ExposureClearance, PlayReport, check_exposure, stop_on_input
from midair.errors import InputError
from midair.evaluate import error_at_temperature
from midair.files import (
    DRIVE_SUFFIX,
    check_memory_for,
    load_placement,
    load_solution,
    load_target,
    save,
    save_solutions,
)
from midair.headroom import level_of
from midair.model import Acoustics, Drive, Medium, PressureFrames, Progress, TransducerArray
from midair.physics import Exposure
from midair.pipeline import Reproduction, reproduce_stream, required_lead
from midair.rig import (
    ArrayKind,
    PlaySettings,
    array_of_kind,
    check_air,
    checkup_line,
    correct_air_of_file,
    kept_array_calibration,
    open_rig,
    play_cleared,
    rerecord,
    solving,
)
from midair.settings import Settings
from midair.targets import add_lead, frames_without_lead


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingPart:
    """Part of a recording."""

    start_at: StartAt = 0.0
    duration: PartLength = None
    lead: Lead = None

    def pressure(
        self, source: Path, settings: Settings, array: TransducerArray, calibration: Path | None, device: str
    ) -> tuple[TransducerArray, Settings, PressureFrames]:
        """Transducers and settings for a measured array, and the pressure of the part with its lead."""
        piece = calibrated_part(source, settings, self.start_at, self.duration, streamed=True)
        piece = with_unreproduced(source, piece, settings.calibration.band)
        pressure = add_lead(piece, required_lead(settings) if self.lead is None else self.lead)
        return with_array_calibration(calibration, array, settings, pressure, device=device)


def solve_command(
    source: Path,
    output: Path | None = None,
    /,
    *,
    options: SolveOptions | None = None,
    part: RecordingPart | None = None,
    array: ArrayKind = "autd3",
    placement: Path | None = None,
    device: str = "virtual",
    array_calibration: ArrayCalibration = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Compute transducer phases that reproduce a recording.

    Parameters
    ----------
    source
        Recording with a calibration, NAME.h5.
    output
        Drive to write, NAME.drive.h5. [default: name of the source]
    array
        autd3: two by two units. openmpd, openmpd-twin (experimental): one board, two facing boards.
    placement
        TOML file with position and rotation of AUTD3 units.
    device
        Array on which the drive will be played, as in midair play, to use its stored calibration.

    Examples
    --------
    $ midair solve take.h5
    $ midair solve take.h5 part.drive.h5 --duration 0.1s --mode quick
    """
    options = options or SolveOptions()
    settings = options.settings()
    options.refuse_idle_palm()
    if placement is not None and array != "autd3":
        raise InputError(f"--placement: expected --array autd3, got {array}; leave out one of them")
    transducers = array_of_kind(array) if placement is None else load_placement(placement).array()
    target = output or Path(source.name.removesuffix(source.suffix) + ".drive.h5")
    may_write(target, force, ".drive.h5")
    part = part or RecordingPart()
    transducers, settings, pressure = part.pressure(source, settings, transducers, array_calibration, device)
    banner(pressure.provenance.simulated)
    print_air(settings.acoustics.medium, stated=options.air_is_stated)
    frames = round(pressure.frames / pressure.rate * settings.target.rate)
    with progress_bars(f"solve {workload_of(settings, transducers.count)}", frames) as stage:
        wanted, parts = reproduce_stream(pressure, transducers, settings, progress=stage("solve"))
        save_solutions(parts, target, frames=wanted.frames, target=wanted)
    # Read back from the file: the lazy frames would be computed again.
    solution = load_solution(target, streamed=True)
    made = Reproduction(pressure=pressure, target=load_target(target, streamed=True) or wanted, solution=solution)
    level = level_of(solution, made.target, band=settings.calibration.band)
    inside = frames_without_lead(made.target.provenance, made.target.frames, made.target.rate)
    plays = np.array([status != "silent" for status in solution.status])
    error = solve_error(solution, made.target)
    warn_level(level)
    if json:
        told = {"frames": made.target.frames, "lead_frames": inside.start, "rate_hz": made.target.rate}
        simulated = pressure.provenance.simulated
        return print_json(
            {"drive": str(target), "simulated": simulated, **told, **error.plain(), "level": level.plain()}
            | {"not_reproduced": dict(pressure.provenance.last("not reproduced"))}
        )
    print_rows(
        [
            ("drive", f"{target} for {transducers.name}, {transducers.count} transducers"),
            (
                "frames",
                f"{made.target.frames} at {settings.target.rate:g} Hz, {int((~plays).sum())} silent, {inside.start} of "
                "lead at either end",
            ),
            *level.rows(),
            *unreproduced_rows(pressure.provenance),
            ("E", str(error)),
            *_robustness_rows(made, settings),
            ("solver", f"{settings.solver.name}, {solution.iterations[plays].mean():.1f} iterations a frame"),
        ]
    )
    return None


def _robustness_rows(made: Reproduction, settings: Settings) -> list[tuple[str, str]]:
    """E in the coldest and the warmest air of --robust, estimated from 256 frames; no rows without a range."""
    by, drive = settings.solver.robust, made.solution.drive
    if not by:
        return []
    ends = [drive.acoustics.medium.warmer(degrees) for degrees in (-by, by)]
    errors = [error_at_temperature(drive, made.target, medium, frames=256) for medium in ends]
    told = [f"{100 * error.mean():.1f} % at {end.degrees:.3g} °C" for error, end in zip(errors, ends, strict=True)]
    return [("E in other air", ", ".join(told))] if all(map(len, errors)) else []


@options_from(
    PlaySettings,
    *("device", "array_calibration", "placement", "silencer", "repeats", "delay", "participant", "spread", "seed"),
)
class PlayOptions:
    """Array and playback."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Recording:
    """A recording that is solved while it plays."""

    source: Path
    settings: Settings
    part: RecordingPart
    calibration: Path | None
    play: PlaySettings
    keep: Path | None

    @contextmanager
    def solving(self, device: ArrayDevice, progress: Progress) -> Generator[ExposureClearance]:
        """While inside, solve the recording for a device; yields the clearance of the frames to come."""
        play, choices = self.play, self.play.exposure
        transducers, settings, pressure = self.part.pressure(
            self.source, self.settings, device.array, self.calibration, play.device
        )
        every = "--attenuate" if choices.attenuate else "--repeats" if play.repeats > 1 else ""
        if every:
            print_note(f"{every}: the first frame plays when all frames are solved and checked")
        with solving(
            pressure,
            transducers,
            settings,
            device,
            choices,
            repeats=play.repeats,
            keep=self.keep,
            progress=progress,
        ) as stream:
            admission = stream.clearance()
            seconds = stream.delay()
            # A virtual array plays as fast as it can.
            if seconds and device.gated:
                print_note(
                    f"this computer solves {stream.speed:.2g} s of this recording in a second: it solves ahead, and "
                    f"the first frame plays in about {seconds:.0f} s"
                )
            yield admission


def play_command(
    source: Path,
    /,
    *,
    options: PlayOptions | None = None,
    solve: RecordingOptions | None = None,
    part: RecordingPart | None = None,
    drive: Path | None = None,
    output: Path | None = None,
    force: Force = False,
    correct_air: bool = False,
    exposure: ExposureOptions | None = None,
    air: AirOptions | None = None,
    heat: HeatOptions | None = None,
    stop_input: StopInput = None,
) -> None:
    """Play a recording or a drive on an array; on the virtual array, re-record the pressure.

    A recording is solved and checked while it plays; if this computer is too slow, it first solves ahead.
    Refuses drives above the exposure profile on arrays and emulators, unless --override-exposure is given.
    Ctrl-C stops, and so does midair stop in another terminal.

    Parameters
    ----------
    source
        Recording with a calibration, NAME.h5, or drive, NAME.drive.h5.
    drive
        Drive of a recording to write while it plays, NAME.drive.h5, as midair solve does.
    output
        Re-recording of the virtual device. [default: NAME.rerecorded.h5]
    correct_air
        Correct the phases for the air of the room, exactly at the centre of the control points; needs --temperature.
    air
        Air of the room, for which a recording is solved. A virtual device plays in the drive's own air if it is not
        stated. The exposure check takes the
        maximum over 2 degrees around it; if not stated, over 14 to 30 degrees.

    Examples
    --------
    $ midair play take.h5
    $ midair play take.drive.h5 --device autd3
    """
    air, options = air or AirOptions(), options or PlayOptions()
    room = air.medium()
    solve, part = solve or RecordingOptions(), part or RecordingPart()
    solved = source.name.lower().endswith(DRIVE_SUFFIX)
    if solved:
        _refuse_for_drive(solve, part, drive)
    calibration: Any = getattr(options, "array_calibration", None)
    if not solved and getattr(options, "device", "") != "virtual":
        changed: Any = options
        options = replace(changed, array_calibration=None)
    settings = settings_from(
        PlaySettings,
        options,
        exposure=(exposure or ExposureOptions()).choices(room),
        acoustics=None if room is None else Acoustics(medium=room),
        cooling=(heat or HeatOptions()).cooling(),
    )
    device = settings.device
    recording = None
    if not solved:
        if correct_air:
            raise InputError("--correct-air: expected a drive, got a recording, which is solved for --temperature")
        solve.refuse_idle_palm()
        if drive is not None:
            may_write(drive, force, DRIVE_SUFFIX)
        recording = _Recording(
            source=source,
            settings=solve.settings_in(air.temperature, air.humidity),
            part=part,
            calibration=calibration,
            play=settings,
            keep=drive,
        )
    if device == "virtual":
        if stop_input is not None:
            raise InputError("--stop-input: expected an array, got --device virtual, which is silent; leave it out")
        if settings.delay:
            raise InputError("--delay: expected an array, got --device virtual, which plays at once; leave it out")
        target = output or Path(source.name.removesuffix(".h5").removesuffix(".drive") + ".rerecorded.h5")
        may_write(target, force)
        return _play_on_virtual(recording or source, target, settings, air, correct=correct_air)
    if settings.array_calibration is not None:
        raise InputError(
            f"--array-calibration: expected --device virtual, got {device}; "
            "for a real array use midair solve --array-calibration"
        )
    if output is not None or (force and drive is None) or settings.seed or settings.spread != "default":
        raise InputError(
            f"--output, --force, --seed, --spread: expected --device virtual, got {device}; "
            "midair loop re-records a real array"
        )
    with stop_on_input(stop_input):
        return _play_on_array(recording or source, settings, air, correct=correct_air)


def _refuse_for_drive(solve: RecordingOptions, part: RecordingPart, drive: Path | None) -> None:
    """Raise InputError for an option that only a recording takes."""
    given = [word for word in solve.typed() if word.startswith("--")]
    given += [f"--{one.name.replace('_', '-')}" for one in fields(part) if getattr(part, one.name) != one.default]
    if given or drive is not None:
        raise InputError(f"{given[0] if given else '--drive'}: expected a recording, got a drive, which is solved")


def _play_on_virtual(
    what: "_Recording | Path", target: Path, settings: PlaySettings, air: AirOptions, *, correct: bool
) -> None:
    """Play a recording or the drive of a file on the virtual array, save its re-recording, and print the result."""
    room = settings.exposure.room
    banner(True)
    level: list[tuple[str, str]] = []
    with ExitStack() as stack:
        if isinstance(what, _Recording):
            source = what.source
            stage = stack.enter_context(progress_bars())
            device = open_rig(settings=settings).array
            admission = stack.enter_context(what.solving(device, stage("solve")))
            drive: Any = admission.drive
            rig = open_rig(drive=drive, settings=settings)
            print_air(drive.acoustics.medium, stated=room is not None)
        else:
            source = what
            drive = load_solution(source, streamed=True).drive
            level = level_rows(level_of_file(source, limits=False))
            rig = open_rig(drive=drive, settings=settings)
            drive = _corrected(drive, source, room) if correct else drive
            _print_room_air(drive, source, room, simulated=True)
            known = Settings.of(drive.provenance) or Settings()
            kind = f"play and re-record {workload_of(known, drive.array.count)}"
            stage = stack.enter_context(progress_bars(kind, drive.frames))
            admission = _admitted(drive, rig.array, settings)
        stack.enter_context(air_watched(air.temperature, drive.acoustics.medium, advice=PLAY_AGAIN))
        stack.enter_context(rig)
        sensor: Any = rig.sensor
        sensor.streamed = True
        recording = rerecord(admission, rig.array, sensor, source=source, progress=stage("play and re-record"))
    save(recording, target, calibration=sensor.calibration)
    print_rows(
        [
            ("played", f"{drive.frames} frames at {drive.rate:g} Hz on {settings.device}"),
            ("re-recorded", f"{target}, {recording.frames} frames at {recording.rate:g} Hz"),
            ("silencer", str(recording.provenance.steps[-1].settings["silencer"])),
            *level,
            *unreproduced_rows(drive.provenance),
            ("exposure", f"on a real array: {_found(admission).verdict()}"),
            ("measured in", _found(admission).measured_in),
        ]
    )


def _found(admission: ExposureClearance) -> Exposure:
    """The exposure that was measured, of a stream to its end or so far."""
    return admission.exposure if admission.stream is None else admission.stream.exposure or admission.exposure


def _admitted(drive: Drive, device: ArrayDevice, settings: PlaySettings) -> ExposureClearance:
    """Check the exposure of a drive on this device, after an estimate of the time for a long one."""
    print_check_time(drive, settings.exposure.profile, room=settings.exposure.room)
    return check_exposure(drive, device, settings.exposure, repeats=settings.repeats)


PLAY_AGAIN = "solve it again for this air, or play it again with --correct-air"
"""Advice if the air drifts while a drive plays."""


def _corrected(drive: Drive, source: Path, room: Medium | None) -> Drive:
    """The drive of a file with its phases corrected for the air of the room."""
    if room is None:
        raise InputError("--correct-air: expected --temperature with it, got none")
    corrected = correct_air_of_file(drive, source, room)
    print_note(f"air: phases corrected from {drive.acoustics.medium} to {room}")
    return corrected


def _print_room_air(drive: Drive, source: Path, room: Medium | None, *, simulated: bool = False) -> None:
    """Print on stderr how the air of the room changes the drive of a file."""
    found = check_air(drive, room, lambda: load_target(source, streamed=True), simulated=simulated)
    print_note(found.said, warn=found.warns)


def _play_on_array(what: "_Recording | Path", settings: PlaySettings, air: AirOptions, *, correct: bool) -> None:
    """Play a recording or the drive of a file on a real array or an emulator, and print the result."""
    room, device = settings.exposure.room, settings.device
    rig = open_rig(settings=settings)
    array = rig.array
    # Reserved before a long drive is read and checked: `midair stop` works, and no other program gets the units.
    with array.reserved(), ExitStack() as stack:
        level: list[tuple[str, str]] = []
        stage = stack.enter_context(progress_bars())
        if isinstance(what, _Recording):
            source = what.source
            admission = stack.enter_context(what.solving(array, stage("solve")))
            drive: Any = admission.drive
            print_air(drive.acoustics.medium, stated=room is not None)
        else:
            source = what
            drive = _drive_for(source, array, settings)
            drive = _corrected(drive, source, room) if correct else drive
            admission = _admitted(drive, array, settings)
            _print_room_air(drive, source, room)
            level = level_rows(level_of_file(source, limits=False))
        rows = [("exposure", admission.verdict()), ("measured in", _found(admission).measured_in)]
        rows += [("heat", _found(admission).heat), ("checkup", checkup_line(array.name, device))]
        print_rows([*level, *unreproduced_rows(drive.provenance), *rows])
        watched = air_watched(air.temperature, drive.acoustics.medium, advice=PLAY_AGAIN, device=device)
        with rig, watched:
            # Known only after opening the device.
            banner(array.simulated)
            report = play_cleared(
                admission, array, source=source, delay=settings.delay, progress=stage("play"), room=room
            )
    if admission.stream is not None:
        print_rows([("exposure", admission.verdict()), ("heat", _found(admission).heat)])
    print_rows(_played_rows(report, drive, device))


def _drive_for(source: Path, array: ArrayDevice, settings: PlaySettings) -> Drive:
    """The drive of a file for an array that may need it in memory."""
    device, drive = settings.device, load_solution(source, streamed=True).drive
    if not array.streams:
        # Phases, and the driver's copy of them.
        check_memory_for(
            2 * drive.phase.nbytes, f"{source}, to be played on {device}", "cut it, or play it on AUTD3 units"
        )
        drive = load_solution(source).drive
    kept = kept_array_calibration(device)
    if kept is not None and drive.provenance.last("array calibration").get("id") != kept.known.identifier:
        advice = f"{device} has one of {kept.known.date or 'unknown date'}; use midair solve --device {device}"
        print_note(f"array calibration: this drive was solved without that of this array: {advice}", warn=True)
    return drive


def _played_rows(report: PlayReport, drive: Drive, device: str) -> list[tuple[str, str]]:
    start = "unknown" if report.start is None else f"{report.start} ns of device time"
    return [
        ("played", f"{report.frames} frames at {drive.rate:g} Hz on {device}, {report.duration:g} s"),
        ("first frame", start),
        ("timing", f"{report.late} late, {report.repeated} repeated, {1e3 * report.gap:g} ms of gaps"),
        *([("paused", f"{report.paused:.1f} s in silence, since units were too hot")] if report.paused else []),
        ("silencer", report.silencer),
        ("units", report.units or "not reported"),
    ]
