"""One session of playing: open the array, state the air, check, follow, play, re-record and report.

The command line and Python play by it, and differ in what they show of its events.
"""

from contextlib import nullcontext
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from midair.array_types import Array
from midair.devices import ArrayDevice, ExposureClearance, ImmediateArray, PlayReport, check_exposure
from midair.errors import InputError
from midair.files import OpenedTake, check_memory_for, load_solution, load_target
from midair.model import AmplitudeFrames, Drive, PressureFrames, Progress, Solution, TransducerArray
from midair.physics import Exposure
from midair.rig.names import open_tracker
from midair.rig.opening import OpenRig, open_rig
from midair.rig.playing import (
    FollowedPlay,
    PlaySettings,
    SolvedAhead,
    check_air,
    clear_followed,
    correct_air_of_file,
    follow_as_set,
    grid_of,
    immediate_array,
    play_cleared,
    play_followed,
    rerecord,
    tracker_name,
)
from midair.rig.signals import signals_end_the_program
from midair.settings import Settings
from midair.validation import check_type


class PlayObserver:
    """Receives the events of a session in their order; does nothing by itself."""

    def note(self, text: str, *, warns: bool = False) -> None:
        """State one line: on the air, the array's calibration, or a palm that is followed."""

    def cleared(self, array: ArrayDevice | ImmediateArray, drive: Drive, clearance: ExposureClearance) -> None:
        """Show the verdict of the exposure check, before anything sounds."""

    def opened(self, array: ArrayDevice | ImmediateArray) -> None:
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
    if not isinstance(what, Solution | str | Path):
        check_type(what, "drive", Drive)
    changes = {name: value for name, value in changes.items() if value is not None}
    session = _Session(
        what=what.drive if isinstance(what, Solution) else what if isinstance(what, Drive) else Path(what),
        source=source or ("python" if isinstance(what, Solution | Drive) else what),
        correct_air=correct_air,
        observer=observer or PlayObserver(),
        progress=progress,
    )
    if isinstance(rig, OpenRig):
        given = [one.name for one in fields(PlaySettings) if one.name in changes and "playback" not in one.metadata]
        if given:
            raise InputError(f"play on an open rig: expected settings of a playback, got {given[0]}; see open_rig")
        return session.on_rig(rig, (settings or rig.settings).but(**changes), entered=True)
    wanted = (settings or PlaySettings()).but(**changes | ({} if rig is None else {"device": rig}))
    if wanted.device != "virtual" and wanted.follow is not None:
        return session.following(wanted)
    drive = session.drive() if wanted.device == "virtual" else None
    return session.on_rig(open_rig(drive=drive, settings=wanted), wanted, entered=False)


