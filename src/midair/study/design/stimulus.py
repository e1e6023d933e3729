"""Something to feel, and the right answer to a question about it."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

from midair.errors import InputError
from midair.study.design.question import Question, one_of

StimulusKind = Literal["drive", "object", "silence", "pair"]
"""A drive that an array plays; a real object that the experimenter presents; nothing; two stimuli in a row."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stimulus:
    """Something to feel: a drive, an object, nothing, or a pair.

    Attributes
    ----------
    name : str
        Known to nobody but the plan.
    kind : {"drive", "object", "silence", "pair"}
        How it is presented.
    source : str
        File of the drive, or what the experimenter is to take up.
    made_from : str
        Where a drive comes from if none is given: ``virtual:towel+groove``, as `midair record` takes it; SIMULATED.
    share : float
        Share of the drive's radiation pressure that is played, above 0 to 1.
    members : tuple of str
        Names of the two stimuli of a pair.
    either_order : str
        Of a pair: the name of a factor that says whether its first member comes "first" or "second". Both orders are
        drawn equally often; see `both_orders`. As written if empty.
    gap_s : float
        Silence between the members of a pair, in s.
    levels : mapping of str to str
        Level of each factor, such as ``{"object": "towel"}``.
    """

    name: str
    kind: StimulusKind = "drive"
    source: str = ""
    made_from: str = ""
    share: float = 1.0
    members: tuple[str, ...] = ()
    either_order: str = ""
    gap_s: float = 0.5
    levels: Mapping[str, str] = field(default_factory=dict[str, str])

    def __post_init__(self) -> None:
        one_of(self.kind, StimulusKind, f"stimulus {self.name!r}: kind")
        if (self.kind == "pair") != (len(self.members) == 2):
            raise InputError(f"stimulus {self.name!r}: expected two members of a pair, got {list(self.members)}")
        if (self.either_order and self.kind != "pair") or not 0 <= self.gap_s < float("inf"):
            raise InputError(f"stimulus {self.name!r}: expected either_order of pairs only, and gap_s of 0 or more")
        if not 0 < self.share <= 1 or (self.made_from and not self.made_from.startswith("virtual:")):
            raise InputError(
                f"stimulus {self.name!r}: expected share above 0 to 1 and made_from virtual:NAME, got {self.share:g} "
                f"and {self.made_from!r}"
            )
        if self.kind in ("drive", "object") and not self.source:
            raise InputError(f"stimulus {self.name!r}: expected the source of the {self.kind}, got none")
        if self.kind == "drive" and (self.source.startswith("/") or ".." in self.source.split("/")):
            raise InputError(f"stimulus {self.name!r}: expected a drive beside the plan, got {self.source!r}")


def both_orders(stimulus: Stimulus) -> tuple[Stimulus, ...]:
    """A pair in its two orders, each a stimulus of its own with its level of the factor; anything else as it is."""
    if not stimulus.either_order:
        return (stimulus,)
    return tuple(
        replace(
            stimulus,
            name=f"{stimulus.name}_{place}",
            members=stimulus.members[::way],
            either_order="",
            levels={**stimulus.levels, stimulus.either_order: place},
        )
        for place, way in (("first", 1), ("second", -1))
    )


def right_answer(question: Question, stimulus: Stimulus, levels: Mapping[str, str]) -> str:
    """The right answer to a question about a stimulus; empty where there is none."""
    if question.truth:
        return levels.get(question.truth, "")
    if question.kind == "yes-no":
        return "no" if stimulus.kind == "silence" else "yes"
    if question.kind == "same-different" and stimulus.members:
        return "same" if stimulus.members[0] == stimulus.members[1] else "different"
    return ""
