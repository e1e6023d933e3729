"""The stages before and at the solver with the defaults of the command line: the best mode, unless another is named."""

from dataclasses import replace
from typing import Any

from midair import solvers, targets
from midair.errors import InputError
from midair.model import (
    Acoustics,
    AmplitudeFrames,
    ControlGrid,
    Medium,
    PressureFrames,
    Progress,
    Solution,
    TransducerArray,
)
from midair.pipeline import required_lead, resample_pressure, solve_with, target_amplitude
from midair.settings import MODES, Mode, Settings
from midair.validation import checked_call, number, one_of


def settings_of(mode: Settings | Mode) -> Settings:
    """Return the settings of a mode by its name; settings are returned as they are. Raises InputError if unknown."""
    if isinstance(mode, Settings):
        return mode
    one_of(mode, MODES, "mode")
    return MODES[mode]()


@checked_call
def prepare(
    pressure: PressureFrames,
    mode: Settings | Mode = "best",
    *,
    mapping: str | None = None,
    grid: ControlGrid | None = None,
    medium: Medium | None = None,
    lead: float | None = None,
    **changes: Any,
) -> AmplitudeFrames:
    """Target sound amplitude (peak, Pa) at each control point for a recorded pressure.

    As `midair solve` does it: at the frame rate of the mode, 4 kHz in the best one, with a lead before and after the
    pressure in which a bias rises, and corrected for neighbouring cells and for slow transducers. With an explicit
    ``mapping`` it is `targets.prepare`: section 4.1 of the paper, without any of this.

    Parameters
    ----------
    pressure : PressureFrames
        Calibrated pressure of the sensor's cells.
    mode : {"paper", "best", "quick", "finest"} or Settings
        Name of a mode, or settings of every stage; `solve` takes those of the target.
    mapping : {"half-wave", "constant-offset", "slow-bias", "receptors"}, optional
        How signed pressure is made positive, alone.
    grid : ControlGrid, optional
        The control points; those of the mode if None, 16 x 16 at 11/3 mm, 0.2 m above the array.
    medium : Medium, optional
        The air; that of the mode if None.
    lead : float, optional
        Time in s before and after the pressure; what the mode's mapping needs if None.
    **changes
        Further settings by name, such as ``gain=2.0`` or ``circle=3e-3``; see `Settings.but`, or `targets.prepare`
        beside a ``mapping``.

    Raises
    ------
    InputError
        If a setting is unknown or out of range, or needs the array (``strength``, ``ears``), as `pipeline.reproduce`
        takes it.
    """
    if mapping is not None:
        return targets.prepare(pressure, mapping=mapping, grid=grid, medium=medium, **changes)
    given = {"grid": grid, "medium": medium}
    chosen = settings_of(mode).but(**{name: each for name, each in given.items() if each is not None}, **changes)
    if chosen.target.strength is not None or chosen.target.ears is not None:
        raise InputError("prepare: expected a gain, got strength or ears, which need the array; use pipeline.reproduce")
    whole = resample_pressure(pressure, chosen.target.rate)
    whole = targets.add_lead(whole, required_lead(chosen) if lead is None else number(lead, "lead", "s"))
    return target_amplitude(replace(whole, provenance=chosen.noted(whole.provenance)), chosen)


@checked_call
def solve(
    target: AmplitudeFrames,
    array: TransducerArray,
    mode: Settings | Mode | None = None,
    *,
    method: str | solvers.Method | None = None,
    acoustics: Acoustics | None = None,
    bits: int | None = None,
    progress: Progress | None = None,
    **changes: Any,
) -> Solution:
    """Compute transducer phases whose field comes closest to the target, frame by frame.

    With the settings of the target, those of the best mode if it has none. An explicit ``method`` is `solvers.solve`:
    the method alone, in the paper's air, without further terms.

    Parameters
    ----------
    target : AmplitudeFrames
        Target peak sound pressure at each control point, in Pa.
    array : TransducerArray
        The array that will play the drive.
    mode : {"paper", "best", "quick", "finest"} or Settings, optional
        Name of a mode, or settings of every stage.
    method : {"lm", "fast", "glide", "live", "free"} or Method, optional
        A method alone, by its name or a configured one of `midair.solvers`.
    acoustics : Acoustics, optional
        Air and directivity of a transducer, in place of the mode's. The drive stores it.
    bits : int, optional
        Round phases to 2 pi / 2^bits, as firmware does (8 bits: AUTD3); the error is that of the rounded phases.
    progress : callable, optional
        Called with (frames done, frames in total).
    **changes
        Further settings by name, such as ``guard=0.02``; see `Settings.but`, or `solvers.solve` beside a ``method``.

    Returns
    -------
    Solution
        Drive, error and status of each frame. Not converging is a status, never an exception.

    Raises
    ------
    InputError
        If a setting is unknown or out of range, or the solution would not fit into memory.
    """
    if method is not None:
        return solvers.solve(target, array, method=method, acoustics=acoustics, bits=bits, progress=progress, **changes)
    chosen = settings_of(mode) if mode else Settings.of(target.provenance) or settings_of("best")
    chosen = chosen.but(**changes, **({} if acoustics is None else {"acoustics": acoustics}))
    return solve_with(target, array, chosen, bits=bits, progress=progress)