@dataclass(slots=True, kw_only=True, eq=False)
class _Session:
    what: Drive | Path
    source: str | Path
    correct_air: bool
    observer: PlayObserver
    progress: Progress | None

    _read: Drive | None = None

    def drive(self) -> Drive:
        """The drive; that of a file in lazy frames."""
        if self._read is None:
            self._read = self.what if isinstance(self.what, Drive) else load_solution(self.what, streamed=True).drive
        return self._read

    def on_rig(self, rig: OpenRig, chosen: PlaySettings, *, entered: bool) -> Played:
        """Play on a rig, whose devices are opened after the check unless they are `entered`."""
        array, followed = rig.array, list[str]()
        emulated = array.simulated and not array.gated
        if chosen.follow is not None and not emulated:
            raise InputError(
                "follow: expected the virtual rig or the name of an array, got an open rig with a real array"
            )
        # Reserved before a long drive is read and checked: `midair stop` works, and no other program gets the units.
        with array.reserved():
            drive = self._readable(array)
            self._note_calibration(rig, drive)
            drive = self._noted_air(drive, chosen, simulated=emulated)

            def follow(line: str) -> None:
                followed.append(line)
                self.observer.note(line)

            if emulated:
                drive, chosen = follow_as_set(drive, chosen, follow)
            array.cooling, array.participant = chosen.cooling, chosen.participant
            clearance = check_exposure(drive, array, chosen.exposure, repeats=chosen.repeats)
            self.observer.cleared(array, drive, clearance)
            with nullcontext() if entered else rig:
                self.observer.opened(array)
                how = {"source": self.source, "progress": self.progress}
                return replace(_play(clearance, rig, chosen, **how), followed=tuple(followed))

    def following(self, chosen: PlaySettings) -> Played:
        """Play on a real array or an emulator, frame by frame, each steered to a palm."""
        drive = self.what if isinstance(self.what, Drive) else load_solution(self.what).drive
        array, grid, followed = immediate_array(chosen, drive.rate), grid_of(drive), list[str]()
        array.cooling, array.participant = chosen.cooling, chosen.participant

        def report(line: str) -> None:
            followed.append(line)
            self.observer.note(line)

        with array, open_tracker(tracker_name(chosen.follow, chosen.tracker_latency)) as tracker:
            drive = self._noted_air(drive, chosen)
            clearance = clear_followed(drive, array, chosen, grid)
            self.observer.cleared(array, drive, clearance)
            self.observer.opened(array)
            done: FollowedPlay = play_followed(
                drive,
                array,
                tracker,
                chosen,
                clearance,
                grid,
                source=self.source,
                report=report,
                progress=self.progress,
            )
        return Played(
            drive=drive,
            outcome=clearance.outcome,
            exposure=clearance.exposure,
            report=done.report,
            followed=tuple(followed),
            reaction=done.reaction,
        )

    def _readable(self, array: ArrayDevice) -> Drive:
        """The drive, in memory for an array that takes all frames at once."""
        drive = self.drive()
        if array.streams or isinstance(self.what, Drive):
            return drive
        # Phases, and the driver's copy of them.
        advice = "cut it, or play it on AUTD3 units"
        check_memory_for(2 * drive.phase.nbytes, f"{self.what}, to be played on {array.name}", advice)
        return load_solution(self.what).drive

    def _note_calibration(self, rig: OpenRig, drive: Drive) -> None:
        """State the stored calibration of a real array, and whether the drive was solved for it."""
        kept = rig.measured
        if kept is None:
            return
        if drive.provenance.last("solve").get("array_calibration") != kept.known.identifier:
            device = rig.settings.device
            self.observer.note(
                "array calibration: this drive was solved without that of this array: "
                f"{device} has one of {kept.known.date or 'unknown date'}; use midair solve --device {device}",
                warns=True,
            )
        else:
            self.observer.note(f"array calibration: {kept.described(Settings.of(drive.provenance) or Settings())}")

    def _noted_air(self, drive: Drive, chosen: PlaySettings, *, simulated: bool = False) -> Drive:
        """The drive, corrected for the air of the room if asked; the air is stated."""
        room, file = chosen.exposure.room, self.what if isinstance(self.what, Path) else None
        if self.correct_air:
            if room is None or file is None:
                raise InputError("correct_air: expected the file of a drive and the air of the room, got none")
            own, drive = drive.acoustics.medium, correct_air_of_file(drive, file, room)
            self.observer.note(f"air: phases corrected from {own} to {room}")

        def target() -> AmplitudeFrames | None:
            return None if file is None else load_target(file, streamed=True)

        found = check_air(drive, room, target, simulated=simulated)
        self.observer.note(found.said, warns=found.warns)
        return drive


def _play(clearance: ExposureClearance, rig: OpenRig, chosen: PlaySettings, **how: Any) -> Played:
    """Play a cleared drive on an open rig, and re-record it if that has a sensor."""
    known: Any = {"drive": clearance.check_for(rig.array), "outcome": clearance.outcome, "exposure": clearance.exposure}
    how |= {"delay": chosen.delay, "room": chosen.exposure.room}
    if rig.sensor is None:
        return Played(**known, report=play_cleared(clearance, rig.array, **how))
    if chosen.delay and rig.sensor.simulated:
        raise InputError(f"delay: expected 0 on the virtual array, which plays at once, got {chosen.delay:g} s")
    heard = rerecord(clearance, rig.array, rig.sensor, **how)
    return Played(**known, take=OpenedTake(recording=heard, calibration=rig.sensor.calibration))


def play_pressure(
    pressure: PressureFrames,
    settings: Settings,
    rig: OpenRig,
    *,
    path: str | Path | None = None,
    source: str | Path = "python",
    observer: PlayObserver | None = None,
    progress: Progress | None = None,
) -> Played:
    """Solve a pressure and play it at the same time: the first sound comes as soon as no gap will follow.

    Every part is checked before it sounds; an error, also an exposure above the profile in a later part, silences the
    array. The drive is that of `midair.pipeline.reproduce_stream`, to the last bit.

    `pressure` is a calibrated recording with its lead (`add_lead`); `rig`, from `open_rig`, is not entered; `path` is a
    drive to write, complete or not at all; `observer` gets one line if this computer is too slow to begin at once.
    `source`, `progress` and the errors are those of `play`; InputError as in `SolvedAhead`.
    """
    shown = observer or PlayObserver()
    # Without a placement the numbers are those of `midair solve`, to the last digit.
    transducers = one if (one := TransducerArray.autd3()).same_as(rig.array.array) else rig.array.array
    if rig.measured is not None:
        shown.note(f"array calibration: {rig.measured.described(settings)}")
        transducers, settings, pressure = rig.measured.applied(transducers, settings, pressure)
    solving = SolvedAhead(pressure, transducers, rig.array, settings, rig.settings, path)
    with signals_end_the_program(), solving, rig:
        shown.opened(rig.array)
        played = _play(solving.in_time(shown.note), rig, rig.settings, source=source, progress=progress)
        whole = solving.finish()
        return replace(played, outcome=whole.outcome, exposure=whole.exposure, error=np.concatenate(solving.error))
