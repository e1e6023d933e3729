"""What a format cannot hold of a recording, said by whoever writes it."""

from dataclasses import dataclass
from typing import Literal

from midair.model import Calibration

Lost = Literal[
    "calibration", "pressure", "provenance", "sensor", "scale", "rate", "channels", "waveform", "band", "sign", "length"
]
"""What can be lost: a word that a program can look for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FormatLoss:
    """One thing that a file does not hold, or that only midair can read from it.

    Attributes
    ----------
    what : str
        A word of `Lost`.
    text : str
        A sentence.
    """

    what: Lost
    text: str

    def __str__(self) -> str:
        return self.text


def calibration_lost(calibration: Calibration | None, form: str) -> tuple[FormatLoss, ...]:
    """What a format without a place for a calibration owes."""
    if calibration is None:
        return ()
    advice = "save_calibration() writes it to a file of its own"
    return (FormatLoss(what="calibration", text=f"{form} holds no calibration: it was left out; {advice}."),)
