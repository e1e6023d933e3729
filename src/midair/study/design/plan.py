"""The trials of every participant, drawn before the first one comes."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from hashlib import sha256
from json import dumps
from typing import Any

import numpy as np

from midair.errors import InputError
from midair.study.design.blocks import Block, Design
from midair.study.design.order import balanced_latin_square, constrained_shuffle


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One stimulus for one participant.

    Attributes
    ----------
    code : str
        Names the trial and gives nothing away, such as ``p03-t017``.
    participant, number : int
        Both from 1 on; the number counts over the whole session.
    block, group : str
        Where it belongs.
    repetition : int
        How often the stimulus has come in the block, this time included.
    stimulus : str
        What is presented; for the presenter only. Empty in an adaptive block: chosen when its time comes.
    levels : mapping of str to str
        Levels of the stimulus and of the block.
    questions : tuple of str
        Asked in this order.
    scored : bool
        Whether it is analysed.
    """

    code: str
    participant: int
    number: int
    block: str
    group: str
    repetition: int
    stimulus: str
    questions: tuple[str, ...]
    scored: bool = True
    levels: Mapping[str, str] = field(default_factory=dict[str, str])


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """A design and the trials drawn for it.

    Attributes
    ----------
    design : Design
        With its seed.
    trials : tuple of Trial
        Trials of all participants, in the order of presentation.
    digest : str
        Names the plan by its content when it was drawn: a log says which plan it followed.
    """

    design: Design
    trials: tuple[Trial, ...]
    digest: str = ""

    def __post_init__(self) -> None:
        if not self.digest:
            digest = digest_of(asdict(self.design), [asdict(trial) for trial in self.trials])
            object.__setattr__(self, "digest", digest)

    def trial(self, code: str) -> Trial:
        """The trial of this code.

        Raises
        ------
        InputError
            If no trial has it.
        """
        for trial in self.trials:
            if trial.code == code:
                return trial
        raise InputError(f"trial: expected the code of one of {len(self.trials)} trials, got {code!r}")

    def of(self, participant: int) -> tuple[Trial, ...]:
        """Trials of one participant.

        Raises
        ------
        InputError
            If none were drawn for this number.
        """
        found = tuple(trial for trial in self.trials if trial.participant == participant)
        if not found:
            raise InputError(
                f"participant: expected 1 to {self.design.participants}, got {participant}; plan for more participants"
            )
        return found


def digest_of(design: Mapping[str, Any], trials: Sequence[Mapping[str, Any]]) -> str:
    """Sixteen hexadecimal digits of SHA-256 over the JSON of a design and its trials."""
    # Sorted, so that only content makes a difference and not the order of keys in a file.
    return sha256(dumps([dict(design), list(trials)], sort_keys=True).encode()).hexdigest()[:16]


def draw_plan(design: Design) -> Plan:
    """Draw all trials from the seed of the design.

    Each participant has a stream of random numbers of their own: planning for more people leaves the others as they
    were.
    """
    trials = tuple(trial for number in range(1, design.participants + 1) for trial in _session(design, number))
    return Plan(design=design, trials=trials)


def block_order(design: Design, participant: int) -> list[Block]:
    """Blocks of one participant: counterbalanced groups change places by a row of the Latin square."""
    groups = list(dict.fromkeys(block.group for block in design.blocks))
    moving = [group for group in groups if group in design.counterbalanced]
    if moving:
        square = balanced_latin_square(len(moving))
        row = iter(square[(participant - 1) % len(square)])
        groups = [moving[next(row)] if group in moving else group for group in groups]
    return [block for group in groups for block in design.blocks if block.group == group]


def _session(design: Design, participant: int) -> list[Trial]:
    rng = np.random.default_rng([design.seed, participant])
    trials: list[Trial] = []
    for block in block_order(design, participant):
        seen: dict[str, int] = {}
        for name in [""] * block.repetitions if block.adaptive else _stimuli(block, rng):
            seen[name] = seen.get(name, 0) + 1
            number = len(trials) + 1
            trials.append(
                Trial(
                    code=f"p{participant:02d}-t{number:03d}",
                    participant=participant,
                    number=number,
                    block=block.name,
                    group=block.group,
                    repetition=seen[name],
                    stimulus=name,
                    levels={**(design.stimulus(name).levels if name else {}), **block.levels},
                    questions=block.questions,
                    scored=block.scored,
                )
            )
    return trials


def _stimuli(block: Block, rng: np.random.Generator) -> list[str]:
    if block.order == "fixed":
        return list(block.stimuli) * block.repetitions
    if block.order == "shuffle":
        return constrained_shuffle(list(block.stimuli) * block.repetitions, rng=rng, longest_run=block.longest_run)
    order: list[str] = []
    for _ in range(block.repetitions):
        part = constrained_shuffle(block.stimuli, rng=rng)
        # Within a round none comes twice: only where two rounds meet can it follow itself.
        while block.longest_run == 1 and len(set(block.stimuli)) > 1 and order and order[-1] == part[0]:
            part = constrained_shuffle(block.stimuli, rng=rng)
        order += part
    return order
