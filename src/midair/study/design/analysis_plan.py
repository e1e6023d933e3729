"""What will be tested and who will be left out, said before the first participant."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from midair.errors import InputError
from midair.study.design.question import one_of

Incomplete = Literal["leave out", "refuse"]
"""People who lack a cell of the analysis of variance: the others are analysed; nobody is."""

UnpresentedAnswers = Literal["wrong", "leave out", "refuse"]
"""Answers that name what was never presented: wrong answers; left out; no analysis of choices."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Analysis:
    """What will be tested, said before the first participant.

    Attributes
    ----------
    choice : str
        The question of the confusion matrix; none if empty.
    condition : str
        Factor of two levels whose F-measures are compared; none if empty.
    only : mapping of str to str
        Levels that a trial must have to count, such as ``{"presentation": "reproduced"}``.
    rated : tuple of str
        Questions of the analysis of variance; none if empty.
    within : tuple of str
        Its factors.
    between : tuple of str
        Factors by which people differ: questions of the form, or columns with one level for each person.
    incomplete : {"leave out", "refuse"}
        What becomes of people who lack a cell of the analysis of variance.
    foils : {"wrong", "leave out", "refuse"}
        What becomes of answers to `choice` that name what was never presented.
    strength : str
        Factor whose levels are numbers: a psychometric function is fitted to right answers; none if empty.
    guess : float
        Chance of a right answer without a stimulus, for that function: 1/m with m alternatives.
    margin : float
        Difference of macro F between conditions that does not matter.
    """

    choice: str = ""
    condition: str = ""
    only: Mapping[str, str] = field(default_factory=dict[str, str])
    rated: tuple[str, ...] = ()
    within: tuple[str, ...] = ()
    between: tuple[str, ...] = ()
    incomplete: Incomplete = "leave out"
    foils: UnpresentedAnswers = "wrong"
    strength: str = ""
    guess: float = 0.5
    margin: float = 0.1

    def __post_init__(self) -> None:
        one_of(self.incomplete, Incomplete, "analysis: incomplete")
        one_of(self.foils, UnpresentedAnswers, "analysis: foils")


PowerTest = Literal["paired", "identification", "rating", "equivalence", "threshold"]
"""Paired t over people; objects told apart better than by guessing; a factor of two levels of a rating; two conditions
that do not differ, shown to be within a margin; a mean threshold whose limits leave out a bound."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedPower:
    """What the number of people is for: the chance that a test finds an effect of a stated size.

    Attributes
    ----------
    test : {"paired", "identification", "rating", "equivalence", "threshold"}
        As in `midair study power`.
    effect : float
        d_z; mean d'; difference in rating steps; margin over the standard deviation of people's differences; distance
        of the bound from the mean of the logarithms of thresholds, over their standard deviation.
    objects, trials : int
        Of "identification": alternatives, and trials of each participant.
    """

    test: PowerTest
    effect: float
    objects: int = 3
    trials: int = 12

    def __post_init__(self) -> None:
        one_of(self.test, PowerTest, "power: test")


@dataclass(frozen=True, slots=True, kw_only=True)
class Exclusions:
    """Answers and people that will not be analysed; each rule is off unless it is given.

    Attributes
    ----------
    fastest_s, slowest_s : float
        Answers given sooner or later are left out, in s; 0 for no limit.
    attention : float
        Least share of attention checks that a participant must have answered rightly.
    catch : float
        Least share of catch trials that a participant must have answered rightly.
    timeouts : float
        Largest share of questions that may have gone without an answer in time.
    training : bool
        Whether somebody who did not reach the criterion of a training block is left out.
    failed_plays : bool
        Whether a trial is left out whose presentation failed and was made again.
    unfinished : bool
        Whether a participant with open questions in the log, in any session of the plan, is left out.
    """

    fastest_s: float = 0.0
    slowest_s: float = 0.0
    attention: float = 0.0
    catch: float = 0.0
    timeouts: float = 1.0
    training: bool = False
    failed_plays: bool = False
    unfinished: bool = False

    def __post_init__(self) -> None:
        if not self.fastest_s >= 0 or not (self.slowest_s == 0 or self.fastest_s < self.slowest_s):
            raise InputError(
                f"exclusions: expected fastest_s below slowest_s, got {self.fastest_s:g} and {self.slowest_s:g} s"
            )
        for name in ("attention", "catch", "timeouts"):
            if not 0 <= getattr(self, name) <= 1:
                raise InputError(f"exclusions: expected {name} from 0 to 1, got {getattr(self, name):g}")
