"""What a view shows of a recording, a target, a drive or a comparison: frames by name, and where they lie."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import PurePath

import numpy as np
from numpy.typing import NDArray

from midair.errors import RateError
from midair.model import AmplitudeFrames, ControlGrid, Drive, PressureFrames, Recording, SensorGrid, Solution
from midair.physics import transfer_matrix
from midair.reel import taken
from midair.validation import frozen_array
from midair.view.finer import Finer, finer

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Channels:
    """Samples of the cells of a sensor.

    Attributes
    ----------
    values : ndarray, shape (frame, channel)
        In `unit`.
    unit : str
        V, count or Pa.
    label : str
        What to call them beside others.
    """

    values: Array
    unit: str
    label: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", frozen_array(self.values, "samples", ("frame", "channel")))

    @property
    def loudest(self) -> int:
        """The channel with the largest rms about its mean."""
        return int(self.values.std(axis=0).argmax())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sound:
    """Sound in a plane, wanted and played, and what the array is told.

    Attributes
    ----------
    grid : ControlGrid
        The points.
    wanted : ndarray or None, shape (frame, point)
        Peak, in Pa.
    played : ndarray of complex or None, shape (frame, point)
        Peak, in Pa, as if each frame lasted for ever.
    drive : Drive or None
        What plays.
    finer : Finer or None
        Makes more points of those of `played`.
    """

    grid: ControlGrid
    wanted: Array | None = None
    played: Complex | None = None
    drive: Drive | None = None
    finer: Finer | None = None

    @property
    def top(self) -> float:
        """Largest amplitude of all frames, in Pa."""
        return max(
            float(np.abs(each).max(initial=0)) for each in (self.wanted, self.played, np.zeros(1)) if each is not None
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Showing:
    """What a view shows.

    Attributes
    ----------
    title : str
        What it is.
    rate : float
        Frames per second, in Hz.
    frames : int
        Number of frames.
    simulated : bool
        Whether any of it was simulated.
    sensor : SensorGrid or None
        The cells.
    samples, again : Channels or None
        What they felt; what they felt of the reproduction.
    sound : Sound or None
        Wanted and played.
    facts : mapping of str to str
        In words.
    """

    title: str
    rate: float
    frames: int
    simulated: bool
    sensor: SensorGrid | None = None
    samples: Channels | None = None
    again: Channels | None = None
    sound: Sound | None = None
    facts: Mapping[str, str] = field(default_factory=dict[str, str])

    @property
    def channel(self) -> int:
        """The channel to begin with: the loudest one."""
        return 0 if self.samples is None else self.samples.loudest

    @property
    def duration(self) -> float:
        """In s."""
        return self.frames / self.rate


def show_recording(recording: Recording, *, pressure: PressureFrames | None = None) -> Showing:
    """Channels of a recording; calibrated, where its pressure is given."""
    values, unit = (recording.samples, recording.unit) if pressure is None else (pressure.pressure, "Pa")
    kept = np.asarray(values).reshape(len(values), -1)
    return Showing(
        title=_named(recording.provenance.notes, recording.provenance.source),
        rate=recording.rate if pressure is None else pressure.rate,
        frames=len(kept),
        simulated=recording.provenance.simulated,
        sensor=recording.sensor,
        samples=Channels(values=kept, unit=unit, label="recorded" if pressure is None else "calibrated"),
        facts={"sensor": recording.sensor.spelled},
    )


def show_target(target: AmplitudeFrames) -> Showing:
    """Sound that is wanted at the control points."""
    return Showing(
        title=_named(target.provenance.notes, target.provenance.source),
        rate=target.rate,
        frames=target.frames,
        simulated=target.provenance.simulated,
        sound=Sound(grid=target.grid, wanted=np.asarray(target.amplitude)),
        facts={"plane": _plane(target.grid)},
    )


def show_drive(solution: Solution | Drive, *, target: AmplitudeFrames | None = None) -> Showing:
    """What a drive plays, beside what it was asked for, and the phases of its array.

    Where there is no target, the plane is the usual one, 200 mm above the array.
    """
    drive = solution.drive if isinstance(solution, Solution) else solution
    grid = ControlGrid() if target is None else target.grid
    facts = {"array": f"{drive.array.name}, {drive.array.count} transducers", "plane": _plane(grid)}
    if isinstance(solution, Solution) and solution.plays.any():
        facts["E"] = f"{100 * solution.error[solution.plays].mean():.1f} % of what is wanted, on average"
    return Showing(
        title=_named(drive.provenance.notes, drive.provenance.source),
        rate=drive.rate,
        frames=drive.frames,
        # Nobody has measured it: the field is what the model of the array makes of the phases.
        simulated=True,
        sound=Sound(
            grid=grid,
            wanted=None if target is None else np.asarray(target.amplitude),
            played=played_field(drive, grid),
            drive=drive,
            finer=finer(grid, drive.array, acoustics=drive.acoustics),
        ),
        facts=facts,
    )


def show_comparison(
    original: PressureFrames,
    again: PressureFrames,
    *,
    drive: Solution | Drive | None = None,
    target: AmplitudeFrames | None = None,
) -> Showing:
    """A re-recording over its original; with the drive between them where it has as many frames.

    Raises
    ------
    RateError
        If the two are not at one rate.
    """
    if not np.isclose(original.rate, again.rate, rtol=1e-9):
        raise RateError(f"comparison: expected both at one rate, got {original.rate:g} and {again.rate:g} Hz")
    frames = min(original.frames, again.frames)
    sound = None if drive is None else show_drive(drive, target=target).sound
    return Showing(
        title=_named(original.provenance.notes, original.provenance.source),
        rate=original.rate,
        frames=frames,
        simulated=original.provenance.simulated or again.provenance.simulated,
        sensor=original.sensor,
        samples=_felt(original, frames, "original"),
        again=_felt(again, frames, "re-recorded"),
        sound=sound,
        facts={"sensor": original.sensor.spelled},
    )


def played_field(drive: Drive, grid: ControlGrid) -> Complex:
    """The field of each frame as if it lasted for ever, shape (frame, point), in Pa; a stretch of frames at a time."""
    G = transfer_matrix(grid, drive.array, acoustics=drive.acoustics).T
    field = np.empty((drive.frames, grid.count), np.complex128)
    for first in range(0, drive.frames, 512):
        last = min(first + 512, drive.frames)
        part = replace(drive, phase=taken(drive.phase, first, last), level=taken(drive.level, first, last))
        field[first:last] = part.q @ G
    return field


def _felt(pressure: PressureFrames, frames: int, label: str) -> Channels:
    return Channels(values=np.asarray(pressure.pressure[:frames]).reshape(frames, -1), unit="Pa", label=label)


def _plane(grid: ControlGrid) -> str:
    points = f"{grid.rows} × {grid.columns} points {1e3 * grid.pitch:.3g} mm apart"
    return f"{points}, {1e3 * grid.height:.4g} mm above the array"


def _named(notes: Mapping[str, str], source: str) -> str:
    return notes.get("object") or PurePath(source).name.rpartition(":")[2] or "take"
