"""How loud a first pass has to be asked for: what the model expects the sensor's cells to read.

A focus is narrower than a cell, and a pattern wider: what a cell reads of either is the average over its aperture and
its gel. Told from the pressure at a point, a focus would seem to press too little, and the first pass would be asked
for several times too loud.
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
"""Stretch of a recording, in s, that the expected gain is told from."""


def expected_gain(original: PressureFrames, asked: PressureFrames, settings: Settings) -> float:
    """Gain that a pass would have on a perfect array: of mapping, interpolation, cells, hold and transducers.

    The target is met as it is interpolated; frames that are held and transducers that follow make it quieter, unless
    that is compensated. It is told from the strongest second.

    Parameters
    ----------
    original : PressureFrames
        What was felt.
    asked : PressureFrames
        The same with the lead on both sides.
    settings : Settings
        Of every stage.
    """
    lead = (asked.frames - original.frames) / 2 / asked.rate
    start = lead + _strongest(original)
    part = asked.cut(max(0.0, start - lead), LONGEST + 2 * lead)
    expected, heard = _pressed(part, settings), apply_band_twice(part)
    first = min(round(lead * part.rate), part.frames // 4)
    inside = slice(first, part.frames - first)
    got = apply_band_twice(PressureFrames(pressure=expected, rate=part.rate, sensor=part.sensor, band=part.band))
    pair = [
        PressureFrames(pressure=each.pressure[inside], rate=part.rate, sensor=part.sensor, band=part.band)
        for each in (heard, got)
    ]
    return compare(pair[0], pair[1]).gain


def focus_on_cell(array: TransducerArray, sensor: SensorGrid, channel: int, settings: Settings) -> float:
    """Pressure that a cell of the usual sensor reads of a full focus on its middle, in Pa."""
    grid = settings.target.grid
    points = cell_points(sensor, grid)
    x, y = sensor.channel_position(channel)
    middle = np.array([x + grid.centre[0], y + grid.centre[1], grid.height])
    q = np.exp(1j * focus_phase(array, middle, acoustics=settings.acoustics))
    field = transfer_matrix(points, array, acoustics=settings.acoustics) @ q
    weights = cell_weights(SensorModel.usual(sensor), points, centre=grid.centre, between="waves")
    return float(weights[channel] @ radiation_pressure(field, settings.acoustics.medium))


def cell_points(sensor: SensorGrid, grid: ControlGrid) -> ControlGrid:
    """Points fine enough to average over cells, four a pitch, and a pitch beyond the outermost."""
    return ControlGrid(
        rows=4 * (sensor.rows + 2),
        columns=4 * (sensor.columns + 2),
        pitch=sensor.pitch / 4,
        height=grid.height,
        centre=grid.centre,
    )


def played_part(frequency: float, settings: Settings) -> float:
    """What is left of a change of this frequency after hold and transducers, 0 to 1."""
    dynamics = settings.compensation.dynamics
    return float(np.abs(playback_response(np.array([frequency]), settings.target.rate, dynamics=dynamics))[0])


def _pressed(part: PressureFrames, settings: Settings) -> Array:
    """What the cells would read of it, shape (frame, row, column), in Pa.

    At the control points, each with its square around it: sound is too smooth to do otherwise between them.
    """
    points, chosen = settings.target.grid, settings.compensation
    target = map_pressure(compensate_pressure(part, settings), settings).amplitude
    if not (chosen.precompensate and chosen.compensate == "sound"):

        def quieter(frequency: Array) -> Array:
            response = playback_response(frequency, part.rate, dynamics=chosen.dynamics)
            return np.abs(response)[:, None]

        target = filter_response(target, part.rate, quieter, reach=0.01)
    # Sound rounds the peaks of an amplitude that is interpolated, and presses more beside them than lines say: of one
    # modulated focus a first pass is 1.13 times too strong by lines, .99 by steps, .89 by waves.
    between = "lines" if settings.target.interpolate == "pressure" else "steps"
    weights = cell_weights(SensorModel.usual(part.sensor), points, centre=points.centre, between=between)
    pressed = radiation_pressure(target, settings.acoustics.medium) @ weights.T
    return pressed.reshape(part.pressure.shape)


def _strongest(original: PressureFrames) -> float:
    """Where the second with the most power begins, in s."""
    frames = round(LONGEST * original.rate)
    if original.frames <= frames:
        return 0.0
    power = np.concatenate([[0.0], (original.pressure**2).sum(axis=(1, 2)).cumsum()])
    return float(np.argmax(power[frames:] - power[:-frames]) / original.rate)
