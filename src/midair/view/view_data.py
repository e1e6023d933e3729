"""Data of a view: frames and geometry of a recording, a target, a drive or a comparison; interpolation of its fields.

The complex pressure in a plane is smooth on the scale of half a wavelength, its magnitude is not: interpolating
magnitudes gives errors of 10 %, interpolating complex fields 1 %.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import PurePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array, Complex
from midair.errors import InputError, RateError
from midair.model import (
    Acoustics,
    AmplitudeFrames,
    ControlGrid,
    Drive,
    PressureFrames,
    Provenance,
    Recording,
    SensorGrid,
    Solution,
    TransducerArray,
    frame_range,
)
from midair.physics import transfer_matrix
from midair.streaming import read_frames
from midair.validation import frozen_array, within


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InterpolatedField:
    """Interpolation from a control grid to a finer one: ``down @ field @ across.T``."""

    down: Array
    """Real, shape (finer row, row)."""
    across: Array
    """Real, shape (finer column, column)."""

    def __call__(self, field: Complex) -> Complex:
        """Map a field (..., row, column) to (..., finer row, finer column)."""
        return np.asarray(self.down @ field @ self.across.T, np.complex128)


def fit_interpolation(
    grid: ControlGrid, array: TransducerArray, *, acoustics: Acoustics | None = None, times: int = 4
) -> InterpolatedField:
    """Fit the two matrices with the smallest mean error over all fields of the array with random phases.

    Least squares over the fields of the single transducers on four rows and columns of the grid, which get `times` as
    many points per side. The relative rms error of the known field is that of 8-bit counts, .003.
    """
    x, y = grid.x + grid.centre[0], grid.y + grid.centre[1]
    fine_x, fine_y = _between(x, times), _between(y, times)

    def field(some_x: Array, some_y: Array) -> Complex:
        places = np.stack(np.meshgrid(some_x, some_y), axis=-1).reshape(-1, 2)
        points = np.column_stack([places, np.full(len(places), grid.height)])
        made = transfer_matrix(points, array, acoustics=acoustics)
        return made.reshape(len(some_y), len(some_x), array.count)

    rows, columns = y[_spread(len(y), 4)], x[_spread(len(x), 4)]
    return InterpolatedField(
        down=_fitted(field(columns, y).swapaxes(0, 1), field(columns, fine_y).swapaxes(0, 1), 0.003),
        across=_fitted(field(x, rows), field(fine_x, rows), 0.003),
    )


def _between(places: Array, times: int) -> Array:
    """Return `times` as many equally spaced values from the first to the last."""
    return np.linspace(places[0], places[-1], times * len(places))


def _spread(count: int, some: int) -> NDArray[np.intp]:
    """Return indices of some lines, evenly from the first to the last."""
    return np.unique(np.linspace(0, count - 1, min(some, count)).round().astype(np.intp))


def _fitted(known: Complex, wanted: Complex, noise: float) -> Array:
    """Real matrix that maps lines (line, place, transducer) to (line, finer place, transducer)."""
    before, after = _real_lines(known), _real_lines(wanted)
    moments = before @ before.T
    # Regularised by the noise: otherwise the matrix amplifies the steps of 8 bits several hundred times.
    held = moments + noise**2 * np.trace(moments) / len(moments) * np.eye(len(moments))
    return np.asarray(np.linalg.solve(held, before @ after.T).T, np.float64)


def _real_lines(lines: Complex) -> Array:
    """Concatenate all lines to (place, line), with real and imaginary parts as separate lines."""
    beside = lines.swapaxes(0, 1).reshape(lines.shape[1], -1)
    return np.hstack([beside.real, beside.imag])


Part = tuple[float, float | None]
"""Start in s and duration in s; to the end if the duration is None."""

WHOLE: Part = (0.0, None)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Channels:
    """Samples of the cells of a sensor."""

    values: Array
    """In `unit`, shape (frame, channel)."""
    unit: str
    """V, count or Pa."""
    label: str
    """Name of these samples in the view."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", frozen_array(self.values, "samples", ("frame", "channel")))

    def check(self, channel: int) -> int:
        """Return the number of a channel; InputError if there is none."""
        within(channel, "channel", 0, self.values.shape[1] - 1)
        return channel

    @property
    def loudest(self) -> int:
        """Channel with the largest standard deviation."""
        return int(self.values.std(axis=0).argmax())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sound:
    """Target and played sound field in a plane, and the drive."""

    grid: ControlGrid
    wanted: Array | None = None
    """Target: peak sound pressure in Pa, shape (frame, point)."""
    played: Complex | None = None
    """Complex sound pressure in Pa (peak), steady state of each frame, shape (frame, point)."""
    drive: Drive | None = None
    finer: InterpolatedField | None = None
    """Interpolation of `played` to more points."""

    @property
    def top(self) -> float:
        """Largest amplitude of all frames in Pa."""
        return max(
            float(np.abs(each).max(initial=0)) for each in (self.wanted, self.played, np.zeros(1)) if each is not None
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ViewData:
    """Frames and metadata of a view."""

    title: str
    rate: float
    """Frame rate in Hz."""
    frames: int
    simulated: bool
    """True if any of it was simulated."""
    sensor: SensorGrid | None = None
    samples: Channels | None = None
    """Recorded samples."""
    again: Channels | None = None
    """Re-recorded samples of the reproduction."""
    sound: Sound | None = None
    facts: Mapping[str, str] = field(default_factory=dict[str, str])
    """Further properties as text."""
    first: int = 0
    """Number of the first frame in the whole take."""
    chosen: int | None = None
    """Channel that is selected first; the loudest one if None."""

    def __post_init__(self) -> None:
        if self.chosen is None:
            return
        if self.samples is None:
            raise InputError("channel: expected a recording, whose channels can be chosen, got a drive or a target")
        self.samples.check(self.chosen)

    @property
    def channel(self) -> int:
        """Channel that is selected first."""
        if self.chosen is not None:
            return self.chosen
        return 0 if self.samples is None else self.samples.loudest

    @property
    def duration(self) -> float:
        """Duration in s."""
        return self.frames / self.rate


def show_recording(recording: Recording, *, pressure: PressureFrames | None = None, part: Part = WHOLE) -> ViewData:
    """View of a recording, or of its calibrated pressure if given."""
    if pressure is None:
        values = np.asarray(recording.samples)
        shown = Channels(values=values.reshape(len(values), -1), unit=recording.unit, label="recorded")
    else:
        shown = _pressure_channels(pressure, "calibrated")
    rate = recording.rate if pressure is None else pressure.rate
    first, last = span = frame_range(*part, len(shown.values), rate, "part")
    samples, facts = replace(shown, values=shown.values[first:last]), {"sensor": recording.sensor.spelled}
    return _view(recording.provenance, rate, part, span, facts, sensor=recording.sensor, samples=samples)


def show_target(target: AmplitudeFrames, *, part: Part = WHOLE) -> ViewData:
    """View of target amplitudes at the control points."""
    span = frame_range(*part, target.frames, target.rate, "part")
    sound = Sound(grid=target.grid, wanted=np.asarray(read_frames(target.amplitude, *span)))
    return _view(target.provenance, target.rate, part, span, {"plane": _plane(target.grid)}, sound=sound)


def show_drive(solution: Solution | Drive, *, target: AmplitudeFrames | None = None, part: Part = WHOLE) -> ViewData:
    """View of the field that a drive plays, beside its target, by default 200 mm above the array, and of its phases."""
    whole = solution.drive if isinstance(solution, Solution) else solution
    first, last = span = frame_range(*part, whole.frames, whole.rate, "part")
    drive = replace(whole, phase=read_frames(whole.phase, *span), level=read_frames(whole.level, *span))
    grid = ControlGrid() if target is None else target.grid
    facts = {"array": f"{drive.array.name}, {drive.array.count} transducers", "plane": _plane(grid)}
    if isinstance(solution, Solution) and (plays := solution.plays[first:last]).any():
        facts["E"] = f"{100 * solution.error[first:last][plays].mean():.1f} % of the target, on average"
    sound = Sound(
        grid=grid,
        wanted=None if target is None else np.asarray(read_frames(target.amplitude, *span)),
        played=played_field(drive, grid),
        drive=drive,
        finer=fit_interpolation(grid, drive.array, acoustics=drive.acoustics),
    )
    # The field is computed from the phases by the model of the array, not measured.
    return replace(_view(drive.provenance, drive.rate, part, span, facts, sound=sound), simulated=True)


def show_comparison(
    original: PressureFrames, again: PressureFrames, *, sound: Sound | None = None, part: Part = WHOLE
) -> ViewData:
    """View of a re-recording over its original, with the sound field between them; RateError if the rates differ."""
    if not np.isclose(original.rate, again.rate, rtol=1e-9):
        raise RateError(f"comparison: expected both at one rate, got {original.rate:g} and {again.rate:g} Hz")
    first, last = span = frame_range(*part, min(original.frames, again.frames), original.rate, "part")
    before, after = _pressure_channels(original, "original"), _pressure_channels(again, "re-recorded")
    shown = _view(
        original.provenance,
        original.rate,
        part,
        span,
        {"sensor": original.sensor.spelled},
        sensor=original.sensor,
        samples=replace(before, values=before.values[first:last]),
        again=replace(after, values=after.values[first:last]),
        sound=sound,
    )
    return replace(shown, simulated=shown.simulated or again.provenance.simulated)


def _view(
    provenance: Provenance, rate: float, part: Part, span: tuple[int, int], facts: dict[str, str], **shown: Any
) -> ViewData:
    """View of the frames `span` of something with this provenance."""
    first, last = span
    if part != WHOLE:
        facts = {**facts, "part": f"{first / rate:.4g} to {last / rate:.4g} s"}
    title = provenance.notes.get("object") or PurePath(provenance.source).name.rpartition(":")[2] or "take"
    return ViewData(
        title=title, rate=rate, frames=last - first, first=first, simulated=provenance.simulated, facts=facts, **shown
    )


def played_field(drive: Drive, grid: ControlGrid) -> Complex:
    """Complex steady-state field of each frame in Pa, shape (frame, point); computed 512 frames at a time."""
    G = transfer_matrix(grid, drive.array, acoustics=drive.acoustics).T
    field = np.empty((drive.frames, grid.count), np.complex128)
    for first in range(0, drive.frames, 512):
        last = min(first + 512, drive.frames)
        part = replace(drive, phase=read_frames(drive.phase, first, last), level=read_frames(drive.level, first, last))
        field[first:last] = part.q @ G
    return field


def _pressure_channels(pressure: PressureFrames, label: str) -> Channels:
    values = np.asarray(pressure.pressure)
    return Channels(values=values.reshape(len(values), -1), unit="Pa", label=label)


def _plane(grid: ControlGrid) -> str:
    points = f"{grid.rows} × {grid.columns} points {1e3 * grid.pitch:.3g} mm apart"
    return f"{points}, {1e3 * grid.height:.4g} mm above the array"
