"""Presenters of a study session at a terminal."""

from collections.abc import Callable, Generator, Mapping
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape

from midair.devices import VirtualArray
from midair.errors import InputError, SilentFramesError, StoppedError
from midair.files import load_solution, printable
from midair.model import Drive, TransducerArray
from midair.rig import (
    Cleared,
    OpenRig,
    PlayObserver,
    PlaySettings,
    Session,
    array_named,
    frame_rig,
    open_tracker,
    tracker_name,
)
from midair.study.design.plan import Plan
from midair.study.drives import check_digests
from midair.study.event_markers import EventMarkers
from midair.study.folder import StudyFolder
from midair.study.session.presenters import Headphones, Presenter, StimulusPresenter


@dataclass(frozen=True, slots=True, kw_only=True)
class StimulusRig:
    """Open presenter of a session, with the fields that its log states about it."""

    presenter: Presenter
    simulated: bool = False
    """Whether the array is simulated."""
    markers: EventMarkers | None = None
    """Open outputs for the session; None without markers."""
    about: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """Fields for `Session`: the array, and the level of the noise in dB (None without noise)."""


@contextmanager
def open_stimulus_rig(
    array: str,
    folder: StudyFolder,
    plan: Plan,
    *,
    settings: PlaySettings | None = None,
    noise: str = "default",
    serial: str = "",
    show: Callable[[str], None] = lambda _: None,
    participant: int = 0,
) -> Generator[StimulusRig]:
    """Open the presenter: the experimenter, instructed on the error stream, or an array that plays the plan's drives.

    Before the session begins, the digests of all drives are checked, and each drive must pass the exposure check; every
    playback is logged. The effect of the room air, the noise level and the marker
    outputs are printed for the experimenter. `serial` replaces the serial port of the plan, see `open_markers`.
    `show` shows a text to the participant; `participant` (0 if unknown) is logged by its code. `settings` are those of
    playing: exposure, air, and a tracker of the palm. Raises InputError if the plan has pictures or sounds.
    """
    console = Console(stderr=True, emoji=False)
    if unable := next((one for one in plan.design.stimuli if one.kind in ("picture", "sound")), None):
        raise InputError(
            f"stimulus {unable.name!r}: expected drives, objects, texts or silence, got a {unable.kind}, which a"
            " terminal cannot present; run this study in the studio: midair studio"
        )
    drives = [stimulus for stimulus in plan.design.stimuli if stimulus.kind == "drive"]
    if array != "none":
        check_digests(folder.path, plan.drives, plan.design.stimuli)
    elif drives:
        raise InputError(f"array: expected an array for {len(drives)} drives of the plan, got none; give --array")

    def tell(line: str) -> None:
        console.print(f"experimenter: {plain_text(line)}")

    presenter = StimulusPresenter(
        tell=tell,
        done=lambda: console.input("[dim]Press Enter after the presentation[/] "),
        show=lambda stimulus: show("" if stimulus is None else stimulus.source),
        stop=lambda: tell("remove the object: nothing may touch the participant now"),
    )
    about: dict[str, Any] = {}
    with ExitStack() as stack:
        markers = stack.enter_context(open_markers(plan, serial=serial))
        if markers is not None:
            about["markers"] = markers.outputs.said
            console.print(plain_text(f"markers: {about['markers']}"))
        if array == "none":
            yield StimulusRig(presenter=presenter, markers=markers, about=about)
            return
        chosen = (settings or PlaySettings()).but(participant=study_code(folder, participant) if participant else "")
        lasting = [load_solution(folder.path / one.source, streamed=True).drive for one in drives]
        session = stack.enter_context(_open_session(array, lasting, chosen, _ConsoleNotes(console)))
        cleared = cleared_drives(folder.path, session)
        for one in drives:
            if (found := cleared(one.source, one.share).clearance).outcome == "attenuated":
                session.observer.note(f"{one.source}: exposure {found.verdict()}", warns=True)
        for source in dict.fromkeys(one.source for one in drives):
            path = folder.path / source
            replace(session, observer=_ConsoleNotes(console, source)).in_air(load_solution(path).drive, chosen, path)
        headphones = None
        if plan.design.noise is not None and noise != "none":
            headphones = stack.enter_context(Headphones(plan.design.noise, device=noise))
            console.print(plain_text(f"headphones: {plan.design.noise.said}"))
        device = session.rig.array
        about |= {"array": device.name, "noise_dbfs": headphones and headphones.noise.level_dbfs}
        longest = max((drive.frames / drive.rate for drive in lasting), default=0.0)
        presenter = replace(on_array(presenter, session, cleared), silence_s=longest, noise=headphones)
        yield StimulusRig(presenter=presenter, simulated=device.simulated, markers=markers, about=about)


