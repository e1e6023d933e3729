"""Presenters of a study session: the experimenter, an array, and masking noise in the headphones."""

from collections.abc import Callable, Generator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from typing import Any

from rich.console import Console

from midair.devices import ExposureChoices, ExposureClearance, ImmediateArray, PlayReport, VirtualArray, check_exposure
from midair.errors import InputError
from midair.files import load_solution, load_target
from midair.model import Drive, Medium, Progress, TransducerArray
from midair.rig import (
    PlaySettings,
    array_named,
    check_air,
    clear_followed,
    default_exposure,
    grid_of,
    immediate_array,
    open_tracker,
    play_followed,
    tracker_name,
)
from midair.study.design import Plan, Stimulus
from midair.study.drives import check_digests
from midair.study.event_markers import EventMarkers
from midair.study.folder import StudyFolder
from midair.study.headphones import Headphones
from midair.study.session import (
    ArrayPresenter,
    ExperimenterPresenter,
    MarkedPresenter,
    MaskedPresenter,
    Presenter,
    TextPresenter,
)
from midair.study.terminal_screen import plain_text


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
    exposure: ExposureChoices | None = None,
    room: Medium | None = None,
    before: Callable[[Drive], None] | None = None,
    noise: str = "default",
    serial: str = "",
    show: Callable[[str], None] = lambda _: None,
    participant: int = 0,
    follow: PlaySettings | None = None,
) -> Generator[StimulusRig]:
    """Open the presenter: the experimenter, instructed on the error stream, or an array that plays the plan's drives.

    Before the session begins, the digests of all drives are checked, `before` is called with each drive, and each drive
    must pass the exposure check; every playback is logged. The effect of the room air, the noise level and the marker
    outputs are printed for the experimenter. `serial` replaces the serial port of the plan, see `open_markers`.
    `show` shows a text to the participant; `participant` (0 if unknown) is logged by its code. With `follow`, drives
    follow the palm of its tracker. Raises InputError if the plan has pictures or sounds.
    """
    console = Console(stderr=True, emoji=False)
    if unable := next((one for one in plan.design.stimuli if one.kind in ("picture", "sound")), None):
        raise InputError(
            f"stimulus {unable.name!r}: expected drives, objects, texts or silence, got a {unable.kind}, which a"
            " terminal cannot present; run this study in the studio: midair studio"
        )
    experimenter = ExperimenterPresenter(
        tell=lambda line: console.print(f"experimenter: {plain_text(line)}"),
        done=lambda: console.input("[dim]Press Enter after the presentation[/] "),
    )
    by_hand = TextPresenter(inner=experimenter, show=show)
    drives = [stimulus for stimulus in plan.design.stimuli if stimulus.kind == "drive"]
    if array == "none":
        if drives:
            raise InputError(f"array: expected an array for {len(drives)} drives of the plan, got none; give --array")
        with open_markers(plan, serial=serial) as markers:
            yield _marked(by_hand, markers, console)
        return
    check_digests(folder.path, plan.drives, plan.design.stimuli)
    with ExitStack() as stack:
        markers = stack.enter_context(open_markers(plan, serial=serial))
        presenter = stack.enter_context(
            _array_presenter(array, folder, plan, by_hand, exposure, room, before, console, follow)
        )
        presenter.array.participant = study_code(folder, participant) if participant else ""
        rig = _marked(presenter, markers, console)
        about: dict[str, Any] = {"array": presenter.array.name, "noise_dbfs": None, **rig.about}
        rig = replace(rig, simulated=presenter.array.simulated, about=about)
        if plan.design.noise is None or noise == "none":
            yield rig
            return
        headphones = stack.enter_context(Headphones(plan.design.noise, device=noise))
        console.print(plain_text(f"headphones: {plan.design.noise.said}"))
        masked = MaskedPresenter(inner=rig.presenter, noise=headphones)
        about["noise_dbfs"] = plan.design.noise.level_dbfs
        yield replace(rig, presenter=masked)


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
    if outputs is None:
        yield None
        return
    with EventMarkers(outputs) as markers:
        yield markers


