from midair.study.session.participant import SimulatedParticipant, SimulatedScreen
from midair.study.session.trials import InstantClock, Session, run


def simulate(folder, participant=None):
    """Run one session of each participant of a study, and return its plan."""
    plan = folder.plan()
    for number in range(1, plan.design.participants + 1):
        screen = SimulatedScreen(plan=plan, participant=participant or SimulatedParticipant(), number=number)
        presenter, log = screen.presenter, folder.log(number)
        with Session(plan, number, log, presenter, simulated=True, clock=InstantClock()) as session:
            assert run(session, screen).kind == "done"
    return plan
