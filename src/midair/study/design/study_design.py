"""Settings of a whole study: planned analyses, exclusion rules, blocks of trials and extra trials in them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from midair.errors import InputError, MismatchError
from midair.study.design.question import Question, Stimulus
from midair.validation import one_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Analysis:
    """Planned analyses of a study."""

    choice: str = ""
    """Question of the confusion matrix; no matrix if empty."""
    condition: str = ""
    """Factor of two levels whose F-measures are compared; no comparison if empty."""
    only: Mapping[str, str] = field(default_factory=dict[str, str])
    """Levels that a trial must have to be analysed, such as ``{"presentation": "reproduced"}``."""
    rated: tuple[str, ...] = ()
    """Questions of the analysis of variance; no analysis of variance if empty."""
    within: tuple[str, ...] = ()
    """Within-subject factors of the analysis of variance."""
    between: tuple[str, ...] = ()
    """Between-subject factors of the R script: questions of the form, or columns with one level per participant."""
    lapse_most: float = 0.15
    """Largest lapse rate in the fits of thresholds."""
    margin: float = 0.1
    """Equivalence margin of the difference of macro F between conditions."""

    def __post_init__(self) -> None:
        if not 0 <= self.lapse_most < 0.5:
            raise InputError(f"analysis: expected lapse_most from 0 to below 0.5, got {self.lapse_most:g}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Exclusions:
    """Rules that exclude answers and participants from the analysis; each rule is off by default."""

    fastest_s: float = 0.0
    slowest_s: float = 0.0
    """Answers faster than `fastest_s` or slower than `slowest_s` are excluded, in s; 0 for no limit."""
    attention: float = 0.0
    """Least share of attention checks that a participant must answer correctly."""
    catch: float = 0.0
    """Least share of catch trials that a participant must answer correctly."""
    timeouts: float = 1.0
    """Largest share of questions without an answer within the time limit."""
    training: bool = False
    """Whether participants who did not reach the criterion of a training block are excluded."""
    failed_plays: bool = False
    """Whether trials whose presentation failed and was repeated are excluded."""
    unfinished: bool = False
    """Whether participants with unanswered questions in any session of the plan are excluded."""

    def __post_init__(self) -> None:
        if not self.fastest_s >= 0 or not (self.slowest_s == 0 or self.fastest_s < self.slowest_s):
            raise InputError(
                f"exclusions: expected fastest_s below slowest_s, got {self.fastest_s:g} and {self.slowest_s:g} s"
            )
        for name in ("attention", "catch", "timeouts"):
            if not 0 <= getattr(self, name) <= 1:
                raise InputError(f"exclusions: expected {name} from 0 to 1, got {getattr(self, name):g}")


BlockOrder = Literal["shuffle", "rounds", "fixed"]
"""All trials of a block shuffled; every stimulus once per repetition, shuffled anew in each; as listed."""

Adaptive = Literal["", "staircase", "quest+"]
"""Stimuli fixed by the plan; 3-down/1-up staircase; QUEST+."""

ExtraRole = Literal["catch", "anchor", "attention"]
"""A trial without a stimulus or difference; an end of the rating scale; a trial that every attentive participant
answers correctly."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Extra:
    """Extra trials inserted at random positions of a block, never the first one."""

    role: ExtraRole
    stimuli: tuple[str, ...]
    repetitions: int = 1
    """Trials of each stimulus."""
    questions: tuple[str, ...] = ()
    """Names of the questions; those of the block if empty."""

    def __post_init__(self) -> None:
        one_of(self.role, ExtraRole, "extras: role")
        if not self.stimuli or self.repetitions < 1:
            raise InputError(f"extras: expected stimuli and repetitions of 1 or more, got {self.repetitions}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Criterion:
    """Criterion that ends a training block: share of correct answers to the first question."""

    right: float
    """Least share of correct answers, above 0 to 1."""
    last: int
    """Number of latest answers over which the share is computed."""

    def __post_init__(self) -> None:
        if not 0 < self.right <= 1 or self.last < 1:
            raise InputError(f"criterion: expected right in 0 to 1, last of 1 or more, got {self.right:g}, {self.last}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """A sequence of trials with the same questions."""

    name: str
    stimuli: tuple[str, ...]
    questions: tuple[str, ...]
    repetitions: int = 1
    """Trials of each stimulus; in an adaptive block the number of all trials; with a criterion the maximum."""
    order: BlockOrder = "shuffle"
    shuffle_questions: bool = False
    """Whether the questions are in a random order in each trial; the plan has the order."""
    longest_run: int = 0
    """Largest number of trials with the same stimulus in a row; 0 for no limit."""
    group: str = ""
    """Group of consecutive blocks, the unit of `Design.counterbalanced`; the name of the block if empty."""
    scored: bool = True
    """Whether the answers are analysed; false for familiarisation."""
    levels: Mapping[str, str] = field(default_factory=dict[str, str])
    """Factor levels of all trials of the block."""
    text: str = ""
    """Instruction shown before the first trial."""
    rest_s: float = 0.0
    """Shortest break after the block, in s."""
    adaptive: Adaptive = ""
    """Method that chooses the stimuli from the answers to the first question."""
    strength: str = ""
    """Factor with the numeric stimulus strength of a block whose thresholds are estimated. If several stimuli of an
    adaptive block share a strength (left and right), the plan draws each equally often."""
    extras: tuple[Extra, ...] = ()
    """Catch trials, anchors and attention checks."""
    criterion: Criterion | None = None
    """Ends the block as soon as it is met."""
    feedback: bool = False
    """Whether the correct answer is shown after each trial."""
    break_every: int = 0
    """Number of trials between breaks of `rest_s` within the block; 0 for none."""
    jitter_s: tuple[float, float] = (0.0, 0.0)
    """Shortest and longest time before each stimulus, in s; drawn with the plan."""
    session: int = 1
    """Session number, from 1."""

    def __post_init__(self) -> None:
        one_of(self.order, BlockOrder, f"block {self.name!r}: order")
        one_of(self.adaptive, Adaptive, f"block {self.name!r}: adaptive")
        if (self.adaptive and not self.strength) or (self.strength and len(self.stimuli) < 3):
            raise InputError(f"block {self.name!r}: expected three stimuli or more with a strength, as adaptive needs")
        if not self.stimuli or self.repetitions < 1 or self.longest_run < 0 or self.rest_s < 0:
            raise InputError(
                f"block {self.name!r}: expected stimuli, repetitions of 1 or more, longest_run and rest_s of 0 or more"
            )
        if not 0 <= self.jitter_s[0] <= self.jitter_s[1] < float("inf"):
            raise InputError(f"block {self.name!r}: expected jitter_s from short to long, got {list(self.jitter_s)}")
        if self.break_every < 0 or (self.break_every and not self.rest_s) or self.session < 1:
            raise InputError(
                f"block {self.name!r}: expected break_every of 0 or more with a rest_s, and session of 1 or more"
            )
        if not self.group:
            object.__setattr__(self, "group", self.name)


@dataclass(frozen=True, slots=True, kw_only=True)
class MaskingNoise:
    """White noise in the headphones during a presentation, which masks the sound of the array."""

    level_dbfs: float
    """Rms level relative to the rms of a full-scale sine, in dB."""
    full_scale_db: float | None = None
    """Measured sound pressure level of a full-scale sine in the headphones, in dB SPL; None if not measured."""
    ramp_s: float = 0.2
    """Fade-in before and fade-out after the stimulus, in s."""

    def __post_init__(self) -> None:
        if not -90 <= self.level_dbfs <= -2:
            # Uniform full-scale noise has an rms 1.8 dB below that of a full-scale sine.
            raise InputError(f"noise: expected level_dbfs from -90 to -2 dB, got {self.level_dbfs:g} dB")
        if not 0.01 <= self.ramp_s <= 5:
            raise InputError(f"noise: expected ramp_s from 0.01 to 5 s, got {self.ramp_s:g} s")

    @property
    def said(self) -> str:
        """The level as text."""
        words = f"white noise at {self.level_dbfs:g} dB (rms, relative to a full-scale sine)"
        if self.full_scale_db is None:
            return f"{words}; sound pressure level unknown: state it in the plan (full_scale_db)"
        return f"{words}, {self.level_dbfs + self.full_scale_db:g} dB SPL"


@dataclass(frozen=True, slots=True, kw_only=True)
class MarkerOutputs:
    """Outputs of the event markers for other recorders, such as EEG."""

    lsl: str = ""
    """Name of a stream of the Lab Streaming Layer; none if empty."""
    serial: str = ""
    """Serial port, which gets one byte per marker; none if empty."""
    baud: int = 115_200
    """Speed of the serial port, in bits per second."""

    def __post_init__(self) -> None:
        if not (self.lsl or self.serial) or not 300 <= self.baud <= 4_000_000:
            raise InputError(
                f"markers: expected lsl or serial, and baud from 300 to 4000000, got {self.lsl!r}, {self.serial!r}"
                f" and {self.baud}"
            )

    @property
    def said(self) -> str:
        """The outputs as text."""
        stream = [f"LSL stream {self.lsl}"] if self.lsl else []
        return ", ".join([*stream, *([f"serial port {self.serial}, {self.baud} bit/s"] if self.serial else [])])


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """A study: stimuli, questions, blocks, planned analyses and texts."""

    name: str
    """ASCII letters and digits only: the task name in BIDS file names."""
    participants: int
    """Number of participants for whom trials are drawn."""
    seed: int
    """Seed of all shuffles."""
    stimuli: tuple[Stimulus, ...]
    questions: tuple[Question, ...]
    blocks: tuple[Block, ...]
    title: str = ""
    """Title for participants and reports."""
    counterbalanced: tuple[str, ...] = ()
    """Groups of blocks whose order follows a balanced Latin square, across sessions too; other groups keep their
    position."""
    consent: str = ""
    """Text shown before the session."""
    debrief: str = ""
    """Text shown after the session."""
    analysis: Analysis = field(default_factory=Analysis)
    form: tuple[str, ...] = ()
    """Questions asked once before the first trial, such as a pseudonym."""
    cue: str = "Feel now."
    """Text shown when a stimulus starts; no text if empty."""
    noise: MaskingNoise | None = None
    """Masking noise in the headphones while the array plays."""
    markers: MarkerOutputs | None = None
    """Outputs of the event markers; none if None."""
    exclusions: Exclusions = field(default_factory=Exclusions)
    authors: tuple[str, ...] = ()
    """Authors of published datasets."""
    license: str = ""
    """License of published datasets, such as "CC0"."""
    institution: str = ""
    """Institution stated in published datasets."""

    def __post_init__(self) -> None:
        if not (self.name.isascii() and self.name.isalnum()):
            raise InputError(f"study: expected a name of letters and digits, got {self.name!r}")
        if self.participants < 1 or not self.blocks:
            raise InputError(f"study: expected participants and blocks, got {self.participants}, {len(self.blocks)}")
        every: dict[str, Any] = {"stimuli": self.stimuli, "questions": self.questions, "blocks": self.blocks}
        names = {kind: [part.name for part in parts] for kind, parts in every.items()}
        for kind, listed in names.items():
            if len(set(listed)) < len(listed):
                raise InputError(f"{kind}: expected different names, got {sorted(listed)}")
        for block in self.blocks:
            _known(block.stimuli, names["stimuli"], f"block {block.name!r}: stimuli")
            _known(block.questions, names["questions"], f"block {block.name!r}: questions")
            for extra in block.extras:
                _known(extra.stimuli, names["stimuli"], f"block {block.name!r}: extras")
                _known(extra.questions, names["questions"], f"block {block.name!r}: extras")
        for stimulus in self.stimuli:
            _known(stimulus.members, names["stimuli"], f"stimulus {stimulus.name!r}: members")
        _known(self.form, names["questions"], "form")
        _known(self.counterbalanced, [block.group for block in self.blocks], "counterbalanced groups")
        self._check_analysis(names["questions"])

    @property
    def factors(self) -> tuple[str, ...]:
        """Names of all factors, in order of appearance."""
        parts: list[Any] = [*self.stimuli, *self.blocks, *self.questions]
        named = dict.fromkeys(factor for part in parts for factor in part.levels)
        return (*named, *{one.either_order: None for one in self.stimuli if one.either_order})

    @property
    def sessions(self) -> int:
        """Number of sessions of each participant."""
        return max(block.session for block in self.blocks)

    def stimulus(self, name: str) -> Stimulus:
        """The stimulus of this name."""
        return next(part for part in self.stimuli if part.name == name)

    def question(self, name: str) -> Question:
        """The question of this name."""
        return next(part for part in self.questions if part.name == name)

    def block(self, name: str) -> Block:
        """The block of this name."""
        return next(part for part in self.blocks if part.name == name)

    def _check_analysis(self, questions: list[str]) -> None:
        chosen = (self.analysis.choice,) if self.analysis.choice else ()
        _known((*chosen, *self.analysis.rated), questions, "analysis: questions")
        named = (self.analysis.condition, *self.analysis.within, *self.analysis.only)
        truths = (question.truth for question in self.questions)
        _known(tuple(name for name in (*named, *truths) if name), list(self.factors), "factors")
        _known(self.analysis.between, [*self.form, *self.factors], "analysis: between")
        # The answers table has columns of these names, and one column per factor.
        taken = {"participant", "trial", "answer", "question", "block", "correct", "right", "stimulus", "scored"}
        taken |= {"role", "session", "excluded", "simulated"}
        if clash := (taken & {*self.factors, *self.form}) | (set(self.form) & set(self.factors)):
            raise MismatchError(
                f"factors: expected names other than columns of the answers table, got {sorted(clash)}; rename them"
            )


def _known(asked: tuple[str, ...], known: list[str], what: str) -> None:
    if unknown := [name for name in asked if name not in known]:
        raise MismatchError(f"{what}: expected names among {', '.join(known) or 'none'}, got {unknown[0]!r}")
