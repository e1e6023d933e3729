import numpy as np
import pytest

from midair.calibration import CausalInverse
from midair.errors import InputError
from midair.model import Acoustics, Calibration, ControlGrid, Drive, PressureFrames, SensorGrid, TransducerArray
from midair.physics import SensorModel, calibration_of, focus_amplitude, propagate
from midair.rig.live_touch.live_settings import LiveSettings
from midair.rig.live_touch.touch import Touch
from midair.targets import decouple, prepare

SENSOR = SensorGrid()
KNOWN = calibration_of(SensorModel().with_spread(seed=3))
ARRAY = TransducerArray.autd3(columns=1, rows=1)
SMALL = ControlGrid(rows=8, columns=8, pitch=22e-3 / 3)

pytest.importorskip("numba")


def touch(calibration=KNOWN, **settings):
    return Touch(LiveSettings(**settings), calibration, SENSOR, 1000.0, ARRAY, 1.0, grid=SMALL)


def felt(rng, frames=3, size=20.0):
    return size * rng.standard_normal((frames, 4, 4))


@pytest.mark.parametrize(("mapping", "offset"), [("half-wave", None), ("constant-offset", 15.0)])
def test_targets_equal_those_of_the_stages(mapping, offset):
    """Decoupled, mapped, gained and interpolated as by `prepare`, over the focus of the array."""
    pressure = felt(np.random.default_rng(1))
    live = touch(None, mapping=mapping, offset=offset, gain=1.7, acoustics=Acoustics())
    apart = decouple(PressureFrames(pressure=pressure, rate=1000.0), grid=SMALL)
    lifted = np.maximum(1.7 * apart.pressure + (offset or 0.0), 0.0)
    target = prepare(PressureFrames(pressure=lifted, rate=1000.0), grid=SMALL, interpolate="pressure")
    focus = focus_amplitude(SMALL, ARRAY)
    for frame, wanted in zip(pressure, target.amplitude, strict=True):
        live.feel(frame.ravel())
        assert live.form()
        assert live.wanted == pytest.approx(wanted / focus, abs=1e-9)


def test_phases_press_where_it_was_felt():
    """One cell alone, held: the field of the phases, worked out by `propagate`, is highest at that cell."""
    live = touch(None)
    frame = np.zeros((4, 4))
    frame[1, 2] = 5.0
    for _ in range(30):
        live.feel(frame.ravel())
        assert live.form()
    drive = Drive(phase=2 * np.pi * live.phases[None] / 256, level=np.ones(1), rate=1000.0, array=ARRAY)
    field = np.abs(propagate(drive, SMALL)).reshape(8, 8)
    row, column = np.unravel_index(field.argmax(), field.shape)
    assert abs(SMALL.y[row] - SENSOR.y[1]) < 6e-3
    assert abs(SMALL.x[column] - SENSOR.x[2]) < 6e-3


def test_the_causal_inverse_has_the_stated_delay_and_error():
    live = touch(delay=0.004)
    samples = np.random.default_rng(2).standard_normal((40, 16))
    alone = CausalInverse(KNOWN, 1000.0, delay=0.004).push(samples.reshape(40, 4, 4))
    for sample, pressure in zip(samples, alone, strict=True):
        live.feel(sample)
        assert live.pressure == pytest.approx(pressure.ravel())
    assert live.delay == 0.004
    assert len(live.error) == len(live.parts) == 3
    assert touch(None).error is None
    assert touch(None).delay == 0.0


def test_noise_below_the_threshold_is_silent():
    live = touch(None, faintest=0.5)
    live.feel(np.full(16, 0.01))
    assert not live.form()
    live.feel(np.full(16, 5.0))
    assert live.form()
    live.feel(np.full(16, -5.0))
    assert not live.form()


def test_the_slow_bias_has_the_stated_delay():
    live = touch(None, mapping="slow-bias")
    assert live.delay == pytest.approx(0.09, abs=0.002)
    frames = round(live.delay * 1000)
    formed = []
    for number in range(2 * frames):
        live.feel(np.full(16, 10.0 if number >= 20 else 0.0))
        formed.append(live.form())
    assert not any(formed[: frames + 19])
    assert all(formed[frames + 20 :])


def test_a_band_beyond_the_rate_or_settings_that_make_no_sense_are_refused():
    for wrong in ({"delay": 0.02}, {"gain": 0.0}, {"faintest": -1.0}):
        with pytest.raises(InputError):
            LiveSettings(**wrong)
    slow = Calibration.flat(SENSOR)
    with pytest.raises(InputError):
        Touch(LiveSettings(), slow, SENSOR, 500.0, ARRAY, 1.0)


def test_a_rehearsal_counts_late_frames_and_leaves_the_stream_as_it_was():
    frames, alike, rehearsed = felt(np.random.default_rng(4)), touch(None), touch(None)
    late = rehearsed.rehearse(1000.0, -1.0, frames=20)
    assert (late.frames, late.late) == (20, 20)
    assert "too slow or too busy" in late.words()
    quick = rehearsed.rehearse(1000.0, 10.0, frames=20)
    assert quick.late == 0
    assert 0 < quick.longest < 10
    assert quick.words().endswith("this computer keeps up")
    assert not rehearsed.phases.any()
    for frame in frames:
        for one in (alike, rehearsed):
            one.feel(frame.ravel())
            assert one.form()
        assert alike.phases.tobytes() == rehearsed.phases.tobytes()


def test_a_latency_is_the_sum_of_its_parts_and_buys_a_better_filter():
    live = touch(latency=0.2, rate=2000.0)
    assert live.delay + live.hold + 0.4e-3 + 0.2 / live.settings.acoustics.medium.speed == pytest.approx(0.2)
    assert live.hold == pytest.approx(0.02)
    assert live.frames_each == 2
    assert (live.error < 0.25 * live.usual).all()
    np.testing.assert_allclose(live.usual, touch().error)
    assert touch(latency=0.2).frames_each == 1
    kept = touch(latency=0.2, rate=2000.0, delay=0.004)
    assert kept._inverse.delay == 0.004
    assert kept.delay + kept.hold == pytest.approx(live.delay + live.hold)
    with pytest.raises(InputError, match="expected at least"):
        touch(latency=0.2, band=(10.0, 470.0))
    with pytest.raises(InputError, match="expected --latency with it"):
        touch(rate=4000.0)
    with pytest.raises(InputError, match="1 to 4 times the sensor's 1000 Hz"):
        touch(latency=0.2, rate=2500.0)


def test_frames_between_those_of_the_sensor_follow_a_tone():
    """A tone of 100 Hz at 1 kHz, interpolated to 4 kHz: 8 frames late, and as it would have been sampled."""
    live = touch(None, latency=0.2, rate=4000.0, mapping="constant-offset", offset=10.0, acoustics=Acoustics())
    assert live.settings.mapping == "constant-offset"
    found = []
    for number in range(40):
        live.feel(np.full(16, 5 * np.sin(2 * np.pi * 0.1 * number)))
        for part in range(4):
            assert live.form(part=part) or number < 8
            found.append((number - 8 + part / 4, live._pushes[5]))
    time, pressure = np.array(found[80:]).T
    same = decouple(PressureFrames(pressure=np.ones((1, 4, 4)), rate=1000.0), grid=SMALL).pressure[0, 1, 1]
    np.testing.assert_allclose(pressure, 10 + 5 * same * np.sin(2 * np.pi * 0.1 * time), atol=0.02)
