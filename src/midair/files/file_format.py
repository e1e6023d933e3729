"""A file format of recordings, and the information that it cannot store."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from midair.files.opened_take import ImportOptions, OpenedTake
from midair.model import Calibration, Recording

Lost = Literal[
    "calibration", "pressure", "provenance", "sensor", "scale", "rate", "channels", "waveform", "band", "sign", "length"
]
"""Kinds of lost information, as keys for programs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FormatLoss:
    """Information that a file does not contain, or that only midair can read from it."""

    what: Lost
    text: str
    """Description in one sentence."""

    def __str__(self) -> str:
        return self.text


def calibration_lost(calibration: Calibration | None, form: str) -> tuple[FormatLoss, ...]:
    """Loss report of a format that cannot store a calibration."""
    if calibration is None:
        return ()
    advice = "save_calibration() writes it to a file of its own"
    return (FormatLoss(what="calibration", text=f"{form} holds no calibration: it was left out; {advice}."),)


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    """A file format of recordings, registered under the endings of its names."""

    name: str
    read: Callable[[Path, ImportOptions], OpenedTake]
    """Read a file with what the user states about it."""
    write: Callable[[Recording, Path, Calibration | None], tuple[FormatLoss, ...]] | None = None
    """Write a recording; returns what the format cannot store. None if it is only read."""
    memory: float = 0
    """Least number of bytes that reading takes for each byte of the file; 0 if it is read in parts."""
    effect: bool = False
    """Whether it holds effects that are rendered, so that reading does not return the samples that were written."""
