import numpy as np
import pytest

from midair.errors import InputError, NonFiniteError, ShapeError, UnitError
from midair.model import AmplitudeFrames, PressureFrames, Recording, SensorGrid, SensorWiring, known_unit


def test_times_are_exact_multiples_of_the_period():
    recording = Recording(samples=np.zeros((1001, 4, 4)), rate=1000.0)
    assert recording.frames == 1001
    assert recording.duration == 1.001
    assert recording.time[1000] == 1.0
    assert recording.unit == "V"


def test_the_samples_are_a_copy():
    samples = np.zeros((3, 4, 4))
    recording = Recording(samples=samples, rate=1000.0)
    samples[:] = 1
    assert not recording.samples.any()
    with pytest.raises(ValueError, match="read-only"):
        recording.samples[0, 0, 0] = 1


@pytest.mark.parametrize(
    ("changes", "error", "says"),
    [
        ({"samples": np.zeros((3, 16))}, ShapeError, r"\(frame, 4, 4\), got shape \(3, 16\)"),
        ({"samples": np.zeros((0, 4, 4))}, ShapeError, "samples"),
        ({"sensor": SensorGrid(rows=2)}, ShapeError, r"\(frame, 2, 4\)"),
        ({"samples": np.full((3, 4, 4), np.nan)}, NonFiniteError, "nan"),
        ({"rate": 0}, InputError, "rate: expected a number above 0 Hz"),
        ({"unit": "mV"}, UnitError, "V, count, Pa, got 'mV'"),
    ],
)
def test_bad_input_is_refused(changes, error, says):
    with pytest.raises(error, match=says):
        Recording(**({"samples": np.zeros((3, 4, 4)), "rate": 1000.0} | changes))


def test_cells_are_taken_from_the_channels_that_they_are_wired_to():
    wiring = SensorWiring(grid=SensorGrid(rows=2, columns=2), order=(3, 0, 5, 1))
    frame = np.array([[10.0, 11, 12, 13, 14, 15]])
    np.testing.assert_array_equal(wiring.arrange(frame), [[[13, 10], [15, 11]]])
    assert wiring.channels == 6


@pytest.mark.parametrize(("channels", "shape"), [(1, (1, 1)), (16, (4, 4)), (17, (1, 17)), (64, (8, 8))])
def test_cells_without_a_sensor_file(channels, shape):
    wiring = SensorWiring.for_channels(channels)
    assert wiring.grid.shape == shape
    assert wiring.order == tuple(range(channels))


@pytest.mark.parametrize("order", [(0,) * 16, tuple(range(15)), tuple(range(17)), (-1, *range(15))])
def test_orders_that_make_no_sense(order):
    with pytest.raises(ShapeError, match="expected 16 different numbers from 0 on"):
        SensorWiring(order=order)


def test_other_values_that_make_no_sense():
    with pytest.raises(UnitError, match="got 'mV'"):
        SensorWiring(unit="mV")
    with pytest.raises(InputError, match="full scale: expected a number above 0 V"):
        SensorWiring(unit="V", full_scale=0.0)
    for sensitivity in (0.0, float("nan")):
        with pytest.raises(InputError, match="sensitivity: expected a number other than 0 V/Pa"):
            SensorWiring(unit="V", sensitivity=sensitivity)
    with pytest.raises(ShapeError, match="at least 1, got 0"):
        SensorWiring.for_channels(0)


@pytest.mark.parametrize("shape", [(3, 15), (16,)])
def test_too_few_channels_are_refused(shape):
    with pytest.raises(ShapeError, match=r"16 channels or more.*correct the order"):
        SensorWiring().arrange(np.zeros(shape))


def test_pressure_may_pull_and_keeps_its_sensor():
    sensor = SensorGrid(rows=2, columns=3)
    frames = PressureFrames(pressure=-np.ones((5, 2, 3)), rate=200.0, sensor=sensor)
    assert frames.frames == 5
    assert frames.time == pytest.approx([0, 0.005, 0.01, 0.015, 0.02])
    assert frames.band is None
    assert not frames.pressure.flags.writeable


def test_a_cut_keeps_the_frames_of_its_time():
    frames = PressureFrames(pressure=np.arange(1000.0)[:, None, None] * np.ones((4, 4)), rate=1000.0)
    part = frames.cut(0.2, 0.3)
    assert part.pressure[[0, -1], 0, 0].tolist() == [200, 499]
    assert part.time[0] == 0
    assert part.provenance.steps[-1].settings == {"start_s": 0.2, "duration_s": 0.3}
    assert frames.cut(0.9).frames == 100
    assert frames.cut(0.9, 5.0).frames == 100
    assert frames.cut().frames == 1000


@pytest.mark.parametrize("part", [(1.0, None), (-0.1, 0.5), (0.5, 0.0), (0.5, -0.2)])
def test_a_cut_of_nothing_is_refused(part):
    with pytest.raises(InputError, match="a part of 0 to 1 s, got"):
        PressureFrames(pressure=np.zeros((1000, 4, 4)), rate=1000.0).cut(*part)


@pytest.mark.parametrize(
    ("pressure", "rate", "error", "says"),
    [
        (np.zeros((5, 4, 3)), 1.0, ShapeError, r"pressure: expected axes \(frame, 4, 4\), got shape \(5, 4, 3\)"),
        (np.zeros((0, 4, 4)), 1.0, ShapeError, "pressure"),
        (np.full((5, 4, 4), np.inf), 1.0, NonFiniteError, "pressure.*inf"),
        (np.zeros((5, 4, 4)), -1.0, InputError, "rate.*-1"),
    ],
)
def test_bad_pressure_is_refused(pressure, rate, error, says):
    with pytest.raises(error, match=says):
        PressureFrames(pressure=pressure, rate=rate)


@pytest.mark.parametrize(
    ("amplitude", "rate", "error", "says"),
    [
        (np.zeros((5, 255)), 1.0, ShapeError, "amplitude.*256"),
        (np.full((5, 256), -2.0), 1.0, InputError, "0 Pa or more, got -2 Pa"),
        (np.full((5, 256), np.nan), 1.0, NonFiniteError, "amplitude"),
        (np.zeros((5, 256)), 0.0, InputError, "rate"),
    ],
)
def test_bad_amplitude_is_refused(amplitude, rate, error, says):
    with pytest.raises(error, match=says):
        AmplitudeFrames(amplitude=amplitude, rate=rate)


@pytest.mark.parametrize(
    ("text", "unit", "factor"),
    [
        ("V", "V", 1),
        (" Volts ", "V", 1),
        ("mV", "V", 1e-3),
        ("microvolts", "V", 1e-6),
        ("µV", "V", 1e-6),
        ("Pa", "Pa", 1),
        ("kPa", "Pa", 1e3),
        ("counts", "count", 1),
        ("m/s^2", None, 1),
        ("", None, 1),
        ("hPa", "Pa", 1e2),
        ("mPa", "Pa", 1e-3),
        ("MPa", "Pa", 1e6),
        ("MicroVolts", "V", 1e-6),
        ("mcounts", None, 1),
    ],
)
def test_spellings(text, unit, factor):
    assert known_unit(text) == (unit, factor)
