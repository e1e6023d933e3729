"""The command `study run`."""

import sys

from midair.cli.console import PlainConsole, out, warn_simulated
from midair.cli.exposure_options import RoomOptions
from midair.cli.options import OptionalTime, StopInput, Study
from midair.cli.terminal_screen import TerminalScreen
from midair.devices import signals_end_the_program, stop_on_input
from midair.errors import InputError
from midair.rig import PlaySettings
from midair.study import (
    NO_PERSON,
    NO_TOUCH,
    InstantClock,
    Plan,
    Session,
    SilentPresenter,
    SimulatedParticipant,
    SimulatedScreen,
    StudyFolder,
    check_not_withdrawn,
    open_stimulus_rig,
    run,
    withdrawn,
)


def run_command(
    study: Study,
    /,
    *,
    participant: int = 0,
    simulate: bool = False,
    d_prime: float = 1.2,
    array: str = "none",
    noise: str = "default",
    lines: bool = False,
    serial: str = "",
    room: RoomOptions | None = None,
    stop_input: StopInput = None,
    follow: str | None = None,
    tracker_latency: OptionalTime = None,
) -> int:
    """Run or resume the session of one participant in this terminal. Ctrl-C stops at once.

    Parameters
    ----------
    participant
        Number of the participant, from 1; 0 with --simulate: all who are not done.
    simulate
        Simulate the participant's answers; everything made from them is marked SIMULATED.
    d_prime
        Sensitivity d' of the simulated participant to reproduced objects.
    array
        Array that plays the drives, as in midair play --device; none for a plan with real objects only.
        Instructions to the experimenter go to stderr: redirect them to another screen than the participant's.
    noise
        Sound output for the masking noise of the plan; none for no noise.
    lines
        Read whole lines instead of single keys.
    serial
        Serial port of the event markers in place of that of the plan; none for no serial markers.
    follow
        Tracker of the palm that drives follow on an AUTD3 array, as in midair play --follow.
    tracker_latency
        Latency of the tracker.

    Examples
    --------
    $ midair study run touch --participant 1 --simulate
    """
    if stop_input == "keyboard":
        raise InputError("--stop-input: expected serial:PORT or evdev:PATH, got keyboard, which the answers need")
    folder = StudyFolder(study)
    plan = folder.plan()
    if simulate:
        return _run_simulated(folder, plan, participant, d_prime)
    if participant < 1:
        raise InputError("participant: expected --participant N from 1, or --simulate, got neither")
    check_not_withdrawn(folder, participant)
    if _is_finished(folder, plan, participant):
        out().print(f"participant {participant} has already finished; no question was asked.")
        return 0
    settings = PlaySettings(exposure=(room or RoomOptions()).limits(), follow=follow, tracker_latency=tracker_latency)
    by_keys = not lines and sys.platform != "win32" and sys.stdin.isatty()
    screen = TerminalScreen(PlainConsole(markup=True, soft_wrap=False), sys.stdin if by_keys else None)
    with (
        signals_end_the_program(),
        stop_on_input(stop_input),
        open_stimulus_rig(
            array,
            folder,
            plan,
            settings=settings,
            noise=noise,
            serial=serial,
            show=screen.present_text,
            participant=participant,
        ) as rig,
    ):
        session = Session(
            plan,
            participant,
            folder.log(participant),
            rig.presenter,
            simulated=rig.simulated,
            room=settings.exposure.room,
            about=rig.about,
            markers=rig.markers,
        )
        warn_simulated(NO_TOUCH if rig.simulated else "")
        try:
            with session:
                step = run(session, screen)
        except EOFError as closed:
            raise InputError(
                "terminal: expected answers, got the end of input; the answers so far are stored"
            ) from closed
    out().print("Done." if step.kind == "done" else "Stopped; the answers so far are stored.")
    standing = session.standing()
    if standing.next_trial < len(standing.trials) and not standing.broken_off:
        due = standing.trials[standing.next_trial].session
        out().print(f"Session {due} is next: run the same command again.")
    return 0 if step.kind == "done" else 1


def _is_finished(folder: StudyFolder, plan: Plan, participant: int) -> bool:
    plan.of(participant)  # raises for a number without trials, before a log file is created
    if not folder.log(participant).exists():
        return False
    standing = folder.session(plan, participant)
    return standing.next_trial == len(standing.trials)


def _run_simulated(folder: StudyFolder, plan: Plan, participant: int, d_prime: float) -> int:
    gone = withdrawn(folder)
    everybody = [number for number in range(1, plan.design.participants + 1) if number not in gone]
    numbers = [participant] if participant else everybody
    model = SimulatedParticipant(d_prime=d_prime, seed=plan.design.seed)
    for number in numbers:
        check_not_withdrawn(folder, number)
        presenter, log = SilentPresenter(), folder.log(number)
        screen = SimulatedScreen(plan=plan, participant=model, presenter=presenter, number=number)
        for _ in range(plan.design.sessions):
            with Session(plan, number, log, presenter, simulated=True, clock=InstantClock()) as session:
                run(session, screen)
        out().print(f"participant {number}: done")
    warn_simulated(NO_PERSON)
    return 0
