"""Where data came from and what was done to it."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from midair.model.reprs import came_from, clipped, clipped_list, counted, told

Setting = str | int | float | bool | None | tuple["Setting", ...]
"""What a setting of a step can be: everything that JSON can hold without losing its type."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One thing that was done, with the settings it was done with."""

    stage: str
    settings: Mapping[str, Setting] = field(default_factory=dict[str, Setting])

    def __post_init__(self) -> None:
        object.__setattr__(self, "settings", MappingProxyType(dict(self.settings)))

    def __repr__(self) -> str:
        settings = clipped_list((f"{name}={value}" for name, value in self.settings.items()), letters=36)
        return told(self, clipped(self.stage) + (f": {settings}" if settings else ""))


@dataclass(frozen=True, slots=True, kw_only=True)
class Provenance:
    """The life of a piece of data: its source, its notes, and every step since.

    Attributes
    ----------
    source : str
        The device or file that it came from, such as ``virtual:towel`` or a file's name.
    simulated : bool
        Whether any part of it was simulated; everything made from simulated data is simulated.
    notes : mapping of str to str
        What people wrote down: object, surface, speed, operator.
    steps : tuple of Step
        What was done, first to last.
    """

    source: str = "unknown"
    simulated: bool = False
    notes: Mapping[str, str] = field(default_factory=dict[str, str])
    steps: tuple[Step, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "notes", MappingProxyType(dict(self.notes)))

    def __repr__(self) -> str:
        stages = clipped_list(step.stage for step in self.steps)
        return told(
            self,
            came_from(self.source),
            f"{counted(len(self.steps), 'step')}: {stages}" if stages else "no steps",
            f"{counted(len(self.notes), 'note')}: {clipped_list(self.notes)}" if self.notes else "",
            simulated=self.simulated,
        )

    def then(self, stage: str, settings: Mapping[str, Setting], *, simulated: bool = False) -> "Provenance":
        """The same life, one step on."""
        step = Step(stage=stage, settings=settings)
        return replace(self, steps=(*self.steps, step), simulated=self.simulated or simulated)

    @property
    def played(self) -> bool:
        """Whether the data are a re-recording: something was played to get them."""
        return any(step.stage == "play" for step in self.steps)

    def last(self, stage: str) -> Mapping[str, Setting]:
        """The settings of the last step of that name; none if there was none."""
        return next((step.settings for step in reversed(self.steps) if step.stage == stage), {})
