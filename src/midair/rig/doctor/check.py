"""One thing that a check-up looked at."""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One thing that was looked at.

    Attributes
    ----------
    subject : str
        What.
    state : {"ok", "missing", "broken"}
        "missing" is something optional that is not there.
    found : str
        What was seen.
    advice : str
        One line of what to do; empty when there is nothing to do.
    """

    subject: str
    state: Literal["ok", "missing", "broken"]
    found: str
    advice: str = ""
