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


def ok(subject: str, found: str, advice: str = "") -> Check:
    """Return a result without problem."""
    return Check(subject=subject, state="ok", found=found, advice=advice)


def missing(subject: str, found: str, advice: str = "") -> Check:
    """Return the lack of something optional."""
    return Check(subject=subject, state="missing", found=found, advice=advice)


def broken(subject: str, found: str, advice: str = "") -> Check:
    """Return a problem."""
    return Check(subject=subject, state="broken", found=found, advice=advice)
