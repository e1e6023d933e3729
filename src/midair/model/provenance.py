"""Origin of data and the processing steps applied to them."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from midair.model.reprs import clipped, clipped_list, counted, from_source, summary

Setting = str | int | float | bool | None | tuple["Setting", ...]
"""Type of a setting of a step: everything that JSON stores without loss of type."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One processing step with its settings."""

    stage: str
    settings: Mapping[str, Setting] = field(default_factory=dict[str, Setting])

    def __post_init__(self) -> None:
        object.__setattr__(self, "settings", MappingProxyType(dict(self.settings)))

    def __repr__(self) -> str:
        settings = clipped_list((f"{name}={value}" for name, value in self.settings.items()), letters=36)
        return summary(self, clipped(self.stage) + (f": {settings}" if settings else ""))


@dataclass(frozen=True, slots=True, kw_only=True)
class Provenance:
    """Source, notes and processing steps of data."""

    source: str = "unknown"
    """Device or file that the data came from, such as ``virtual:towel`` or a file's name."""
    simulated: bool = False
    """True if any part was simulated; everything derived from simulated data is simulated."""
    notes: Mapping[str, str] = field(default_factory=dict[str, str])
    """Notes of the user: object, surface, speed, operator."""
    steps: tuple[Step, ...] = ()
    """Processing steps, first to last."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "notes", MappingProxyType(dict(self.notes)))

    def __repr__(self) -> str:
        stages = clipped_list(step.stage for step in self.steps)
        return summary(
            self,
            from_source(self.source),
            f"{counted(len(self.steps), 'step')}: {stages}" if stages else "no steps",
            f"{counted(len(self.notes), 'note')}: {clipped_list(self.notes)}" if self.notes else "",
            simulated=self.simulated,
        )

    def then(self, stage: str, settings: Mapping[str, Setting], *, simulated: bool = False) -> "Provenance":
        """Add a step and return the new provenance."""
        step = Step(stage=stage, settings=settings)
        return replace(self, steps=(*self.steps, step), simulated=self.simulated or simulated)

    @property
    def played(self) -> bool:
        """True if the data are a re-recording of a playback."""
        return any(step.stage == "play" for step in self.steps)

    def last(self, stage: str) -> Mapping[str, Setting]:
        """Settings of the last step of that name; empty if there is none."""
        return next((step.settings for step in reversed(self.steps) if step.stage == stage), {})
