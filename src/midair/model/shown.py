"""Things that can draw themselves, in Python and in notebooks."""

from importlib import import_module
from typing import Any


class Shown:
    """Base of what a stage returns: `plot` returns a Matplotlib figure, and a notebook shows it under its text."""

    __slots__ = ()

    def plot(self) -> Any:
        """Draw it, small; see `figures.figure_of`."""
        return self._figures().figure_of(self)

    def _repr_html_(self) -> str:
        return self._figures().html_of(self)

    def _figures(self) -> Any:
        # By its name, since figures are made of models.
        return import_module("midair.figures")
