from dataclasses import replace

import numpy as np
import pytest

from midair.calibration import CausalInverse
from midair.model import Acoustics, Calibration, ControlGrid, Drive, PressureFrames, SensorGrid, TransducerArray
from midair.physics import SensorModel, calibration_of, focus_amplitude, playback_response, propagate
from midair.rig.live_touch.live_settings import LiveSettings
from midair.rig.live_touch.touch import Touch
from midair.targets import decouple, prepare

SENSOR = SensorGrid()
KNOWN = calibration_of(SensorModel().with_spread(seed=3))
ARRAY = TransducerArray.autd3(columns=1, rows=1)
SMALL = ControlGrid(rows=8, columns=8, pitch=22e-3 / 3)

pytestmark = pytest.mark.usefixtures("live_kernel")


def touch(calibration=KNOWN, **settings):
    return Touch(LiveSettings(**settings), calibration, SENSOR, 1000.0, ARRAY, 1.0, grid=SMALL)


def felt(rng, frames=3, size=20.0):
    return size * rng.standard_normal((frames, 4, 4))


@pytest.mark.long
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


def test_measured_transducers_bring_the_pattern_nearer_to_its_target():
    """Transducers of the spread of published boards: .2 rad; the field is that of the true ones."""
    rng, count = np.random.default_rng(4), ARRAY.count
    response = (1 + 0.1 * rng.standard_normal(count)) * np.exp(0.2j * rng.standard_normal(count))
    true = replace(ARRAY, response=response, pole=np.full(count, -5000 + 0j))
    frame, error = np.zeros((4, 4)), []
    frame[1, 2] = 5.0
    for assumed in (ARRAY, true):
        live = Touch(LiveSettings(), None, SENSOR, 1000.0, assumed, 1.0, grid=SMALL)
        for _ in range(30):
            live.feel(frame.ravel())
            live.form()
        drive = Drive(phase=2 * np.pi * live.phases[None] / 256, level=np.ones(1), rate=1000.0, array=true)
        field, wanted = np.abs(propagate(drive, SMALL)).ravel(), live.wanted
        scale = field @ wanted / (wanted @ wanted)
        error.append(np.linalg.norm(field - scale * wanted) / np.linalg.norm(scale * wanted))
    assert error[1] < 0.8 * error[0]


def test_the_causal_inverse_has_the_stated_delay_and_error():
    live = touch(delay=0.004)
    samples = np.random.default_rng(2).standard_normal((40, 16))
    alone = CausalInverse(KNOWN, 1000.0, delay=0.004).push(samples.reshape(40, 4, 4))
    for sample, pressure in zip(samples, alone, strict=True):
        live.feel(sample)
        assert live.pressure[0] == pytest.approx(pressure.ravel())
    assert live.delay == 0.004
    assert len(live.error) == len(live.parts) == 3
    assert touch(None).error is None
    assert touch(None).delay == 0.0


@pytest.mark.long
def test_with_a_latency_two_frames_are_interpolated_and_compensated_for_playback():
    live, taken = touch(Calibration.flat(SENSOR, unit="Pa"), latency=0.2), np.arange(1000) / 1000
    made = []
    for sine in np.sin(200 * np.pi * taken):
        live.feel(np.full(16, sine))
        made.append(live.pressure[:, 5].copy())
    steady, times = np.concatenate(made)[1000:], np.arange(1000, 2000) / 2000
    got = 2j * (steady * np.exp(-200j * np.pi * times)).mean()
    late = np.exp(-200j * np.pi * live.schedule.delay)
    assert got == pytest.approx(late / playback_response(np.array(100.0), 2000.0), abs=0.01)
    assert live.delay + live.schedule.hold == pytest.approx(0.2, abs=0.002)


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
