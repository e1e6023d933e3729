"""A simulated participant in front of the screen."""

from dataclasses import dataclass, field

from midair.errors import DeviceStateError
from midair.study.design import Plan, Trial
from midair.study.session.participant import SimulatedParticipant
from midair.study.session.presenters import SilentPresenter
from midair.study.session.steps import Reply, TrialStep


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedScreen:
    """A simulated participant before the screen: reads nothing, rests never, answers by its model.

    Attributes
    ----------
    plan : Plan
        In which it looks up what it felt.
    participant : SimulatedParticipant
        Its model.
    presenter : NoPresenter
        Of the session; tells what an adaptive block has chosen.
    number : int
        Of the participant: the first gives the first answer to a question of the form, the second the second.
    """

    plan: Plan
    participant: SimulatedParticipant
    presenter: SilentPresenter = field(default_factory=SilentPresenter)
    number: int = 1

    def show(self, text: str) -> None:
        """Does not read."""

    def rest(self, step: TrialStep) -> None:
        """Does not tire."""

    def cue(self, text: str) -> None:
        """Needs no telling."""

    def ask(self, step: TrialStep) -> Reply:
        """Answers by the model; to a form, one participant after the other gives the next answer."""
        if step.question and not step.code:
            possible = step.question.answers or (str(step.question.low),)
            return Reply(text=possible[(self.number - 1) % len(possible)], reaction_s=1.0, by="model")
        trial = self.plan.trial(step.code)
        name = step.question.name if step.question else ""
        text, reaction = self.participant.answer(self.plan, trial, name, felt=self._felt(trial))
        return Reply(text=text, reaction_s=reaction, by="model")

    def _felt(self, trial: Trial) -> str:
        """The stimulus of a trial, by what was presented: the plan does not know that of an adaptive block."""
        known = (self.plan.design.stimulus(name) for name in self.plan.design.block(trial.block).stimuli)
        last = self.presenter.felt
        return trial.stimulus or next(
            one.name for one in known if one.members == last or (not one.members and one.name == last[-1])
        )

    def accepted(self, step: TrialStep, answer: str) -> None:
        """Does not care."""

    def refused(self, step: TrialStep, why: str) -> None:
        """Its answers are answers; a refusal is a defect of the model.

        Raises
        ------
        DeviceStateError
            Always.
        """
        raise DeviceStateError(f"simulated participant: expected its answer to be accepted, got {why} at {step.code}")
