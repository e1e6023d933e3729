import numpy as np
import pytest

from midair.model import PressureFrames, Recording, SensorGrid, SensorWiring, known_unit


def test_times_are_exact_multiples_of_the_period_and_pressure_may_pull():
    recording = Recording(samples=np.zeros((1001, 4, 4)), rate=1000.0)
    assert recording.frames == 1001
    assert recording.duration == 1.001
    assert recording.time[1000] == 1.0
    assert recording.unit == "V"
    sensor = SensorGrid(rows=2, columns=3)
    frames = PressureFrames(pressure=-np.ones((5, 2, 3)), rate=200.0, sensor=sensor)
    assert frames.frames == 5
    assert frames.time == pytest.approx([0, 0.005, 0.01, 0.015, 0.02])
    assert frames.band is None
    assert not frames.pressure.flags.writeable


def test_cells_are_taken_from_the_channels_that_they_are_wired_to_in_order_without_a_sensor_file():
    wiring = SensorWiring(grid=SensorGrid(rows=2, columns=2), order=(3, 0, 5, 1))
    frame = np.array([[10.0, 11, 12, 13, 14, 15]])
    np.testing.assert_array_equal(wiring.arrange(frame), [[[13, 10], [15, 11]]])
    assert wiring.channels == 6
    for channels, shape in {1: (1, 1), 16: (4, 4), 17: (1, 17), 64: (8, 8)}.items():
        wiring = SensorWiring.for_channels(channels)
        assert (wiring.grid.shape, wiring.order) == (shape, tuple(range(channels)))


def test_a_cut_keeps_the_frames_of_its_time():
    frames = PressureFrames(pressure=np.arange(1000.0)[:, None, None] * np.ones((4, 4)), rate=1000.0)
    part = frames.cut(0.2, 0.3)
    assert part.pressure[[0, -1], 0, 0].tolist() == [200, 499]
    assert part.time[0] == 0
    assert part.provenance.steps[-1].settings == {"start_s": 0.2, "duration_s": 0.3}
    assert frames.cut(0.9).frames == 100
    assert frames.cut(0.9, 5.0).frames == 100
    assert frames.cut().frames == 1000


SPELLINGS = {
    **{"V": ("V", 1), " Volts ": ("V", 1), "mV": ("V", 1e-3), "microvolts": ("V", 1e-6), "µV": ("V", 1e-6)},
    **{"MicroVolts": ("V", 1e-6), "counts": ("count", 1), "mcounts": (None, 1), "m/s^2": (None, 1), "": (None, 1)},
    **{"Pa": ("Pa", 1), "kPa": ("Pa", 1e3), "hPa": ("Pa", 1e2), "mPa": ("Pa", 1e-3), "MPa": ("Pa", 1e6)},
}


def test_spellings():
    assert {text: known_unit(text) for text in SPELLINGS} == SPELLINGS
