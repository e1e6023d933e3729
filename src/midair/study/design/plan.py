"""The trials of every participant, drawn before the first session: balanced Latin squares, shuffles without runs.

Adaptive blocks have levels and staircases (Levitt, 1971), which are immutable states.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from hashlib import sha256
from itertools import groupby
from json import dumps
from typing import Any, TypeVar

import numpy as np

from midair.array_types import Array
from midair.errors import InputError
from midair.study.design.question import both_orders, right_answer
from midair.study.design.study_design import Block, Design
from midair.validation import within


@dataclass(frozen=True, slots=True, kw_only=True)
class Staircase:
    """Level that goes down after `down` correct answers in a row and up after one wrong answer.

    With `down` = 3 it converges to 79.4 % correct answers (0.5^(1/3)).
    """

    level: float
    """Level of the next trial."""
    steps: tuple[float, ...]
    """Step sizes: the first until the first reversal, the second until the second, the last for all later trials."""
    down: int = 3
    """Correct answers in a row before the level goes down."""
    low: float = -np.inf
    high: float = np.inf
    row: int = 0
    """Correct answers since the last change."""
    move: int = 0
    """Direction of the last change, -1 or 1; 0 before it."""
    turned: tuple[float, ...] = ()
    """Levels of the reversals."""

    def __post_init__(self) -> None:
        if not self.steps or min(self.steps) <= 0 or self.down < 1:
            raise InputError(f"staircase: expected steps above 0 and down of 1 or more, got {self.steps}, {self.down}")
        if not self.low <= self.level <= self.high:
            raise InputError(f"staircase: expected a level within {self.low:g} to {self.high:g}, got {self.level:g}")

    def answered(self, correct: bool) -> "Staircase":
        """State after one answer."""
        if correct and self.row + 1 < self.down:
            return replace(self, row=self.row + 1)
        move = -1 if correct else 1
        # A reversal is counted at the level before the change.
        turns = (*self.turned, self.level) if self.move == -move else self.turned
        step = self.steps[min(len(turns), len(self.steps) - 1)]
        level = float(np.clip(self.level + move * step, self.low, self.high))
        return replace(self, level=level, row=0, move=move, turned=turns)


def stimulus_levels(design: Design, block: Block) -> tuple[list[tuple[str, ...]], Array]:
    """Stimuli of a block with a strength grouped by strength from weak to strong, and the strengths.

    Within a group, stimuli are sorted by their correct answers, so that the same index means the same side at every
    strength. Raises InputError if a strength is not a number above 0.
    """
    try:
        strength = [float(design.stimulus(name).levels[block.strength]) for name in block.stimuli]
    except (KeyError, ValueError) as wrong:
        raise InputError(f"block {block.name!r}: expected a number for the factor {block.strength!r}") from wrong
    if not all(0 < one < np.inf for one in strength):
        raise InputError(f"block {block.name!r}: expected strengths above 0, got {strength}")
    steps = sorted(set(strength))
    order = sorted(range(len(strength)), key=lambda index: correct_answer(design, block, block.stimuli[index]))
    return [tuple(block.stimuli[i] for i in order if strength[i] == step) for step in steps], np.array(steps)


def check_sides(design: Design, block: Block) -> None:
    """Raise InputError if the strength gives the correct answer away, or if one answer is correct in all trials."""
    groups, strength = stimulus_levels(design, block)
    if len(groups) < 3:
        raise InputError(f"block {block.name!r}: expected three strengths or more, got {strength.tolist()}")
    rights = [[correct_answer(design, block, name) for name in group] for group in groups]
    if any(right != rights[0] for right in rights):
        raise InputError(
            f"block {block.name!r}: expected the same correct answers at every strength, got "
            f"{', '.join(rights[0])} at the lowest strength and others elsewhere; list each strength once per answer"
        )
    catches = [name for extra in block.extras if extra.role == "catch" for name in extra.stimuli]
    if len({*rights[0], *(correct_answer(design, block, name) for name in catches)}) < 2:
        raise InputError(
            f"block {block.name!r}: expected trials with different correct answers, got {rights[0][0]!r} in all; "
            "list each strength once for every answer (left and right, first and second), or add catch trials"
        )


def correct_answer(design: Design, block: Block, name: str) -> str:
    """Correct answer to the first question of a block about a stimulus; empty if it has none."""
    stimulus = design.stimulus(name)
    return right_answer(design.question(block.questions[0]), stimulus, {**stimulus.levels, **block.levels})


Item = TypeVar("Item")


def balanced_latin_square(count: int) -> list[list[int]]:
    """Orders of `count` conditions that balance position and immediate carry-over.

    The design of Williams (1949): each row is 0, 1, n-1, 2, n-2, ... plus the row number, so `count` rows; for an odd
    count above 1 the reversed rows are added.
    """
    within(count, "conditions of a Latin square", 1)
    first = [(place + 1) // 2 if place % 2 else (count - place // 2) % count for place in range(count)]
    square = [[(value + row) % count for value in first] for row in range(count)]
    return square + [row[::-1] for row in square] if count % 2 and count > 1 else square


def constrained_shuffle(
    items: Sequence[Item], *, rng: np.random.Generator, longest_run: int = 0, tries: int = 20_000
) -> list[Item]:
    """Random order in which no item stands more than `longest_run` times in a row (0: no limit).

    All such orders are equally likely (rejection sampling). Raises InputError if no order keeps the limit, or none of
    `tries` shuffles does.
    """
    if longest_run:
        item, most = Counter(items).most_common(1)[0]
        others = len(items) - most
        if most > longest_run * (others + 1):
            raise InputError(
                f"order: expected runs of at most {longest_run}, got {most} trials of {item!r} among {others} others;"
                " allow longer runs or add other stimuli"
            )
    for _ in range(tries):
        order = [items[i] for i in rng.permutation(len(items))]
        if not longest_run or longest_run_of(order) <= longest_run:
            return order
    raise InputError(
        f"order: expected runs of at most {longest_run}, none of {tries} shuffles has them; allow"
        ' longer runs, or list the order (order = "fixed")'
    )


def longest_run_of(items: Sequence[object]) -> int:
    """Largest number of equal items in a row."""
    return max((len(list(run)) for _, run in groupby(items)), default=0)


MOST_TRIALS = 100_000
"""Largest number of trials of all participants in a plan."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One stimulus for one participant."""

    code: str
    """Identifier that does not reveal the condition, such as ``p03-t017``."""
    participant: int
    number: int
    """Position within all sessions of the participant, from 1."""
    block: str
    group: str
    repetition: int
    """Number of this presentation of the stimulus in its block, from 1."""
    stimulus: str
    """Name of the stimulus, for the presenter only. Empty in an adaptive block, where it is chosen before the trial."""
    questions: tuple[str, ...]
    """Questions in the order of asking."""
    scored: bool = True
    """Whether the trial is analysed."""
    levels: Mapping[str, str] = field(default_factory=dict[str, str])
    """Levels of the stimulus and of the block."""
    role: str = "test"
    """"test", or the role of an `Extra`."""
    variant: int = 0
    """Index of the stimulus among those of equal strength, in an adaptive block."""
    wait_s: float = 0.0
    """Time before the stimulus, in s."""
    session: int = 1
    """Session number, from 1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """A design and the trials drawn for it."""

    design: Design
    trials: tuple[Trial, ...]
    """Trials of all participants, in the order of presentation."""
    digest: str = ""
    """Digest of the content when the plan was drawn; every log states the digest of its plan."""
    drives: Mapping[str, str] = field(default_factory=dict[str, str])
    """SHA-256 of each drive by its source; empty if the drives did not exist when the plan was drawn."""

    def __post_init__(self) -> None:
        if not self.digest:
            digest = digest_of(asdict(self.design), [asdict(trial) for trial in self.trials], self.drives)
            object.__setattr__(self, "digest", digest)

    def trial(self, code: str) -> Trial:
        """Trial with this code; raises InputError if there is none."""
        for trial in self.trials:
            if trial.code == code:
                return trial
        raise InputError(f"trial: expected the code of one of {len(self.trials)} trials, got {code!r}")

    def of(self, participant: int) -> tuple[Trial, ...]:
        """Trials of one participant; raises InputError if none were drawn for this number."""
        found = tuple(trial for trial in self.trials if trial.participant == participant)
        if not found:
            raise InputError(
                f"participant: expected 1 to {self.design.participants}, got {participant}; plan for more participants"
            )
        return found


def digest_of(
    design: Mapping[str, Any], trials: Sequence[Mapping[str, Any]], drives: Mapping[str, str] | None = None
) -> str:
    """First 16 hexadecimal digits of the SHA-256 over the JSON of a design, its trials and drives."""
    content = [dict(design), list(trials), *([dict(drives)] if drives else [])]
    # Sorted keys: the digest depends on the content, not on the order of keys in a file.
    return sha256(dumps(content, sort_keys=True).encode()).hexdigest()[:16]


def draw_plan(design: Design, *, drives: Mapping[str, str] | None = None) -> Plan:
    """Draw all trials from the seed of the design; `drives` gives the SHA-256 of each drive for the plan.

    Each participant has an independent random stream: a larger number of participants does not change the others'
    trials. Pairs in either order become two stimuli, see `both_orders`. Raises InputError if a participant who always
    gives the same answer would always be correct in a block with a strength, or the plan has more than `MOST_TRIALS`
    trials.
    """
    whole = _expand_pairs(design)
    trials_each = sum(
        block.repetitions * (1 if block.adaptive else len(block.stimuli))
        + sum(len(extra.stimuli) * extra.repetitions for extra in block.extras)
        for block in whole.blocks
    )
    if trials_each * whole.participants > MOST_TRIALS:
        raise InputError(
            f"study: expected a plan of at most {MOST_TRIALS} trials, got {whole.participants} participants with "
            f"{trials_each} trials each; reduce participants or repetitions"
        )
    for block in whole.blocks:
        if block.strength:
            check_sides(whole, block)
    trials = tuple(trial for number in range(1, whole.participants + 1) for trial in _draw_session(whole, number))
    return Plan(design=whole, trials=trials, drives=dict(drives or {}))


def block_order(design: Design, participant: int) -> list[Block]:
    """Blocks of one participant: counterbalanced groups are permuted by a row of a balanced Latin square.

    Groups that each belong to one session exchange their sessions too. If a group has blocks in several sessions, the
    groups are permuted within each session.
    """
    groups = list(dict.fromkeys(block.group for block in design.blocks))
    places = [group for group in groups if group in design.counterbalanced]
    sessions = {group: {block.session for block in design.blocks if block.group == group} for group in groups}
    moved: dict[str, int] = {}
    if places:
        square = balanced_latin_square(len(places))
        order = [places[number] for number in square[(participant - 1) % len(square)]]
        if all(len(sessions[group]) == 1 for group in places):
            moved = {group: min(sessions[place]) for group, place in zip(order, places, strict=True)}
        row = iter(order)
        groups = [next(row) if group in places else group for group in groups]
    found = [
        replace(block, session=moved.get(group, block.session))
        for group in groups
        for block in design.blocks
        if block.group == group
    ]
    return sorted(found, key=lambda block: block.session)


def _draw_session(design: Design, participant: int) -> list[Trial]:
    rng = np.random.default_rng([design.seed, participant])
    trials: list[Trial] = []
    for block in block_order(design, participant):
        seen: dict[str, int] = {}
        for place in _draw_positions(design, block, rng):
            seen[place.stimulus] = seen.get(place.stimulus, 0) + 1
            number = len(trials) + 1
            levels = design.stimulus(place.stimulus).levels if place.stimulus else {}
            trials.append(
                Trial(
                    code=f"p{participant:02d}-t{number:03d}",
                    participant=participant,
                    number=number,
                    block=block.name,
                    group=block.group,
                    repetition=seen[place.stimulus],
                    stimulus=place.stimulus,
                    levels={**levels, **block.levels},
                    questions=_questions_order(block, place.questions, rng),
                    scored=block.scored and _is_scored(design, block, place),
                    role=place.role,
                    variant=place.variant,
                    wait_s=round(float(rng.uniform(*block.jitter_s)), 3) if block.jitter_s[1] else 0.0,
                    session=block.session,
                )
            )
    return trials


@dataclass(frozen=True, slots=True, kw_only=True)
class _Position:
    """Content of one position in a block."""

    stimulus: str
    questions: tuple[str, ...]
    role: str = "test"
    variant: int = 0


def _draw_positions(design: Design, block: Block, rng: np.random.Generator) -> list[_Position]:
    if block.adaptive:
        drawn = _draw_variants(design, block, rng)
        places = [_Position(stimulus="", questions=block.questions, variant=variant) for variant in drawn]
    else:
        places = [_Position(stimulus=name, questions=block.questions) for name in _draw_stimuli(block, rng)]
    extras = [
        _Position(stimulus=name, questions=extra.questions or block.questions, role=extra.role)
        for extra in block.extras
        for name in extra.stimuli * extra.repetitions
    ]
    for index in rng.permutation(len(extras)) if extras else ():
        places.insert(int(rng.integers(1, len(places) + 1)), extras[index])
    return places


def _questions_order(block: Block, questions: tuple[str, ...], rng: np.random.Generator) -> tuple[str, ...]:
    return tuple(questions[i] for i in rng.permutation(len(questions))) if block.shuffle_questions else questions


def _draw_variants(design: Design, block: Block, rng: np.random.Generator) -> list[int]:
    """Index of the stimulus of equal strength for each trial of an adaptive block: balanced, in random order."""
    many = len(stimulus_levels(design, block)[0][0])
    if many == 1:
        return [0] * block.repetitions
    rounds = -(-block.repetitions // many)
    return constrained_shuffle(list(range(many)) * rounds, rng=rng, longest_run=block.longest_run)[: block.repetitions]


def _is_scored(design: Design, block: Block, place: _Position) -> bool:
    """Whether a trial is analysed.

    d' of yes-no and same-different questions needs the false alarms of catch trials, and the threshold of an adaptive
    block needs catch trials and further trials at its levels.
    """
    kind = design.question(place.questions[0]).kind if place.questions else ""
    if place.role == "test" or (place.role == "catch" and kind in ("yes-no", "same-different")):
        return True
    fitted = block.adaptive and place.questions[:1] == block.questions[:1]
    return bool(fitted) and (place.role == "catch" or place.stimulus in block.stimuli)


def _expand_pairs(design: Design) -> Design:
    """Design in which each pair in either order is replaced by two stimuli, in the blocks too."""
    names = {one.name: tuple(each.name for each in both_orders(one)) for one in design.stimuli}

    def all_of(asked: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(name for each in asked for name in names[each])

    blocks = tuple(
        replace(
            block,
            stimuli=all_of(block.stimuli),
            extras=tuple(replace(extra, stimuli=all_of(extra.stimuli)) for extra in block.extras),
        )
        for block in design.blocks
    )
    stimuli = tuple(each for one in design.stimuli for each in both_orders(one))
    return replace(design, stimuli=stimuli, blocks=blocks)


def _draw_stimuli(block: Block, rng: np.random.Generator) -> list[str]:
    if block.order == "fixed":
        return list(block.stimuli) * block.repetitions
    if block.order == "shuffle":
        return constrained_shuffle(list(block.stimuli) * block.repetitions, rng=rng, longest_run=block.longest_run)
    order: list[str] = []
    for _ in range(block.repetitions):
        part = constrained_shuffle(block.stimuli, rng=rng)
        # Within a round each stimulus comes once: repeats can occur only between two rounds.
        while block.longest_run == 1 and len(set(block.stimuli)) > 1 and order and order[-1] == part[0]:
            part = constrained_shuffle(block.stimuli, rng=rng)
        order += part
    return order
