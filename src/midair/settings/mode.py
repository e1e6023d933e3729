"""Settings by name: the paper's way, the best one, the quick one."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Literal

from midair.model import Acoustics, Medium
from midair.settings.settings import Settings
from midair.solvers import Glide, Guard

Mode = Literal["paper", "best", "quick", "finest"]
"""The paper's own way; the best for its time; the best with fewer iterations; the best with a quiet palm around it."""


def paper_mode() -> Settings:
    """As the paper describes it: half-wave rectification, 1 kHz, the control points alone (4.1, 4.2, 5.2)."""
    return Settings()


def best_mode() -> Settings:
    """A slow bias in place of rectification, 4 kHz, a guard around the square, the recording solved as a whole.

    What interpolation mixes between neighbouring cells, and what hold and transducers make quieter, is undone before.
    The air is that of a laboratory, 22 degrees Celsius and 50 % humidity, not the paper's of 14.
    """
    return Settings().but(
        # At 4 kHz frames are so alike that marks far apart and few iterations do: an error a little larger than that of
        # many, but phases that keep still, of which the skin gets more.
        method=Glide(coarse=512, near=0.2, smooth=6, wide=32, smooth_wide=20, tolerance=1e-2),
        fit="windows",
        mapping="slow-bias",
        rate=4000.0,
        precompensate=True,
        interpolate="pressure",
        decouple=True,
        guard=Guard(margin=25e-3, pitch=6e-3, ceiling=0.3),
        acoustics=Acoustics(medium=Medium.at(temperature=22.0, humidity=0.5)),
    )


def quick_mode() -> Settings:
    """The best mode with fewer iterations."""
    return best_mode().but(method=Glide(coarse=512, near=0.2, smooth=4, wide=32, smooth_wide=20, tolerance=1e-2))


def finest_mode() -> Settings:
    """The best mode with the whole palm quiet: 2 to 8 dB more displacement of the worst skin for a third more time.

    The guard stays, since a mean square on the palm does not mind a single spot beside the square.
    """
    return best_mode().but(quiet_palm=0.1)


MODES: Mapping[Mode, Callable[[], Settings]] = MappingProxyType(
    {"paper": paper_mode, "best": best_mode, "quick": quick_mode, "finest": finest_mode}
)
"""Settings by name."""


def beside_paper(mode: Mode, paper: Settings, other: Settings | None = None) -> dict[str, Settings]:
    """The paper's mode and another one by their names, paper first; the paper's alone if that is the other one.

    A mode that is taken by its name is put into the air of the paper's, since both are played in one room.

    Parameters
    ----------
    mode : {"paper", "best", "quick", "finest"}
        The other one.
    paper : Settings
        Of the paper's mode.
    other : Settings, optional
        In place of the other mode's own.
    """
    return (
        {"paper": paper}
        if mode == "paper"
        else {"paper": paper, mode: other or MODES[mode]().but(acoustics=paper.acoustics)}
    )


def coarser(settings: Settings, points: int) -> Settings:
    """The same with fewer control points over the same square, for a quick look."""
    grid = settings.target.grid
    pitch = grid.pitch * (grid.rows - 1) / (points - 1)
    return settings.but(grid=replace(grid, rows=points, columns=points, pitch=pitch))
