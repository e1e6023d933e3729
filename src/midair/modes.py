"""The two ways to reproduce that are always put side by side: the paper's, and the best that midair can."""

from dataclasses import replace

from midair.flow import Settings
from midair.solvers import Guard


def paper_mode() -> Settings:
    """As the paper describes it: half-wave rectification, 1 kHz, the control points alone (4.1, 4.2, 5.2).

    The solver is the paper's Levenberg-Marquardt in its cheaper form, in the modes of the field above .5 % of the
    strongest.
    """
    return Settings(method="exact")


def best_mode() -> Settings:
    """A slow bias in place of rectification, 4 kHz, a guard around the square, phases that move slowly.

    What interpolation mixes between neighbouring cells, and what hold and transducers make quieter, is undone before.
    """
    return Settings(
        method="fast",
        mapping="slow-bias",
        rate=4000.0,
        precompensate=True,
        interpolate="pressure",
        decouple=True,
        guard=Guard(margin=25e-3, pitch=6e-3, ceiling=0.6),
        smooth=0.2,
    )


def coarser(settings: Settings, points: int) -> Settings:
    """The same with fewer control points over the same square, for a quick look."""
    pitch = settings.grid.pitch * (settings.grid.rows - 1) / (points - 1)
    return replace(settings, grid=replace(settings.grid, rows=points, columns=points, pitch=pitch))
