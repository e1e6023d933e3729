"""Origin of data and the processing steps applied to them; one-line summaries with units for `repr`."""

import copyreg
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike


def summary(value: object, *parts: str, simulated: bool = False) -> str:
    """``<Noun part, part, SIMULATED>``; empty parts are left out."""
    said = [*filter(None, parts), *(["SIMULATED"] if simulated else [])]
    return f"<{type(value).__name__} {', '.join(said)}>"


class Brief:
    """Base of dataclasses with a `repr` of one line: the axes of the first array, and all numbers and texts."""

    __slots__ = ()

    def __repr__(self) -> str:
        known: Any = self
        pairs = [(one.name, getattr(self, one.name)) for one in fields(known)]
        shapes = [" x ".join(map(str, value.shape)) for _, value in pairs if isinstance(value, np.ndarray)]
        plain = [f"{name} {clipped(str(each))}" for name, each in pairs if isinstance(each, str | float | int)]
        return summary(self, *shapes[:1], *plain)


def clipped(text: str, most: int = 30) -> str:
    """`text` on one line of at most `most` characters; the middle is removed, since names differ at their ends."""
    line = "".join(letter if letter.isprintable() else " " for letter in text)
    half = (most - 1) // 2
    return line if len(line) <= most else f"{line[:half]}…{line[-half:]}"


def clipped_list(words: Iterable[str], *, most: int = 4, letters: int = 20) -> str:
    """The first words, and the number of the others: ``calibrate, cut and 3 more``."""
    all_words = [clipped(word, letters) for word in words]
    more = len(all_words) - most
    return ", ".join(all_words[:most]) + (f" and {more} more" if more > 0 else "")


def counted(number: int, noun: str) -> str:
    """``1 frame``, ``2 frames``."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def short(value: float) -> str:
    """Three significant digits, or a whole number if that is as short: ``0.0314``, ``2849``, ``1.2e+07``."""
    return f"{value:.0f}" if 999.5 <= abs(value) < 1e6 else f"{value + 0.0:.3g}"


def span(values: ArrayLike, unit: str = "") -> str:
    """``-0.31 to 0.42 V``, or ``1 V`` if all values are equal."""
    low, high = (short(float(end)) for end in (np.min(values), np.max(values)))
    return (low if low == high else f"{low} to {high}") + (f" {unit}" if unit else "")


def frames_and_duration(frames: int, rate: float, provenance: "Provenance | None" = None) -> str:
    """``1280 frames at 1000 Hz, 1.28 s``, and the lead of a target or a drive by its provenance."""
    first = frames_without_lead(provenance, frames, rate).start if provenance else 0
    lead = f" and {first / rate:.4g} s of lead at either end" if first else ""
    return f"{counted(frames, 'frame')} at {rate:g} Hz, {(frames - 2 * first) / rate:.4g} s{lead}"


def from_source(source: str) -> str:
    """``from virtual:towel``."""
    return f"from {clipped(source)}"


Setting = str | int | float | bool | None | tuple["Setting", ...]
"""Type of a setting of a step: everything that JSON stores without loss of type."""


def _as_view(known: dict[Any, Any]) -> MappingProxyType[Any, Any]:
    return MappingProxyType(known)


def _as_dict(view: MappingProxyType[Any, Any]) -> tuple[Any, ...]:
    return _as_view, (dict(view),)


# Data is copied, and passed between processes.
copyreg.pickle(MappingProxyType, _as_dict)


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

    def follows(self, origin: "Provenance") -> bool:
        """True if the data may be made of the data of `origin`: the same source, and all steps of it first."""
        return self.source == origin.source and self.steps[: len(origin.steps)] == origin.steps

    @property
    def played(self) -> bool:
        """True if the data are a re-recording of a playback."""
        return any(step.stage == "play" for step in self.steps)

    def last(self, stage: str) -> Mapping[str, Setting]:
        """Settings of the last step of that name; empty if there is none."""
        return next((step.settings for step in reversed(self.steps) if step.stage == stage), {})


def frames_without_lead(provenance: Provenance, frames: int, rate: float) -> slice:
    """The frames without the lead, from the provenance of data made from a pressure."""
    seconds = provenance.last("lead").get("lead_s")
    pad = round(float(seconds) * rate) if isinstance(seconds, int | float) else 0
    return slice(pad, frames - pad) if 2 * pad < frames else slice(0, frames)
