"""Result of one check."""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """Result of one check."""

    subject: str
    state: Literal["ok", "missing", "broken"]
    """"missing" stands for something optional."""
    found: str
    advice: str = ""
    """One line of advice; empty if there is nothing to do."""