def _marked(presenter: Presenter, markers: EventMarkers | None, console: Console) -> StimulusRig:
    """Rig of a presenter whose stimuli are marked."""
    if markers is None:
        return StimulusRig(presenter=presenter)
    console.print(plain_text(f"markers: {markers.outputs.said}"))
    about = {"markers": markers.outputs.said}
    return StimulusRig(presenter=MarkedPresenter(inner=presenter, markers=markers), markers=markers, about=about)


def study_code(folder: StudyFolder, participant: int) -> str:
    """Participant of a study in the log of playback, such as touch/3: numbers alone repeat in other studies."""
    return f"{folder.path.resolve().name}/{participant}"


@contextmanager
def _array_presenter(
    array: str,
    folder: StudyFolder,
    plan: Plan,
    by_hand: Presenter,
    exposure: ExposureChoices | None,
    room: Medium | None,
    before: Callable[[Drive], None] | None,
    console: Console,
    follow: PlaySettings | None,
) -> Generator[ArrayPresenter]:
    choices = replace(exposure or default_exposure(), room=room)
    drives = [stimulus for stimulus in plan.design.stimuli if stimulus.kind == "drive"]
    lasting = [load_solution(folder.path / one.source, streamed=True).drive for one in drives]
    single: ImmediateArray | None = None
    if follow is not None:
        if array == "virtual":
            raise InputError(
                "--follow: expected --array autd3 or autd3:INTERFACE, got virtual, above which no palm moves"
            )
        rates = {drive.rate for drive in lasting}
        if len(rates) > 1:
            raise InputError(
                f"--follow: expected drives of one frame rate, got {', '.join(f'{r:g}' for r in rates)} Hz"
            )
        follow = follow.but(device=array, exposure=choices)
        device = single = immediate_array(follow, max(rates, default=1000.0))
    else:
        device = VirtualArray(TransducerArray.autd3()) if array == "virtual" else array_named(array)

    @lru_cache(maxsize=32)
    def admitted_share(source: str, share: float) -> tuple[Drive, ExposureClearance]:
        drive = load_solution(folder.path / source).drive
        if share == 1 and before is not None:
            before(drive)
        # Radiation pressure is proportional to the square of the sound pressure, which is proportional to the level.
        drive = drive if share == 1 else replace(drive, level=drive.level * share**0.5)
        if follow is not None:
            return drive, clear_followed(drive, device, follow, grid_of(drive))
        return drive, check_exposure(drive, device, choices)

    def admitted(stimulus: Stimulus) -> ExposureClearance:
        return admitted_share(stimulus.source, stimulus.share)[1]

    with ExitStack() as stack:
        stack.enter_context(device)
        followed = None
        if follow is not None and single is not None:
            tracker = stack.enter_context(open_tracker(tracker_name(follow.follow, follow.tracker_latency)))

            def play_following(stimulus: Stimulus, source: str, progress: Progress) -> PlayReport:
                drive, cleared = admitted_share(stimulus.source, stimulus.share)
                how: Any = {"source": source, "report": console.print, "progress": progress}
                return play_followed(drive, single, tracker, follow, cleared, grid_of(drive), **how).report

            followed = play_following
        silence = max((drive.frames / drive.rate for drive in lasting), default=0.0)
        presenter = ArrayPresenter(
            array=device, admitted=admitted, by_hand=by_hand, room=room, silence_s=silence, followed=followed
        )
        presenter.check(plan.design.stimuli)
        for path in dict.fromkeys(folder.path / one.source for one in drives):
            air = check_air(load_solution(path).drive, room, partial(load_target, path), simulated=device.simulated)
            console.print(plain_text(f"{path.name}: {air.said}"), style="yellow" if air.warns else None)
        for one in drives:
            if (admission := admitted(one)).outcome == "attenuated":
                console.print(plain_text(f"{one.source}: exposure {admission.verdict()}"), style="yellow")
        yield presenter
