"""Sessions of a study: presentation, questions, timing, the event log and simulated participants."""

from midair.study.session.event_log import chain_hash, chain_hashes, read_events
from midair.study.session.participant import SimulatedParticipant
from midair.study.session.presenters import (
    ArrayPresenter,
    ExperimenterPresenter,
    MaskedPresenter,
    Masking,
    Presenter,
    SilentPresenter,
)
from midair.study.session.simulated_screen import SimulatedScreen
from midair.study.session.steps import Clock, InstantClock, Reply, Screen, SystemClock, TrialStep
from midair.study.session.trials import Session, run

__all__ = [
    "ArrayPresenter",
    "Clock",
    "ExperimenterPresenter",
    "MaskedPresenter",
    "Masking",
    "SilentPresenter",
    "Presenter",
    "Reply",
    "Screen",
    "Session",
    "SimulatedParticipant",
    "SimulatedScreen",
    "InstantClock",
    "SystemClock",
    "TrialStep",
    "chain_hashes",
    "read_events",
    "run",
    "chain_hash",
]
