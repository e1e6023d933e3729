"""One session of playing: open the array, state the air, check, follow, play, re-record and report.

Command line, Python, loop, calibration, studies, servers and the studio play by it, and differ in what they show of its
events.
"""

import time
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import nullcontext
from dataclasses import dataclass, field, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from midair.array_types import Array
from midair.correct import correct_air
from midair.devices import (
    ArrayDevice,
    ExposureChoices,
    ExposureClearance,
    LeaseToken,
    PlayLease,
    PlayReport,
    SensorDevice,
    SteeredClearance,
    Tracker,
    check_exposure,
    check_exposure_level,
    read_frames,
    signals_end_the_program,
    under_lease,
)
from midair.errors import DeviceStateError, InputError, MismatchError
from midair.evaluate import error_at_temperature
from midair.files import OpenedTake, check_memory_for, load_solution, load_target
from midair.model import Drive, Medium, PressureFrames, Progress, Recording, Solution, TransducerArray
from midair.physics import Exposure
from midair.rig.names.sensor_names import open_tracker
from midair.rig.opening import OpenRig, frame_rig, open_rig
from midair.rig.playing.following import (
    FollowRules,
    clear_followed,
    follow_simulated,
    grid_of,
    play_followed,
    tracker_name,
)
from midair.rig.playing.play_settings import PlaySettings, default_exposure
from midair.rig.playing.solving_ahead import SolvedAhead
from midair.settings import Settings
from midair.validation import checked_call


