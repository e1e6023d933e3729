"""Screen for a simulated participant."""

from dataclasses import dataclass, field

from midair.errors import DeviceStateError
from midair.study.design import Plan, Trial
from midair.study.session.participant import SimulatedParticipant
from midair.study.session.presenters import SilentPresenter
from midair.study.session.steps import Reply, TrialStep


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedScreen:
    """Screen that answers by the model of a simulated participant and shows nothing."""

    plan: Plan
    """Plan of the session."""
    participant: SimulatedParticipant
    presenter: SilentPresenter = field(default_factory=SilentPresenter)
    """Presenter of the session, which knows the stimuli of adaptive blocks."""
    number: int = 1
    """Participant number, from 1; form questions are answered with the option of this index."""

    def show(self, text: str) -> None:
        """Ignore the text."""

    def rest(self, step: TrialStep) -> None:
        """Skip the break."""

    def cue(self, text: str) -> None:
        """Ignore the cue."""

    def ask(self, step: TrialStep) -> Reply:
        """Answer by the model; to the form, successive participants give successive options."""
        if step.question and not step.code:
            possible = step.question.answers or (str(step.question.low),)
            return Reply(text=possible[(self.number - 1) % len(possible)], reaction_s=1.0, by="model")
        trial = self.plan.trial(step.code)
        name = step.question.name if step.question else ""
        text, reaction = self.participant.answer(self.plan, trial, name, felt=self._presented_stimulus(trial))
        return Reply(text=text, reaction_s=reaction, by="model")

    def _presented_stimulus(self, trial: Trial) -> str:
        """Presented stimulus of a trial; in an adaptive block from the presenter, since the plan does not state it."""
        known = (self.plan.design.stimulus(name) for name in self.plan.design.block(trial.block).stimuli)
        last = self.presenter.felt
        return trial.stimulus or next(
            one.name for one in known if one.members == last or (not one.members and one.name == last[-1])
        )

    def accepted(self, step: TrialStep, answer: str) -> None:
        """Do nothing."""

    def refused(self, step: TrialStep, why: str) -> None:
        """Raise DeviceStateError: an invalid answer is a defect of the model."""
        raise DeviceStateError(f"simulated participant: expected its answer to be accepted, got {why} at {step.code}")
