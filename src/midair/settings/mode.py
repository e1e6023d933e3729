"""Named sets of settings: paper, best, quick and finest."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Literal

from midair.model import Acoustics, Medium
from midair.settings.settings import Settings
from midair.solvers import Glide, Guard

Mode = Literal["paper", "best", "quick", "finest"]
"""Names: the paper's settings; the default; best with fewer iterations; best with a quiet palm."""


def paper_mode() -> Settings:
    """Return the settings of the paper: half-wave rectification, 1 kHz, control points alone (4.1, 4.2, 5.2)."""
    return Settings()


def best_mode() -> Settings:
    """Return the default settings: slow bias, 4 kHz, guard ring, all frames solved together (method glide).

    The target is corrected for the mixing of neighbouring cells and for the attenuation by frame hold and transducers.
    The air is a laboratory's, 22 degrees Celsius and 50 % humidity, instead of the paper's 14 degrees.
    """
    return Settings().but(
        # At 4 kHz successive frames are so alike that few marks and few iterations suffice: the error is slightly
        # larger, but the phases change less, and more pressure reaches the skin.
        method=Glide(coarse=512, near=0.2, smooth=6, wide=32, smooth_wide=20, tolerance=1e-2),
        fit="windows",
        mapping="slow-bias",
        rate=4000.0,
        precompensate=True,
        interpolate="pressure",
        decouple=True,
        guard=Guard(margin=25e-3, pitch=6e-3, ceiling=0.3),
        acoustics=Acoustics(medium=Medium.at()),
    )


def quick_mode() -> Settings:
    """Return the best mode with fewer iterations."""
    return best_mode().but(method=Glide(coarse=512, near=0.2, smooth=4, wide=32, smooth_wide=20, tolerance=1e-2))


def finest_mode() -> Settings:
    """Return the best mode with a quiet palm: 2 to 8 dB more displacement at the worst skin point, a third more time.

    The guard stays, since a mean square over the palm hardly penalises a single spot beside the square.
    """
    return best_mode().but(quiet_palm=0.1)


MODES: Mapping[Mode, Callable[[], Settings]] = MappingProxyType(
    {"paper": paper_mode, "best": best_mode, "quick": quick_mode, "finest": finest_mode}
)
"""Function that makes the settings of each mode."""


def with_paper_mode(mode: Mode, paper: Settings, other: Settings | None = None) -> dict[str, Settings]:
    """Return the settings of the paper's mode and of another mode by name, paper first.

    `mode` "paper" returns the first alone. Without `other`, the other mode takes the air of the first, since both are
    played in the same room.
    """
    return (
        {"paper": paper}
        if mode == "paper"
        else {"paper": paper, mode: other or MODES[mode]().but(acoustics=paper.acoustics)}
    )


def with_fewer_points(settings: Settings, points: int) -> Settings:
    """Return the settings with `points` rows and columns of control points over the same square, for a preview."""
    grid = settings.target.grid
    pitch = grid.pitch * (grid.rows - 1) / (points - 1)
    return settings.but(grid=replace(grid, rows=points, columns=points, pitch=pitch))
