"""From foci to a drive: one focus in closed form, several by a solver, each within what the array can do."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array, Complex
from midair.errors import InputError
from midair.model import (
    HEIGHT,
    HEIGHTS,
    Acoustics,
    AmplitudeFrames,
    ControlGrid,
    Drive,
    Medium,
    Palm,
    PressureFrames,
    Progress,
    Provenance,
    SensorGrid,
    Solution,
    Status,
    TransducerArray,
)
from midair.physics import (
    SensorModel,
    cell_weights,
    check_frame_rate,
    radiation_pressure,
    sound_amplitude,
    transfer_matrix,
)
from midair.settings import Settings
from midair.solvers import PLAIN, Problem, WarmStart
from midair.streaming import LazyFrames
from midair.validation import frozen_array, positive


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Foci:
    """Places that are pressed, frame by frame."""

    position: Array
    """Shape (frame, focus, 3), in m, in array coordinates."""
    pressure: Array
    """Radiation pressure at each, 0 or more, shape (frame, focus), in Pa."""
    rate: float
    """Frames per second, in Hz."""
    height: float = HEIGHT
    """Height of the palm above the array, in m."""

    def __post_init__(self) -> None:
        pressure = frozen_array(self.pressure, "pressure", ("frame", "focus"))
        position = frozen_array(self.position, "position", (*pressure.shape, 3))
        if pressure.min() < 0:
            raise InputError(f"pressure: expected 0 Pa or more, got {pressure.min():g} Pa")
        object.__setattr__(self, "pressure", pressure)
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "rate", positive(self.rate, "rate", "Hz"))

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.pressure)


BLOCK = 256
"""Frames that are drawn at once."""


def reachable_pressure(points: Array, array: TransducerArray, acoustics: Acoustics) -> Array:
    """Pressure of one focus of the whole array at full drive, at points (point, 3) in m: shape (point,), in Pa.

    Radiation pressure of the sum of ``|G|`` over the transducers, the largest that any phases can give there.
    """
    blocks = [points[first : first + 2048] for first in range(0, len(points), 2048)]
    sums = [np.abs(transfer_matrix(block, array, acoustics=acoustics)).sum(axis=1) for block in blocks]
    return radiation_pressure(np.concatenate(sums), acoustics.medium)


def check_reach(foci: Foci, array: TransducerArray, acoustics: Acoustics) -> float:
    """Largest part of the reachable pressure that any focus asks for, 0 to 1.

    Raises InputError if a place is outside the reach, at most 45 degrees beside the array, or if the array cannot
    press so hard there; RateError if it cannot take frames at that rate.
    """
    check_frame_rate(foci.rate, array.frequency)
    places, index = _distinct(foci.position)
    edges = np.maximum(
        array.position[:, :2].min(axis=0) - places[:, :2], places[:, :2] - array.position[:, :2].max(axis=0)
    )
    far = (edges.max(axis=1) > places[:, 2]) | (places[:, 2] < HEIGHTS[0]) | (places[:, 2] > HEIGHTS[1])
    if far.any():
        raise InputError(
            f"path: expected places {1e3 * HEIGHTS[0]:g} to {1e3 * HEIGHTS[1]:g} mm above the array and at most 45 "
            f"degrees beside it, got {_mm(places[far.argmax()])}"
        )
    most = reachable_pressure(places, array, acoustics)[index]
    parts = foci.pressure / most
    frame, focus = np.unravel_index(parts.argmax(), parts.shape)
    if parts.max() > 1:
        raise InputError(
            f"pressure: expected at most {most[frame, focus]:.4g} Pa at {_mm(foci.position[frame, focus])}, all that "
            f"this array can do there, got {foci.pressure[frame, focus]:.4g} Pa"
        )
    busy = np.flatnonzero((foci.pressure > 0).sum(axis=1) > 1)
    for frame in busy[np.argsort(parts[busy].sum(axis=1))[-8:]]:
        _several(foci.position[frame], foci.pressure[frame], array, acoustics)
    return float(parts.max())


def draw_parts(
    foci: Foci,
    array: TransducerArray,
    *,
    acoustics: Acoustics,
    provenance: Provenance | None = None,
    progress: Progress | None = None,
) -> Iterator[Solution]:
    """Yield the drive of foci, block by block; silent frames keep the phases of the frame before.

    One focus has the phases -arg G and the level that its pressure needs. Several have the phases of GS-PAT, corrected
    by Levenberg-Marquardt, and their common level; the error of a frame is that of the sound amplitudes at the foci.

    Raises
    ------
    InputError
        If the array cannot produce the pressures of several foci at once.
    """
    held = np.zeros(array.count)
    for first in range(0, foci.frames, BLOCK):
        position, pressure = (each[first : first + BLOCK] for each in (foci.position, foci.pressure))
        count = len(pressure)
        phase, level, error = np.zeros((count, array.count)), np.zeros(count), np.zeros(count)
        busy = (pressure > 0).sum(axis=1)
        places, index = _distinct(position)
        G = transfer_matrix(places, array, acoustics=acoustics)
        loudest = pressure.argmax(axis=1)
        rows = index[np.arange(count), loudest]
        phase[:] = np.mod(-np.angle(G), 2 * np.pi)[rows]
        level[:] = sound_amplitude(pressure.max(axis=1), acoustics.medium) / np.abs(G).sum(axis=1)[rows]
        solved: dict[bytes, tuple[Array, float, float]] = {}
        for frame in np.flatnonzero(busy > 1):
            key = index[frame].tobytes() + np.round(pressure[frame], 9).tobytes()
            if key not in solved:
                solved[key] = _several(position[frame], pressure[frame], array, acoustics)
            phase[frame], level[frame], error[frame] = solved[key]
        for frame in np.flatnonzero(busy == 0):
            phase[frame] = phase[frame - 1] if frame else held
        held = phase[-1]
        status: list[Status] = [("silent", "converged", "iterations")[min(each, 2)] for each in busy]
        if progress is not None:
            progress(first + count, foci.frames)
        yield Solution(
            drive=Drive(
                phase=phase,
                level=np.minimum(level, 1.0),
                rate=foci.rate,
                array=array,
                acoustics=acoustics,
                provenance=provenance or Provenance(),
            ),
            error=error,
            iterations=np.minimum(busy, 1),
            status=tuple(status),
        )


def draw(foci: Foci, array: TransducerArray, *, acoustics: Acoustics | None = None) -> Solution:
    """The drive of foci, with the checks of `check_reach` and the method of `draw_parts`."""
    acoustics = acoustics or Acoustics()
    check_reach(foci, array, acoustics)
    return Solution.joined(list(draw_parts(foci, array, acoustics=acoustics)))


def gs_pat(G: Complex, p: Array, *, iterations: int = 100) -> Array:
    """Phases (transducer,) in rad of a field with magnitudes p (point,), none 0, by GS-PAT.

    Gerchberg-Saxton in the space of points, with R = G B and a backward propagator B of unit power per point. G has
    shape (point, transducer). Plasencia, Hirayama, Montano-Murillo & Subramanian, "GS-PAT: high-speed multi-point
    sound-fields for phased arrays of transducers", ACM Trans. Graph. 39 (2020).
    """
    back = (G.conj() / (np.abs(G) ** 2).sum(axis=1, keepdims=True)).T
    R, a = G @ back, p.astype(complex)
    for _ in range(iterations):
        a = p * np.exp(1j * np.angle(a @ R.T))
    y = a @ R.T
    # The iteration changes phases only; the last pass corrects the magnitudes.
    return np.angle((p**2 * np.exp(1j * np.angle(y)) / np.maximum(np.abs(y), 1e-300)) @ back.T)


def _several(
    position: Array, pressure: Array, array: TransducerArray, acoustics: Acoustics
) -> tuple[Array, float, float]:
    """Phases, level and error of several foci in one frame."""
    there = pressure > 0
    G = transfer_matrix(position[there], array, acoustics=acoustics)
    wanted = sound_amplitude(pressure[there], acoustics.medium)
    scale = np.abs(G).sum(axis=1).max()
    first = gs_pat(G / scale, wanted / scale)
    field = G @ np.exp(1j * first)
    # At the level of these phases, Levenberg-Marquardt finds the ratios of the foci.
    level = float(np.abs(field) @ wanted / np.linalg.norm(field) ** 2)
    start = WarmStart(theta=first, known=np.concatenate([first, np.angle(field)]))
    problem = Problem(G=G / scale, amplitude=wanted[None] / scale / level)
    phase = PLAIN.solve(problem, after=start).phase[0]
    size = np.abs(G @ np.exp(1j * phase))
    level = float(size @ wanted / (size @ size))
    if level > 1:
        raise InputError(
            f"pressure: expected at most {' + '.join(f'{each:.4g}' for each in pressure[there] / level**2)} Pa in "
            f"{there.sum()} foci at once, all that this array can do there, got "
            f"{' + '.join(f'{each:.4g}' for each in pressure[there])} Pa"
        )
    return phase, level, float(np.linalg.norm(level * size - wanted) / np.linalg.norm(wanted))


def drawn_settings(foci: Foci, acoustics: Acoustics) -> Settings:
    """Settings that a drawn drive states: its rate, its air, and control points that cover its places."""
    pitch = 11e-3 / 3
    widest = float(np.abs(foci.position[..., :2]).max()) + 15e-3
    count = min(max(2 * int(np.ceil(widest / pitch)), 18), 40)
    grid = ControlGrid(rows=count, columns=count, pitch=max(pitch, 2 * widest / count), height=foci.height)
    return Settings().but(rate=foci.rate, grid=grid, method="lm", acoustics=acoustics)


def wanted_amplitude(foci: Foci, array: TransducerArray, settings: Settings, provenance: Provenance) -> AmplitudeFrames:
    """Sound amplitude of ideal foci at the control points of the settings, computed when it is read.

    Each focus has the shape of a single one of the whole array; the powers of several are added.
    """
    acoustics = settings.acoustics
    G = transfer_matrix(settings.target.grid, array, acoustics=acoustics).T.astype(np.complex64)

    def read(first: int, last: int) -> Array:
        places, index = _distinct(foci.position[first:last])
        own: Complex = transfer_matrix(places, array, acoustics=acoustics)
        shape = np.abs(np.exp(-1j * np.angle(own)).astype(np.complex64) @ G) / np.abs(own).sum(axis=1)[:, None]
        wanted = sound_amplitude(foci.pressure[first:last], acoustics.medium)
        return np.sqrt(sum((wanted[:, each, None] * shape[index[:, each]]) ** 2 for each in range(wanted.shape[1])))

    amplitude = LazyFrames(read, (foci.frames, settings.target.grid.count))
    return AmplitudeFrames(amplitude=amplitude, rate=foci.rate, grid=settings.target.grid, provenance=provenance)  # pyright: ignore[reportArgumentType]


def wanted_pressure(target: AmplitudeFrames, medium: Medium, cells: SensorGrid | None = None) -> PressureFrames:
    """Pressure on the cells of a sensor at the height of the palm, 4 x 4 if None, for the amplitudes of a target."""
    sensor = cells or SensorGrid()
    weights = cell_weights(SensorModel.usual(sensor), target.grid, between="waves")
    pressed = radiation_pressure(np.asarray(target.amplitude[:]), medium) @ weights.T
    return PressureFrames(
        pressure=pressed.reshape(-1, *sensor.shape), rate=target.rate, sensor=sensor, provenance=target.provenance
    )


def palm_pressure(
    foci: Foci, array: TransducerArray, palm: Palm, *, acoustics: Acoustics, rate: float = 2000.0
) -> tuple[Array, float]:
    """Pressure of ideal foci on a palm, shape (frame, row, column) in Pa, and its frame rate, at least `rate` in Hz.

    The foci lie in steps of a quarter of a millimetre. Raises the errors of `check_reach`.
    """
    check_reach(foci, array, acoustics)
    every = max(int(foci.rate // rate), 1)
    places = np.round(foci.position[::every] / 0.25e-3) * 0.25e-3
    coarse = replace(foci, position=places, pressure=foci.pressure[::every], rate=foci.rate / every)
    settings = drawn_settings(coarse, acoustics).but(grid=palm.grid(foci.height))
    amplitude = np.asarray(wanted_amplitude(coarse, array, settings, Provenance()).amplitude[:])
    pressure = radiation_pressure(amplitude, acoustics.medium).reshape(-1, *palm.inside.shape)
    return pressure * palm.inside, coarse.rate


def _distinct(position: Array) -> tuple[Array, NDArray[np.intp]]:
    """Different places to a nanometre, shape (place, 3), and the number of each, shape (frame, focus)."""
    places, index = np.unique(np.round(position.reshape(-1, 3), 9), axis=0, return_inverse=True)
    return places, np.reshape(index, position.shape[:2])


def _mm(place: Array) -> str:
    return "(" + ", ".join(f"{round(1e3 * each, 1) + 0:g}" for each in place) + ") mm"
