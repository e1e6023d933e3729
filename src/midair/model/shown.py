"""Things that can draw themselves, in Python and in notebooks."""

from dataclasses import fields
from importlib import import_module
from typing import Any

import numpy as np

from midair.array_types import Array


class Shown:
    """Base of what a stage returns: `plot` returns a Matplotlib figure, and a notebook shows it under its text."""

    __slots__ = ()

    def plot(self) -> Any:
        """Draw it, small; see `figures.figure_of`."""
        return self._part("figures").figure_of(self)

    def _repr_html_(self) -> str:
        return self._part("figures").html_of(self)

    def _part(self, name: str) -> Any:
        # By its name, since figures and files are made of models.
        return import_module(f"midair.{name}")


class Frames(Shown):
    """Base of dataclasses whose first field holds frames, at a `rate` in Hz."""

    __slots__ = ()
    rate: float

    @property
    def frames(self) -> int:
        """Number of frames."""
        known: Any = self
        return len(getattr(self, fields(known)[0].name))

    @property
    def time(self) -> Array:
        """Time of each frame, shape (frame,), in s."""
        return np.arange(self.frames) / self.rate