class PlayObserver:
    """Receives the events of a session in their order; does nothing by itself."""

    def note(self, text: str, *, warns: bool = False) -> None:
        """State one line: on the air, the array's calibration, or a palm that is followed."""

    def cleared(self, array: ArrayDevice, drive: Drive, clearance: ExposureClearance) -> None:
        """Show the verdict of the exposure check, before anything sounds."""

    def opened(self, array: ArrayDevice) -> None:
        """Show that an array is open, of which only now is known whether it is simulated."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Played:
    """Result of `play`."""

    drive: Drive
    """The drive that was played; attenuated if the exposure limits required it."""
    outcome: str
    """Result of the exposure check: "kept", "attenuated", "overridden", or "exceeded" (only on arrays that emit no
    sound)."""
    exposure: Exposure
    """Exposure of the drive as it was checked."""
    take: OpenedTake | None = None
    """Re-recording with the sensor's calibration; None without a sensor."""
    report: PlayReport | None = None
    """Report of the array; None with a sensor."""
    error: Array | None = None
    """E of each frame that was solved while it played, shape (frame,); None for a drive."""
    followed: tuple[str, ...] = ()
    """When the palm was followed, and when the sound faded, one line each."""
    reaction: tuple[float, float] | None = None
    """Time in s from a pose to its frame, median and 99 % of all; None for a play that follows no palm in real time."""

    def __repr__(self) -> str:
        heard = "nothing listened" if self.take is None else f"heard: {self.take.recording!r}"
        return f"<Played {self.drive.frames} frames at {self.drive.rate:g} Hz, exposure {self.outcome}, {heard}>"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cleared:
    """A drive that passed the exposure check of a session, and how to play it."""

    drive: Drive
    """The drive that was checked, before any attenuation."""
    clearance: ExposureClearance
    settings: PlaySettings
    """Settings of the playback; replace those that the check does not depend on, such as the participant."""
    followed: tuple[str, ...] = ()
    """When a simulated palm was followed, one line each."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Session:
    """Checks drives for the array of a rig, and plays those that are cleared; the rig must be entered to play."""

    rig: OpenRig
    observer: PlayObserver = field(default_factory=PlayObserver)
    tracker: Tracker | None = None
    """Open tracker of the palm that is followed; opened for each play if None."""

    @classmethod
    def on(cls, array: ArrayDevice, sensor: SensorDevice | None, exposure: ExposureChoices | None) -> "Session":
        """Session on open devices; default exposure limits if None."""
        settings = PlaySettings(exposure=exposure or default_exposure())
        return cls(rig=OpenRig(array=array, sensor=sensor, settings=settings))

    def read(self, file: Path) -> Drive:
        """The drive of a file: in lazy frames, or in memory for an array that takes all frames at once."""
        drive, array = load_solution(file, streamed=True).drive, self.rig.array
        if array.streams:
            return drive
        # Phases, and the driver's copy of them.
        advice = "cut it, or play it on AUTD3 units"
        check_memory_for(2 * drive.phase.nbytes, f"{file}, to be played on {array.name}", advice)
        return load_solution(file).drive

    def note_calibration(self, drive: Drive) -> None:
        """State the stored calibration of a real array, and whether the drive was solved for it."""
        kept = self.rig.measured
        if kept is None:
            return
        if drive.provenance.last("solve").get("array_calibration") != kept.known.identifier:
            device = self.rig.settings.device
            self.observer.note(
                "array calibration: this drive was solved without that of this array: "
                f"{device} has one of {kept.known.date or 'unknown date'}; use midair solve --device {device}",
                warns=True,
            )
        else:
            self.observer.note(f"array calibration: {kept.described(Settings.of(drive.provenance) or Settings())}")

    def in_air(self, drive: Drive, chosen: PlaySettings, file: Path | None, *, correct: bool = False) -> Drive:
        """State the air of the room, and return the drive, corrected for it if asked; `file` has its target.

        Above a difference of `FAR` the line states E in this air. A virtual array plays in the drive's own air.
        """
        room, array = chosen.exposure.room, self.rig.array
        if correct:
            if room is None or file is None:
                raise InputError("correct_air: expected the file of a drive and the air of the room, got none")
            solved, drive = drive.acoustics.medium, correct_air_of_file(drive, file, room)
            self.observer.note(f"air: phases corrected from {solved} to {room}")
        own = drive.acoustics.medium
        if room is None and array.simulated and not array.gated:
            self.observer.note(f"air: {own}, the drive's own")
        elif room is None:
            unknown = f"room temperature unknown: the drive was solved for {own}; give it with --temperature"
            self.observer.note(unknown, warns=True)
        else:
            far = abs(room.degrees - own.degrees) > FAR
            said = f"air: the room has {room}, the drive was solved for {own}"
            said += f": {_error_in_air(drive, room, file)}; solve it again for this air" if far else ""
            self.observer.note(said, warns=far)
        return drive

    def clear(self, drive: Drive, settings: PlaySettings | None = None, *, endless: bool = False) -> Cleared:
        """Check the exposure of a drive, for any pose if a palm is followed; `endless` is that of `check_exposure`.

        The virtual array plays the drive as it would sound along the poses. Raises ExposureError if the drive exceeds
        the profile without an override, MismatchError if it was solved for another array, InputError if this rig cannot
        follow a palm.
        """
        chosen, array = settings or self.rig.settings, self.rig.array
        followed = list[str]()
        if chosen.follow is None or (array.simulated and not array.gated and not self.rig.by_frames):
            if chosen.follow is not None:
                name = tracker_name(chosen.follow, chosen.tracker_latency)
                how: Any = {"rules": FollowRules(confidence=chosen.confidence, fit=not chosen.steer_only)}
                how |= {"repeats": chosen.repeats, "report": self._noted(followed)}
                drive, chosen = follow_simulated(drive, name, grid_of(drive), **how), chosen.but(repeats=1)
            clearance = check_exposure(drive, array, chosen.exposure, repeats=chosen.repeats, endless=endless)
        elif self.rig.by_frames:
            clearance = clear_followed(drive, array, chosen, grid_of(drive), endless=endless)
        else:
            raise InputError(
                "follow: expected the virtual rig or the name of an array, got an open rig with a real array"
            )
        self.observer.cleared(array, drive, clearance)
        return Cleared(drive=drive, clearance=clearance, settings=chosen, followed=tuple(followed))

    def _noted(self, lines: list[str]) -> Callable[[str], object]:
        """A function that keeps each line, and shows it."""

        def note(line: str) -> None:
            lines.append(line)
            self.observer.note(line)

        return note

    def clear_level(self, level: float, rate: float) -> ExposureClearance:
        """Check the worst case of a level, for frames at a rate in Hz that are computed while they play."""
        return check_exposure_level(level, self.rig.array, self.rig.settings.exposure, rate=rate)

    def play(
        self,
        cleared: Cleared,
        *,
        source: str | Path,
        progress: Progress | None = None,
        lease: tuple[PlayLease, LeaseToken] | None = None,
        tail: float = 0.02,
    ) -> Played:
        """Play a cleared drive, under a lease if there is one, and re-record it if the rig has a sensor.

        `tail` is the recording time in s after the last frame. Raises StoppedError as soon as the lease ends, and the
        errors of `ArrayDevice.play`.
        """
        array, sensor, chosen, clearance = self.rig.array, self.rig.sensor, cleared.settings, cleared.clearance
        array.cooling, array.participant = chosen.cooling, chosen.participant
        told: Any = {"outcome": clearance.outcome, "exposure": clearance.exposure}
        how: Any = {"source": source, "progress": progress}
        with nullcontext() if lease is None else under_lease(array, *lease):
            if isinstance(clearance, SteeredClearance):
                return self._follow(cleared, clearance, how, told)
            told |= {"drive": clearance.check_for(array), "followed": cleared.followed}
            if sensor is None:
                return Played(**told, report=self._sound(cleared, **how))
            heard = self._sound_and_record(cleared, sensor, tail, **how)
            return Played(**told, take=OpenedTake(recording=heard, calibration=sensor.calibration))

    def _sound(self, cleared: Cleared, **how: Any) -> PlayReport:
        """Play with a log entry; SIGTERM and SIGHUP end the program as Ctrl-C does, which silences the array."""
        chosen = cleared.settings
        how |= {"delay": chosen.delay, "room": chosen.exposure.room, "watched": True}
        with signals_end_the_program():
            return self.rig.array.play(cleared.clearance, **how)

    def _sound_and_record(
        self, cleared: Cleared, sensor: SensorDevice, tail: float, *, progress: Progress | None, **how: Any
    ) -> Recording:
        """Play while the sensor records, from before the first frame to `tail` s after the last.

        A simulated sensor records the first frame at time 0. A real array starts with a delay: `evaluate.find_delay`
        finds where the drive begins. The sensor must buffer its samples until they are read.
        """
        array, clearance, delay = self.rig.array, cleared.clearance, cleared.settings.delay
        if array.simulated != sensor.simulated:
            raise MismatchError(
                f"expected array and sensor both real or both virtual, got {array.name} and {sensor.name}"
            )
        if delay and sensor.simulated:
            raise InputError(f"delay: expected 0 on the virtual array, which plays at once, got {delay:g} s")
        drive = clearance.check_for(array)
        sensor.start()
        try:
            began = time.monotonic()
            # A virtual array emits no sound, and loops on the virtual rig would fill the play log.
            if array.gated:
                report = self._sound(cleared, progress=progress, **how)
            else:
                report = array.play(clearance, progress=progress)
            lasted = clearance.repeats * drive.frames / drive.rate if sensor.simulated else time.monotonic() - began
            samples = read_frames(sensor, round((lasted + tail) * sensor.rate))
        finally:
            sensor.stop()
        found = clearance.exposure
        ears = round(found.sound_excess + found.profile.protection, 2) if np.isfinite(found.sound_excess) else None
        played = {"array": array.name, "frames": drive.frames, "rate_hz": drive.rate, "silencer": report.silencer}
        played |= {"ears_excess_db": ears}
        life = replace(drive.provenance, source=f"{array.name} heard by {sensor.name}")
        provenance = life.then("play", played, simulated=sensor.simulated)
        return Recording(samples=samples, rate=sensor.rate, sensor=sensor.grid, unit=sensor.unit, provenance=provenance)

    def _follow(self, cleared: Cleared, clearance: SteeredClearance, how: Any, told: Any) -> Played:
        """Play frame by frame, each steered to the palm."""
        followed, chosen, drive = list[str](), cleared.settings, cleared.drive
        report, name = self._noted(followed), tracker_name(chosen.follow, chosen.tracker_latency)
        with nullcontext(self.tracker) if self.tracker is not None else open_tracker(name) as tracker:
            array, grid = self.rig.frames, grid_of(drive)
            done, reaction = play_followed(drive, array, tracker, chosen, clearance, grid, report=report, **how)
        return Played(**told, drive=drive, report=done, followed=tuple(followed), reaction=reaction)

    def rerecord(
        self, drive: Drive, *, source: str | Path = "loop", progress: Progress | None = None, tail: float = 0.02
    ) -> Recording:
        """Check a drive, play it once and return its re-recording by the sensor of the rig."""
        self.rig.listening()
        cleared = self.clear(drive, self.rig.settings.but(repeats=1, delay=0.0))
        played = self.play(cleared, source=source, progress=progress, tail=tail)
        if played.take is None:
            raise DeviceStateError(f"{self.rig.array.name}: expected a re-recording, got none")
        return played.take.recording

    def play_ahead(
        self,
        solving: SolvedAhead,
        *,
        source: str | Path,
        settings: PlaySettings | None = None,
        progress: Progress | None = None,
        lease: tuple[PlayLease, LeaseToken] | None = None,
    ) -> Played:
        """Play a pressure while it is solved, as soon as no gap will follow; `solving` is entered."""
        array = self.rig.array
        check = bool if lease is None else partial(lease[0].check, lease[1], array.name)
        ready = solving.in_time(self.observer.note, check)
        cleared = Cleared(drive=ready.check_for(array), clearance=ready, settings=settings or self.rig.settings)
        played = self.play(cleared, source=source, progress=progress, lease=lease)
        whole = solving.finish()
        return replace(played, outcome=whole.outcome, exposure=whole.exposure, error=np.concatenate(solving.error))


FAR = 2.0
"""Difference of temperature in K between room and drive above which E is computed."""


def correct_air_of_file(drive: Drive, source: Path, room: Medium) -> Drive:
    """Correct the phases of the drive of a file around the centre of its control points; InputError without target."""
    target = load_target(source, streamed=True)
    if target is None:
        raise InputError(f"{source}: expected a drive with its target for --correct-air, got none; solve it again")
    return correct_air(drive, room, target.grid.position.mean(axis=0))


def _error_in_air(drive: Drive, room: Medium, file: Path | None) -> str:
    """E of 64 evenly spaced frames in the air of the room and in that of the drive, as text."""
    target = None if file is None else load_target(file, streamed=True)
    if target is None:
        return "the error cannot be computed, since the file has no target"
    here, own = (error_at_temperature(drive, target, each, frames=64) for each in (room, drive.acoustics.medium))
    if not len(here):
        return "the drive is silent"
    return f"E {100 * here.mean():.1f} % instead of {100 * own.mean():.1f} %, the mean of {len(here)} frames"


@checked_call
def play(
    what: Solution | Drive | str | Path,
    rig: OpenRig | str | None = None,
    *,
    source: str | Path | None = None,
    correct_air: bool = False,
    observer: PlayObserver | None = None,
    progress: Progress | None = None,
    settings: PlaySettings | None = None,
    **changes: Any,
) -> Played:
    """Play a drive after an exposure check, and re-record it if the rig has a sensor.

    Parameters
    ----------
    what : Solution, Drive or path
        Solved for the rig's array; a file is read frame by frame while it plays.
    rig : OpenRig or str, optional
        An entered rig, or the name of an array that is opened for this call, by default the device of `settings`; a
        virtual one gets the cells, the height and the band of the drive.
    source : str or Path, optional
        Name of the drive in the play log, where a file is hashed; that of the file, or "python".
    correct_air : bool
        Correct the phases for the air of the room; needs a file with a target, and a room in ``exposure``.
    observer : PlayObserver, optional
        Receives what happens on the way.
    progress : callable, optional
        Called with (frames played, total frames).
    settings : PlaySettings, optional
        All settings; those of the rig if None.
    **changes
        Fields of `PlaySettings` that differ from them: ``repeats``, ``delay``, ``participant``, ``exposure`` and
        ``cooling``, and for a rig that is opened here also the others.

    Raises
    ------
    ExposureError
        If the drive exceeds the profile without an override.
    MismatchError
        If the drive was solved for another array.
    InputError
        If a value is out of range, or concerns the devices of an entered rig.
    DeviceStateError
        If the rig was not entered.
    """
    changes = {name: value for name, value in changes.items() if value is not None}
    given = what.drive if isinstance(what, Solution) else what if isinstance(what, Drive) else Path(what)
    file = given if isinstance(given, Path) else None
    entered = isinstance(rig, OpenRig)
    if entered:
        named = [one.name for one in fields(PlaySettings) if one.name in changes and "playback" not in one.metadata]
        if named:
            raise InputError(f"play on an open rig: expected settings of a playback, got {named[0]}; see open_rig")
        opened, chosen = rig, (settings or rig.settings).but(**changes)
    else:
        chosen = (settings or PlaySettings()).but(**changes | ({} if rig is None else {"device": rig}))
        drive = given if isinstance(given, Drive) else load_solution(given, streamed=True).drive
        virtual = chosen.device == "virtual"
        if chosen.follow is not None and not virtual:
            opened = frame_rig(chosen, drive.rate)
        else:
            opened = open_rig(drive=drive if virtual else None, settings=chosen)
    session = Session(rig=opened, observer=observer or PlayObserver())
    # Reserved before a long drive is read and checked: `midair stop` works, and no other program gets the units.
    with opened.array.reserved():
        drive = given if isinstance(given, Drive) else session.read(given)
        session.note_calibration(drive)
        cleared = session.clear(session.in_air(drive, chosen, file, correct=correct_air), chosen)
        with nullcontext() if entered else opened:
            session.observer.opened(opened.array)
            name = source or ("python" if file is None else file)
            return session.play(cleared, source=name, progress=progress)


def play_pressure(
    pressure: PressureFrames,
    settings: Settings,
    rig: OpenRig,
    *,
    path: str | Path | None = None,
    source: str | Path = "python",
    observer: PlayObserver | None = None,
    progress: Progress | None = None,
    ready: Future[None] | None = None,
) -> Played:
    """Solve a pressure and play it at the same time: the first sound comes as soon as no gap will follow.

    Every part is checked before it sounds; an error, also an exposure above the profile in a later part, silences the
    array. The drive is that of `midair.pipeline.reproduce_stream`, to the last bit.

    `pressure` is a calibrated recording with its lead (`add_lead`); `rig`, from `open_rig`, is not entered; `path` is a
    drive to write, complete or not at all; `observer` gets one line if this computer is too slow to begin at once.
    `source`, `progress` and the errors are those of `play`; InputError and `ready` as in `SolvedAhead`.
    """
    session = Session(rig=rig, observer=observer or PlayObserver())
    # Without a placement the numbers are those of `midair solve`, to the last digit.
    transducers = one if (one := TransducerArray.autd3()).same_as(rig.array.array) else rig.array.array
    if rig.measured is not None:
        session.observer.note(f"array calibration: {rig.measured.described(settings)}")
        transducers, settings, pressure = rig.measured.applied(transducers, settings, pressure)
    solving = SolvedAhead(pressure, transducers, rig.array, settings, rig.settings, path, ready)
    with signals_end_the_program(), solving, rig:
        session.observer.opened(rig.array)
        return session.play_ahead(solving, source=source, progress=progress)
