"""Planned analyses, exclusion rules and power of a study, fixed before the first participant."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from midair.errors import InputError
from midair.study.design.question import one_of

Incomplete = Literal["leave out", "refuse"]
"""Participants who lack a cell of the analysis of variance: leave them out, or refuse the analysis."""

UnpresentedAnswers = Literal["wrong", "leave out", "refuse"]
"""Answers that name an object that was never presented: count them as wrong, leave them out, or refuse the analysis of
choices."""


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
    """Between-subject factors: questions of the form, or columns with one level per participant."""
    incomplete: Incomplete = "leave out"
    foils: UnpresentedAnswers = "wrong"
    strength: str = ""
    """Factor with numeric levels for which a psychometric function is fitted to correct answers; no fit if empty."""
    guess: float = 0.5
    """Guess rate of the psychometric function: 1/m with m alternatives."""
    lapse_most: float = 0.15
    """Largest lapse rate in the fits of thresholds and of the psychometric function."""
    margin: float = 0.1
    """Equivalence margin of the difference of macro F between conditions."""

    def __post_init__(self) -> None:
        one_of(self.incomplete, Incomplete, "analysis: incomplete")
        one_of(self.foils, UnpresentedAnswers, "analysis: foils")
        if not 0 <= self.lapse_most < 0.5:
            raise InputError(f"analysis: expected lapse_most from 0 to below 0.5, got {self.lapse_most:g}")


PowerTest = Literal["paired", "identification", "rating", "equivalence", "threshold"]
"""Paired t-test over participants; identification above chance; effect of a two-level factor on a rating; equivalence
of two conditions within a margin; mean threshold whose confidence interval excludes a bound."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedPower:
    """A test and an effect size for which the plan page computes the power."""

    test: PowerTest
    effect: float
    """Effect size, in the unit of the test: d_z (paired); mean d' (identification); difference in rating steps
    (rating); margin over the standard deviation of the participants' differences (equivalence); distance of the bound
    from the mean of the log thresholds, over their standard deviation (threshold)."""
    objects: int = 3
    """Number of alternatives (identification)."""
    trials: int = 12
    """Trials per participant (identification)."""

    def __post_init__(self) -> None:
        one_of(self.test, PowerTest, "power: test")


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
