"""Simulated participants with a signal detection model, and their screen, for trial runs and power analysis."""

from dataclasses import dataclass, field
from hashlib import sha256

import numpy as np

from midair.errors import DeviceStateError, InputError
from midair.study.design.plan import Plan, Trial, stimulus_levels
from midair.study.design.question import Question, Stimulus, right_answer
from midair.study.design.session_state import right_answer_of_trial
from midair.study.design.study_design import Design
from midair.study.session.presenters import SilentPresenter
from midair.study.session.trials import Reply, TrialStep


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedParticipant:
    """Simulated observer of signal detection theory.

    - Choice: every option has a normal internal value with standard deviation 1 and mean d' for the correct option, 0
      for the others, plus the participant's bias for the option; the largest is chosen.
    - Yes-no: "yes" if a normal value with mean d' (0 for silence) exceeds d'/2. Same-different: "different" if two
      normal values, d' apart for different stimuli, differ by more than d'/2 + 1/2.
    - Rating: the middle of the scale, plus `rating_effect` / 2 steps (minus for a question about another object), plus
      the participant's level, plus normal noise, rounded to the scale.
    - Slider: as a rating, without rounding. Texts are SIMULATED. Attention checks are answered correctly.
    - Magnitude: log-normal, `magnitude` times the participant's unit.
    - In blocks with a strength, d' is that of the geometric mean of the strengths and proportional to the strength; the
      yes-no criterion is 1.5, so that 7 % of silences are false alarms.
    - A lapse is a random answer. Reaction times are log-normal with a median of 0.9 s.

    Each answer depends only on the seed, the participant, the trial and the question: an interrupted and resumed
    session gives the same answers.
    """

    d_prime: float = 1.2
    """Mean d' over participants, for drives."""
    real_d_prime: float = 3.5
    """Mean d' over participants, for real objects."""
    spread: float = 0.3
    """Standard deviation of d' over participants."""
    taste: float = 0.2
    """Standard deviation of the bias for an option."""
    lapse: float = 0.02
    """Lapse rate, 0 to 1."""
    rating_effect: float = 1.0
    """Difference in rating steps between the presented and another object."""
    rating_noise: float = 1.0
    """Standard deviation of ratings, in steps; that of the participants' levels is 0.8 of it."""
    magnitude: float = 10.0
    """Median answer."""
    seed: int = 0
    """Seed of all participants."""

    def __post_init__(self) -> None:
        if not 0 <= self.lapse <= 1 or min(self.spread, self.taste, self.rating_noise) < 0 or self.magnitude <= 0:
            raise InputError("simulated participant: expected lapse in 0 to 1, deviations of 0 or more, magnitude > 0")

    def answer(self, plan: Plan, trial: Trial, name: str, *, felt: str = "") -> tuple[str, float]:
        """Answer to a question and its reaction time in s; `felt` names the stimulus of an adaptive trial."""
        question, stimulus = plan.design.question(name), plan.design.stimulus(trial.stimulus or felt)
        rng = self._stream(f"{plan.design.name} {plan.design.seed} {trial.code} {name}")
        reaction = float(np.exp(rng.normal(np.log(0.9), 0.35)))
        if trial.role == "attention" and (right := right_answer_of_trial(plan, trial, {trial.code: felt}, name)):
            return right, reaction
        if question.answers and rng.random() < self.lapse:
            return str(rng.choice(question.answers)), reaction
        return self._answer(plan.design, question, stimulus, trial, rng), reaction

    def _answer(
        self, design: Design, question: Question, stimulus: Stimulus, trial: Trial, rng: np.random.Generator
    ) -> str:
        middle = {
            block.strength: float(np.exp(np.log(stimulus_levels(design, block)[1]).mean()))
            for block in design.blocks
            if block.strength
        }
        factor = next((factor for factor in middle if factor in stimulus.levels), "")
        strength = float(stimulus.levels[factor]) / middle[factor] if factor else 1.0
        person = self._stream(f"person {trial.participant} {question.name}")
        real = stimulus.kind == "object"
        d = strength * ((self.real_d_prime if real else self.d_prime) + person.normal(0, self.spread))
        right = right_answer(question, stimulus, {**stimulus.levels, **trial.levels, **question.levels})
        if question.kind == "choice":
            value = rng.normal(0, 1, len(question.options)) + person.normal(0, self.taste, len(question.options))
            value += d * np.array([option == right for option in question.options])
            return question.options[int(np.argmax(value))]
        if question.kind == "yes-no":
            return "yes" if rng.normal(d if right == "yes" else 0, 1) > (1.5 if middle else d / 2) else "no"
        if question.kind == "same-different":
            apart = abs(rng.normal(d if right == "different" else 0, np.sqrt(2)))
            return "different" if apart > d / 2 + 0.5 else "same"
        if question.kind == "magnitude":
            return f"{self.magnitude * np.exp(person.normal(0, 0.3) + rng.normal(0, 0.2)):g}"
        if question.kind == "text":
            return "SIMULATED"
        match = bool(set(question.levels.values()) & set(trial.levels.values()))
        level = (question.low + question.high) / 2 + self.rating_effect * (0.5 if match else -0.5)
        level += person.normal(0, 0.8 * self.rating_noise) + rng.normal(0, self.rating_noise)
        if question.kind == "slider":
            return f"{float(np.clip(level, question.low, question.high)):g}"
        return str(int(np.clip(round(level), question.low, question.high)))

    def _stream(self, words: str) -> np.random.Generator:
        return np.random.default_rng([self.seed, int.from_bytes(sha256(words.encode()).digest()[:8], "big")])


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
