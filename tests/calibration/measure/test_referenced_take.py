import numpy as np
import pytest

from midair.calibration import Reference, ReferencedTake, calibrate, measure_calibration
from midair.calibration.measure.referenced_take import noise_signal, sweep_signal
from midair.errors import BandError, MismatchError
from midair.model import Provenance, Recording, SensorGrid
from midair.physics import sense

RATE = 1000.0


def recording(frames=8000, *, sensor=None, rate=RATE, unit="V", seed=0):
    sensor = sensor or SensorGrid(rows=1, columns=2)
    samples = np.random.default_rng(seed).standard_normal((frames, *sensor.shape))
    return Recording(samples=samples, rate=rate, sensor=sensor, unit=unit)


def reference(frames=8000, **changes):
    pressure = noise_signal(2, frames / RATE, rng=np.random.default_rng(1))
    return Reference(**({"pressure": pressure, "rate": RATE} | changes))


def test_volts_over_the_sensitivity_are_pascals_and_a_level_is_the_rms_of_what_changes():
    said = recording(sensor=SensorGrid(rows=1, columns=3, name="hydrophone"))
    told = Reference.read(said, sensitivity=0.05, channel=2, uncertainty=0.01)
    assert told.pressure == pytest.approx(said.samples[:, 0, 2] / 0.05)
    assert (told.uncertainty, told.name, told.rate) == (0.01, "hydrophone", RATE)
    take = ReferencedTake(recording=recording(), reference=reference(pressure=7 + 3 * np.tile([1.0, -1.0], 4000)))
    assert take.level == pytest.approx(3.0)
    assert take.presses().tolist() == [True, True]
    assert ReferencedTake(recording=recording(), reference=reference(), cell=1).presses().tolist() == [False, True]


def takes(bench, *cells, **changes):
    rng = np.random.default_rng(0)
    return [bench(0, **changes).take(noise_signal(5, 8, rng=rng), cell=cell) for cell in cells]


def test_takes_that_do_not_belong_together_are_refused(bench):
    one = takes(bench, None)[0]
    other = ReferencedTake(recording=recording(), reference=reference())
    with pytest.raises(MismatchError, match=r"takes: expected all of sensor 'sensor' \(4, 4\)"):
        measure_calibration([one, other])
    with pytest.raises(MismatchError, match="quiet recording"):
        measure_calibration([one], quiet=recording())
    with pytest.raises(MismatchError, match="no take on cells 2, 3, 4"):
        measure_calibration(takes(bench, None, 0, 1))
    other = Reference(pressure=noise_signal(5, 8, rng=np.random.default_rng(9)), rate=RATE)
    with pytest.raises(BandError, match=r"coherence of 0\.9 on every live channel, got [01];"):
        measure_calibration([ReferencedTake(recording=one.recording, reference=other)])


def test_a_dead_channel_has_no_response_and_is_uncertain(bench):
    take = takes(bench, None)[0]
    samples = np.array(take.recording.samples)
    samples[:, 2, 3] = 0.1
    dead = Recording(samples=samples, rate=RATE, sensor=take.recording.sensor)
    found = measure_calibration([ReferencedTake(recording=dead, reference=take.reference)])
    assert not found.response[:, 2, 3].any()
    assert (found.measurement.magnitude_uncertainty[:, 2, 3] == 1).all()
    assert np.median(found.measurement.magnitude_uncertainty) < 3e-3


def test_provenance_records_the_settings(bench):
    found = measure_calibration(takes(bench, None, reference_uncertainty=0.01), date="2026-01-31", version=4)
    assert (found.date, found.version) == ("2026-01-31", 4)
    assert found.provenance.simulated
    step = found.provenance.steps[-1]
    assert step.stage == "measure calibration"
    assert step.settings["levels_pa"] == pytest.approx((5,), rel=0.01)
    assert found.measurement.reference == "virtual reference"
    assert "repeatability is not known" in found.measurement.method
    real = Recording(samples=takes(bench, None)[0].recording.samples, rate=RATE, provenance=Provenance(source="lab"))
    told = Reference(pressure=takes(bench, None)[0].reference.pressure, rate=RATE)
    assert not measure_calibration([ReferencedTake(recording=real, reference=told)]).provenance.simulated


def test_a_measured_calibration_inverts_the_sensor_where_it_is_coherent(bench):
    """Above 300 Hz there is only the sensor's noise."""
    lab, rng = bench(0), np.random.default_rng(5)
    take = lab.take(noise_signal(10, 20, band=(5.0, 300.0), rng=rng))
    found = measure_calibration([take], date="2026-01-31")
    assert found.frequency[0] <= 6
    assert 296 <= found.frequency[-1] <= 304
    other = 10 * rng.standard_normal((3000, 4, 4))
    volts = Recording(samples=sense(lab.model, other, RATE, rng=rng), rate=RATE)
    with pytest.raises(BandError, match="within the calibration's"):
        calibrate(volts, found)
    heard = calibrate(volts, found, band=(20.0, 280.0))
    wanted = calibrate(Recording(samples=other, rate=RATE, unit="Pa"), band=(20.0, 280.0))
    middle = slice(500, -500)
    error = heard.pressure[middle] - wanted.pressure[middle]
    assert np.sqrt(np.mean(error**2) / np.mean(wanted.pressure[middle] ** 2)) < 0.01
    assert heard.provenance.steps[-1].settings["calibration_date"] == "2026-01-31"


def test_signals_have_the_stated_properties():
    noise = noise_signal(3.0, 20, band=(50, 200), rng=np.random.default_rng(0))
    spectrum = np.abs(np.fft.rfft(noise)) ** 2
    frequency = np.fft.rfftfreq(len(noise), 1e-3)
    assert noise.std() == pytest.approx(3.0)
    assert spectrum[(frequency < 49.9) | (frequency > 200.1)].sum() < 1e-20 * spectrum.sum()
    sweep = sweep_signal(2.0, 10, band=(20, 400), silence=0.5)
    assert len(sweep) == 11000
    assert not sweep[:500].any()
    assert not sweep[-500:].any()
    assert sweep[2000:9000].std() == pytest.approx(2.0, rel=0.01)
    # an exponential sweep passes the geometric mean of its band half way through: 89.4 Hz, a zero every 5.6 ms
    middle = sweep[5250:5750]
    assert np.count_nonzero(np.diff(np.sign(middle))) / 2 / 0.5 == pytest.approx(89.4, abs=2)
