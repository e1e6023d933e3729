"""A stimulus, and the correct answer to a question about it."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

from midair.errors import InputError
from midair.study.design.question import Question, one_of

StimulusKind = Literal["drive", "object", "silence", "pair", "text", "picture", "sound"]
"""A drive that an array plays; a real object that the experimenter presents; nothing (catch trial); two stimuli in a
row; a text; a picture or a sound, which only the participant's page in the studio presents."""

ENDINGS = {"picture": (".png", ".jpg", ".jpeg", ".webp"), "sound": (".wav", ".flac", ".mp3", ".ogg")}
"""File names of pictures and sounds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stimulus:
    """A drive, a real object, silence, or a pair of stimuli."""

    name: str
    """Identifier in the plan; participants never see it."""
    kind: StimulusKind = "drive"
    source: str = ""
    """File of the drive, picture or sound; the object that the experimenter presents; or the text."""
    duration_s: float = 1.0
    """How long a text or picture is shown, in s."""
    made_from: str = ""
    """Source of a missing drive, as in `midair record`: ``virtual:towel+groove``. Such drives are SIMULATED."""
    share: float = 1.0
    """Share of the drive's radiation pressure that is played, above 0 to 1."""
    members: tuple[str, ...] = ()
    """Names of the two stimuli of a pair."""
    either_order: str = ""
    """Factor of a pair whose level, "first" or "second", is the position of the first member; both orders are drawn
    equally often (`both_orders`). If empty, the order of `members` is kept."""
    gap_s: float = 0.5
    """Silence between the members of a pair, in s."""
    code: int = 2
    """Byte of the event marker at its start, 2 or 5 to 255. Different codes reveal the condition in the log."""
    levels: Mapping[str, str] = field(default_factory=dict[str, str])
    """Level of each factor, such as ``{"object": "towel"}``."""

    def __post_init__(self) -> None:
        one_of(self.kind, StimulusKind, f"stimulus {self.name!r}: kind")
        if (self.kind == "pair") != (len(self.members) == 2):
            raise InputError(
                f"stimulus {self.name!r}: expected two members for a pair and none otherwise, got {list(self.members)}"
            )
        if (self.either_order and self.kind != "pair") or not 0 <= self.gap_s < float("inf"):
            raise InputError(f"stimulus {self.name!r}: expected either_order only for pairs, and gap_s of 0 s or more")
        if not 0 < self.share <= 1 or (self.made_from and not self.made_from.startswith("virtual:")):
            raise InputError(
                f"stimulus {self.name!r}: expected share above 0 to 1 and made_from virtual:NAME, got {self.share:g} "
                f"and {self.made_from!r}"
            )
        if self.code != 2 and not 5 <= self.code <= 255:
            raise InputError(
                f"stimulus {self.name!r}: expected code 2 or 5 to 255 (1, 3 and 4 mark trials and answers),"
                f" got {self.code}"
            )
        if self.kind not in ("silence", "pair") and not self.source:
            raise InputError(f"stimulus {self.name!r}: expected the source of the {self.kind}, got none")
        filed = self.kind in ("drive", "picture", "sound")
        if filed and (self.source.startswith("/") or ".." in self.source.split("/")):
            raise InputError(
                f"stimulus {self.name!r}: expected a {self.kind} below the plan's folder, got {self.source!r}"
            )
        if self.kind in ENDINGS and not self.source.lower().endswith(ENDINGS[self.kind]):
            raise InputError(
                f"stimulus {self.name!r}: expected a {self.kind} ({', '.join(ENDINGS[self.kind])}), got {self.source!r}"
            )
        if not 0 < self.duration_s <= 3600:
            raise InputError(
                f"stimulus {self.name!r}: expected duration_s above 0 to 3600 s, got {self.duration_s:g} s"
            )


def both_orders(stimulus: Stimulus) -> tuple[Stimulus, ...]:
    """The two orders of a pair, each as a stimulus with its level of the factor; any other stimulus unchanged."""
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
    """Correct answer to a question about a stimulus; empty if the question has none."""
    if question.truth:
        return levels.get(question.truth, "")
    if question.kind == "yes-no":
        return "no" if stimulus.kind == "silence" else "yes"
    if question.kind == "same-different" and stimulus.members:
        return "same" if stimulus.members[0] == stimulus.members[1] else "different"
    return ""
