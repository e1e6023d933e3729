import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import ndtr

from midair.errors import InputError
from midair.model import Acoustics, ControlGrid, SensorGrid, TransducerArray
from midair.physics import SensorModel, cell_weights, transfer_matrix

ALONE = SensorModel(grid=SensorGrid(rows=1, columns=1))


def test_an_even_pressure_reads_itself():
    wide = ControlGrid(rows=40, columns=44)
    weights = cell_weights(SensorModel(), wide)
    assert weights.shape == (16, 40 * 44)
    assert weights.sum(axis=1) == pytest.approx(np.ones(16), abs=1e-12)
    assert weights.min() >= -1e-15


@pytest.mark.parametrize("between", ["steps", "lines"])
@settings(deadline=None, max_examples=30)
@given(
    st.floats(0.2e-3, 6e-3),
    st.floats(1e-3, 11e-3),
    st.floats(1e-3, 6e-3),
    st.floats(-3e-3, 3e-3),
    st.floats(-3e-3, 3e-3),
)
def test_an_even_pressure_reads_itself_whatever_the_sensor(between, spread, aperture, pitch, x, y):
    model = SensorModel(spread=spread, aperture=aperture)
    count = int(np.ceil(0.12 / pitch))
    points = ControlGrid(rows=count, columns=count, pitch=pitch)
    weights = cell_weights(model, points, centre=(x, y), between=between)
    assert weights.sum(axis=1) == pytest.approx(np.ones(16), abs=1e-9)


def test_weights_without_spread_are_shares_of_the_aperture():
    # 1 cell of 8 mm, points of 4 mm: the middle two of four hold half each, along both axes
    model = SensorModel(grid=SensorGrid(rows=1, columns=1), spread=1e-9, aperture=8e-3)
    weights = cell_weights(model, ControlGrid(rows=4, columns=4, pitch=4e-3)).reshape(4, 4)
    half = np.array([0, 0.5, 0.5, 0])
    assert weights == pytest.approx(np.outer(half, half), abs=1e-6)


def test_weights_agree_with_an_integral_over_the_plane():
    model = SensorModel(spread=2e-3, aperture=8e-3)
    grid = ControlGrid()
    weights = cell_weights(model, grid).reshape(16, 16, 16)
    # one point's square, by sums over a fine raster: spread by the gel, averaged over cell 5 (row 1, column 1)
    fine = (np.arange(200) + 0.5) / 200 - 0.5
    from_x = grid.x[6] + fine * grid.pitch
    cell_x = model.grid.x[1] + fine * model.aperture
    spread = np.exp(-(((from_x[:, None] - cell_x) / model.spread) ** 2) / 2) / (model.spread * np.sqrt(2 * np.pi))
    assert weights[5, :, 6].sum() == pytest.approx(spread.mean() * grid.pitch, rel=1e-4)


@pytest.mark.parametrize("between", ["steps", "lines"])
@pytest.mark.parametrize("centre", [(0.0, 0.0), (4e-3, -7e-3)])
def test_each_cell_reads_the_pressure_above_it(centre, between):
    sensor, grid = SensorGrid(rows=2, columns=3), ControlGrid(rows=20, columns=22, pitch=3e-3, centre=(2e-3, 5e-3))
    weights = cell_weights(SensorModel(grid=sensor), grid, centre=centre, between=between)
    # the centroid of a cell's weights is the cell's position, except for the steps of the grid
    for channel in range(sensor.count):
        heard = weights[channel] @ grid.position[:, :2]
        assert heard == pytest.approx(np.add(sensor.channel_position(channel), centre), abs=2e-4)


def heard(x, model=ALONE):
    """Share of a pressure at x in the mean of a cell at 0, along one axis, by definition."""
    ends = (x + model.aperture / 2, x - model.aperture / 2)
    return (ndtr(ends[0] / model.spread) - ndtr(ends[1] / model.spread)) / model.aperture


def test_lines_agree_with_an_integral_of_the_interpolated_pressure():
    points = ControlGrid(rows=9, columns=9, pitch=3e-3)
    pressure = np.random.default_rng(0).uniform(0, 1, 9)
    weights = cell_weights(ALONE, points, centre=(1e-3, 0.5e-3), between="lines").reshape(9, 9)

    def pressed(x):
        return heard(x - 1e-3) * np.interp(x, points.x, pressure, left=0, right=0)

    expected = quad(pressed, points.x[0], points.x[-1], points=list(points.x), limit=200)[0]
    # An even pressure along y, so that only its ends, where it fades over one pitch, are missing.
    assert weights.sum(axis=0) @ pressure == pytest.approx(expected, rel=1e-6)


@pytest.mark.long
@pytest.mark.parametrize("per_metre", [0.0, 40.0, 110.0, 160.0])
def test_waves_are_exact_below_half_the_points(per_metre):
    """A cosine is multiplied by the window's spectrum, sinc(f a) exp(-2 (pi f s)^2)."""
    points = ControlGrid(rows=1, columns=801, pitch=3e-3)
    weights = cell_weights(ALONE, points, between="waves")
    alone = cell_weights(ALONE, points, between="waves") @ np.ones(801)
    read = float(weights[0] @ np.cos(2 * np.pi * per_metre * points.x)) / float(alone[0])
    f, a, s = per_metre, ALONE.aperture, ALONE.spread
    assert read == pytest.approx(np.sinc(f * a) * np.exp(-2 * (np.pi * f * s) ** 2), abs=2e-3)


def test_sixteen_points_suffice_for_the_reading_of_a_cell():
    """Means of the squared field of four units, from 16 x 16 points and from points four times as close."""
    array, rng = TransducerArray.autd3(), np.random.default_rng(0)
    sensor = SensorModel(grid=SensorGrid(rows=3, columns=3, pitch=5e-3))
    q = np.exp(1j * rng.uniform(-np.pi, np.pi, array.count))
    q *= np.exp(1j * np.angle(transfer_matrix(np.array([[2e-3, 1e-3, 0.2]]), array)[0].conj()))
    read = []
    for points, between in ((ControlGrid(), "waves"), (ControlGrid(rows=64, columns=64, pitch=11e-3 / 12), "steps")):
        field = np.abs(transfer_matrix(points, array, acoustics=Acoustics()) @ q) ** 2
        read.append(cell_weights(sensor, points, between=between) @ field)
    assert np.linalg.norm(read[0] - read[1]) < 0.01 * np.linalg.norm(read[1])


def test_an_unknown_pressure_between_points_is_refused():
    with pytest.raises(InputError, match="between: expected one of steps, lines, waves, got 'dots'"):
        cell_weights(SensorModel(), ControlGrid(), between="dots")
