import numpy as np
import pytest

from midair.calibration.measure.referenced_take import noise_signal, sweep_signal
from midair.errors import InputError


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
    with pytest.raises(InputError, match="above 0 Hz"):
        sweep_signal(1, 1, band=(0, 100))
