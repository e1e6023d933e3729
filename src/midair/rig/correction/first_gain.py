"""Expected gain of a first pass: the pressure that the model expects on the sensor's cells.

A cell reads the average over its aperture and its gel. A focus is narrower than a cell and a pattern is wider, so a
gain measured at a focus alone would make the first pass several times too strong.
"""

import numpy as np
from numpy.typing import NDArray

from midair.dsp import filter_response
from midair.evaluate import apply_band_twice, compare
from midair.model import ControlGrid, PressureFrames, SensorGrid, TransducerArray
from midair.physics import (
    SensorModel,
    cell_weights,
    focus_phase,
    playback_response,
    radiation_pressure,
    transfer_matrix,
)
from midair.pipeline import compensate_pressure, map_pressure
from midair.settings import Settings

Array = NDArray[np.float64]

LONGEST = 1.0
"""Duration of the part of a recording that gives the expected gain, in s."""


def expected_gain(original: PressureFrames, asked: PressureFrames, settings: Settings) -> float:
    """Gain of a pass on a perfect array: mapping, interpolation, cells, hold and transducers, in the strongest second.

    `asked` is the original with the lead on both sides. The target is assumed to be met; frame hold and transducers
    attenuate it unless that is compensated.
    """
    lead = (asked.frames - original.frames) / 2 / asked.rate
    start = lead + _strongest_second(original)
    part = asked.cut(max(0.0, start - lead), LONGEST + 2 * lead)
    expected, heard = _expected_reading(part, settings), apply_band_twice(part)
    first = min(round(lead * part.rate), part.frames // 4)
    inside = slice(first, part.frames - first)
    got = apply_band_twice(PressureFrames(pressure=expected, rate=part.rate, sensor=part.sensor, band=part.band))
    pair = [
        PressureFrames(pressure=each.pressure[inside], rate=part.rate, sensor=part.sensor, band=part.band)
        for each in (heard, got)
    ]
    return compare(pair[0], pair[1]).gain


def focus_on_cell(array: TransducerArray, sensor: SensorGrid, channel: int, settings: Settings) -> float:
    """Pressure in Pa that a cell of the default sensor reads of a full focus on its centre."""
    grid = settings.target.grid
    points = cell_points(sensor, grid)
    x, y = sensor.channel_position(channel)
    middle = np.array([x + grid.centre[0], y + grid.centre[1], grid.height])
    q = np.exp(1j * focus_phase(array, middle, acoustics=settings.acoustics))
    field = transfer_matrix(points, array, acoustics=settings.acoustics) @ q
    weights = cell_weights(SensorModel.usual(sensor), points, centre=grid.centre, between="waves")
    return float(weights[channel] @ radiation_pressure(field, settings.acoustics.medium))


def cell_points(sensor: SensorGrid, grid: ControlGrid) -> ControlGrid:
    """Points for averages over cells: four per pitch, up to one pitch beyond the outermost cells."""
    return ControlGrid(
        rows=4 * (sensor.rows + 2),
        columns=4 * (sensor.columns + 2),
        pitch=sensor.pitch / 4,
        height=grid.height,
        centre=grid.centre,
    )


def played_part(frequency: float, settings: Settings) -> float:
    """Factor, 0 to 1, by which hold and transducers attenuate a change of this frequency."""
    dynamics = settings.compensation.dynamics
    return float(np.abs(playback_response(np.array([frequency]), settings.target.rate, dynamics=dynamics))[0])


def _expected_reading(part: PressureFrames, settings: Settings) -> Array:
    """Expected reading of the cells in Pa, shape (frame, row, column), from squares around the control points."""
    points, chosen = settings.target.grid, settings.compensation
    target = map_pressure(compensate_pressure(part, settings), settings).amplitude
    if not (chosen.precompensate and chosen.compensate == "sound"):

        def quieter(frequency: Array) -> Array:
            response = playback_response(frequency, part.rate, dynamics=chosen.dynamics)
            return np.abs(response)[:, None]

        target = filter_response(target, part.rate, quieter, reach=0.01)
    # Sound rounds the peaks of an interpolated amplitude and adds pressure beside them: for one modulated focus a first
    # pass is 1.13 times too strong with "lines", .99 with "steps", .89 with "waves".
    between = "lines" if settings.target.interpolate == "pressure" else "steps"
    weights = cell_weights(SensorModel.usual(part.sensor), points, centre=points.centre, between=between)
    pressed = radiation_pressure(target, settings.acoustics.medium) @ weights.T
    return pressed.reshape(part.pressure.shape)


def _strongest_second(original: PressureFrames) -> float:
    """Start in s of the second with the most power."""
    frames = round(LONGEST * original.rate)
    if original.frames <= frames:
        return 0.0
    power = np.concatenate([[0.0], (original.pressure**2).sum(axis=(1, 2)).cumsum()])
    return float(np.argmax(power[frames:] - power[:-frames]) / original.rate)