def on_array(
    presenter: StimulusPresenter, session: Session, cleared: Callable[[str, float], Cleared]
) -> StimulusPresenter:
    """A presenter whose drives this session plays and logs, cleared by `cleared`; it ends them at a request.

    Raises SilentFramesError if late frames caused silence.
    """

    def go_on(done: int, total: int) -> None:
        if presenter.ended.is_set():
            raise StoppedError(f"array: stopped after {done} of {total} frames")

    def play(source: str, share: float) -> None:
        named = source if share == 1 else f"{source} at {share:g} of its pressure"
        report = session.play(cleared(source, share), source=named, progress=go_on).report
        if report is not None and report.gap:
            raise SilentFramesError(
                f"array: expected every frame in time, got {report.late} late frames and {report.gap:.3f} s of "
                "silence; close other programs"
            )

    def stop() -> None:
        session.rig.array.silence()
        presenter.stop()

    return replace(presenter, play=play, wait=presenter.ended.wait, stop=stop)


@contextmanager
def open_markers(plan: Plan, *, serial: str = "") -> Generator[EventMarkers | None]:
    """Open the marker outputs of a plan; None if it has none.

    `serial` replaces the port of the plan; "none" for no serial markers. Raises DeviceError if the port cannot be
    opened.
    """
    outputs = plan.design.markers
    if outputs is not None and serial == "none":
        outputs = replace(outputs, serial="") if outputs.lsl else None
    elif outputs is not None and serial:
        outputs = replace(outputs, serial=serial)
    with nullcontext() if outputs is None else EventMarkers(outputs) as markers:
        yield markers


def study_code(folder: StudyFolder, participant: int) -> str:
    """Participant of a study in the log of playback, such as touch/3: numbers alone repeat in other studies."""
    return f"{folder.path.resolve().name}/{participant}"


class _ConsoleNotes(PlayObserver):
    """Prints the notes of a session for the experimenter, after the name of a drive if one is given."""

    def __init__(self, console: Console, about: str = "") -> None:
        self._console, self._about = console, f"{about}: " if about else ""

    def note(self, text: str, *, warns: bool = False) -> None:
        """Print the line."""
        self._console.print(plain_text(self._about + text), style="yellow" if warns else None)


@contextmanager
def _open_session(array: str, drives: list[Drive], settings: PlaySettings, notes: PlayObserver) -> Generator[Session]:
    """A session on an open array, with the open tracker of the palm that drives follow."""
    rates = {drive.rate for drive in drives}
    if settings.follow is None:
        device = VirtualArray(TransducerArray.autd3()) if array == "virtual" else array_named(array)
        rig = OpenRig(array=device, sensor=None, settings=settings)
    elif array == "virtual":
        raise InputError("--follow: expected --array autd3 or autd3:INTERFACE, got virtual, above which no palm moves")
    elif len(rates) > 1:
        raise InputError(f"--follow: expected drives of one frame rate, got {', '.join(f'{r:g}' for r in rates)} Hz")
    else:
        rig = frame_rig(settings.but(device=array), max(rates, default=1000.0))
    name = tracker_name(settings.follow, settings.tracker_latency)
    with rig, open_tracker(name) if name else nullcontext() as tracker:
        yield Session(rig=rig, observer=notes, tracker=tracker)


def cleared_drives(folder: Path, session: Session) -> Callable[[str, float], Cleared]:
    """Function that returns the drive of a file in a folder at a share of its pressure, cleared by a session.

    It raises InputError, which names the file, if a drive belongs to another array or exceeds the exposure profile.
    """

    @lru_cache(maxsize=32)
    def cleared(source: str, share: float) -> Cleared:
        drive = load_solution(folder / source).drive
        # Radiation pressure is proportional to the square of the sound pressure, hence to that of the level.
        try:
            return session.clear(drive if share == 1 else replace(drive, level=drive.level * share**0.5))
        except InputError as wrong:
            raise type(wrong)(f"{source}: {wrong}") from wrong

    return cleared


def plain_text(text: str) -> str:
    """Text of a plan or an answer, without markup and escape sequences."""
    return escape(printable(text))
