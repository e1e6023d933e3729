"""Information that a file format cannot store."""

from dataclasses import dataclass
from typing import Literal

from midair.model import Calibration

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
