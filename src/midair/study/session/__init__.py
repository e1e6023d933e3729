"""A session: present, ask, time, store; and participants who are simulated."""

from midair.study.session.event_log import read_events
from midair.study.session.participant import SimulatedParticipant
from midair.study.session.presenters import ArrayPresenter, ExperimenterPresenter, NoPresenter, Presenter
from midair.study.session.simulated_screen import SimulatedScreen
from midair.study.session.trials import Reply, Session, TrialStep, run

__all__ = [
    "ArrayPresenter",
    "ExperimenterPresenter",
    "NoPresenter",
    "Presenter",
    "Reply",
    "Session",
    "SimulatedParticipant",
    "SimulatedScreen",
    "TrialStep",
    "read_events",
    "run",
]
