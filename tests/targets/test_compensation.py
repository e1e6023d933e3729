import numpy as np
import pytest

from midair.model import AmplitudeFrames, ControlGrid, Drive, PressureFrames, TransducerArray
from midair.physics import PlaybackChain, TransducerDynamics, Transducers, playback_response, simulate, transfer_matrix
from midair.targets import precompensate, precompensate_sound

RATE = 4000.0
POINT = np.array([[0.0, 0.0, 0.2]])
ARRAY = TransducerArray(position=np.zeros((1, 3)), normal=np.array([[0, 0, 1.0]]))


def wave(frequency, rate=RATE, frames=4000):
    x = np.cos(2 * np.pi * frequency * np.arange(frames) / rate)
    return PressureFrames(pressure=np.broadcast_to(x[:, None, None], (frames, 4, 4)), rate=rate)


def test_the_gain_by_hand():
    """1 / sinc(f / R)^n * sqrt(1 + (2 pi f tau)^2), tau = 188 us, no detuning.

    400 Hz at 1 kHz: 1.32131 * 1.10601 = 1.4614; 200 Hz with ramps: 1.06896^2 * 1.02753 = 1.1741;
    470 Hz at 4 kHz: 1.02308 * 1.14378 = 1.1702.
    """
    gains = {(400.0, 1000.0, 0.0): 1.4614, (200.0, 1000.0, 1e-3): 1.1741, (470.0, 4000.0, 0.0): 1.1702}
    still, found = TransducerDynamics(detuning=0.0), {}
    for frequency, rate, ramp in gains:
        louder = precompensate(wave(frequency, rate), dynamics=still, ramp=ramp).pressure[1000:3000, 1, 1]
        found[frequency, rate, ramp] = louder.std() * np.sqrt(2)
    assert found == pytest.approx(gains, rel=3e-3)
    for outside in map(wave, (2.0, 600.0, 1500.0)):
        same = precompensate(outside).pressure[1000:3000]
        np.testing.assert_allclose(same, outside.pressure[1000:3000], atol=1e-2)


def test_playing_compensated_pressure_gives_the_original():
    x = wave(230.0)
    frequency = np.fft.rfftfreq(4000, 1 / RATE)
    played = np.fft.rfft(precompensate(x).pressure[:, 0, 0]) * playback_response(frequency, RATE)
    again = np.fft.irfft(played, 4000)
    np.testing.assert_allclose(again[1000:3000], x.pressure[1000:3000, 0, 0], atol=5e-3)


def played_pressure(amplitude, rate):
    drive = Drive(phase=np.zeros((len(amplitude), 1)), level=0.5 * amplitude, rate=rate, array=ARRAY)
    chain = PlaybackChain(phase_bits=None, transducers=Transducers.alike(1), precision="double")
    return simulate(drive, transfer_matrix(POINT, ARRAY), chain=chain, rate=64e3)[:, 0]


@pytest.mark.long
def test_a_modulated_transducer_presses_as_asked_in_level_and_time():
    """One transducer, pressure 1 + .05 x: the pressure's modulation at 400 Hz with and without compensation."""

    def modulation(asked, rate):
        pressure = played_pressure(np.sqrt(1 + 0.05 * asked.pressure[:, 0, 0]), rate)[6400:-6400]
        time = (np.arange(len(pressure)) + 6401) / 64e3
        return 2 * np.mean(pressure * np.exp(-2j * np.pi * 400.0 * time)) / np.mean(pressure) / 0.05

    for rate in (1000.0, 4000.0):
        x = wave(400.0, rate, int(rate))
        assert np.abs(modulation(x, rate)) < 0.92, rate
        assert modulation(precompensate(x), rate) == pytest.approx(1.0, abs=0.02), rate


def strong(rate):
    """Pressure that goes down to a tenth of its peak, with the root that its sound needs."""
    time = np.arange(int(rate)) / rate
    return 0.55 + 0.3 * np.cos(2 * np.pi * 250 * time) + 0.15 * np.cos(2 * np.pi * 400 * time + 1)


def misfit(pressure, rate):
    """Distortion of both tones and of all else up to 480 Hz, as a part of the two tones."""
    x, y = np.roll(strong(64e3), -1), pressure / pressure[6400:-6400].mean() * 0.55  # samples are at the ends of steps
    spectra = [np.fft.rfft(z[6400:-6400])[5:385] for z in (x, y)]
    return np.linalg.norm(spectra[1] - spectra[0]) / np.linalg.norm(spectra[0])


@pytest.mark.long
def test_large_changes_come_out_right_when_the_sound_is_compensated():
    """The envelope is linear in sound and not in pressure: compensating pressure is right to first order only."""
    rate = 4000.0
    pressure = PressureFrames(pressure=np.tile(strong(rate)[:, None, None], (1, 4, 4)), rate=rate)
    louder = precompensate(pressure).pressure[:, 0, 0]
    target = AmplitudeFrames(amplitude=np.sqrt(strong(rate))[:, None], rate=rate, grid=ControlGrid(rows=1, columns=1))
    sound = precompensate_sound(target).amplitude[:, 0]
    assert max(louder.max(), sound.max()) < 2
    bare, by_pressure, by_sound = (
        misfit(played_pressure(each, rate), rate) for each in (np.sqrt(strong(rate)), np.sqrt(louder), sound)
    )
    assert bare > 0.1
    assert by_sound < 0.003
    assert by_sound < by_pressure / 3


def test_sound_is_never_negative_and_the_step_is_in_the_provenance():
    amplitude = np.zeros((400, 1))
    amplitude[200] = 1.0
    louder = precompensate_sound(AmplitudeFrames(amplitude=amplitude, rate=4000.0, grid=ControlGrid(rows=1, columns=1)))
    assert louder.amplitude.min() == 0
    assert louder.amplitude.max() > 1
    assert louder.provenance.steps[-1].stage == "precompensate sound"
