"""The noise in the headphones, as a program at the other end of JACK hears it."""

import contextlib
import importlib
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tests.devices.sensors.conftest import _environment, _imported, _needs, _portaudio, _started_jack

from midair.errors import InputError, UnknownDeviceError
from midair.study.design.study_design import MaskingNoise
from midair.study.headphones import Headphones

RATE = 48000


@contextlib.contextmanager
def ears(folder):
    """JACK and somebody who hears; gives a function that ends the hearing and returns what was heard."""
    _needs("jackd", "jackd2")
    _imported("jack", "libjack-jackd2-0")
    quiet = _environment(JACK_NO_START_SERVER="1", JACK_NO_AUDIO_RESERVATION="1")
    with quiet, _portaudio() as let_go, _started_jack(RATE) as (name, server), _environment(JACK_DEFAULT_SERVER=name):
        command = [sys.executable, str(Path(__file__).parent / "ears.py"), str(folder / "heard.npy")]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as listener:
            assert listener.stdout.readline().strip() == "ready"
            # A program that is started now would see the server; this one has looked before.
            let_go()
            importlib.import_module("sounddevice")._initialize()

            def heard():
                listener.stdin.write("end\n")
                listener.stdin.flush()
                assert listener.stdout.readline().strip() == "saved"
                return np.load(folder / "heard.npy")

            try:
                yield heard
            finally:
                let_go()
                server.terminate()
                with contextlib.suppress(subprocess.TimeoutExpired):
                    server.wait(5)
                listener.kill()


def decibels(samples):
    """rms over that of the largest sine, in dB."""
    return 20 * np.log10(np.sqrt(2 * np.mean(np.square(samples))))


def test_jack_hears_white_noise_at_the_stated_level_while_it_is_on_and_nothing_else(tmp_path):
    noise = MaskingNoise(level_dbfs=-20, ramp_s=0.05)
    with ears(tmp_path) as heard:
        with Headphones(noise, device="ears", seed=1) as phones:
            assert phones.rate == RATE
            for _ in range(2):
                phones.on()
                subprocess.run([sys.executable, "-c", "import time; time.sleep(.3)"], check=True)
                phones.off()
        samples = heard()
    np.testing.assert_array_equal(samples[:, 0], samples[:, 1])
    loud = np.abs(samples[:, 0]) > 0
    edges = np.flatnonzero(np.diff(np.concatenate(([False], np.convolve(loud, np.ones(500)) > 0, [False])).astype(int)))
    assert len(edges) == 4, "two bursts, and silence before, between and after"
    ramp = round(noise.ramp_s * RATE)
    for begin, end in edges.reshape(2, 2):
        inside = samples[begin + ramp : end - 500 - ramp, 0]
        assert len(inside) > 0.2 * RATE
        assert decibels(inside) == pytest.approx(-20, abs=0.2)
        assert decibels(samples[begin : begin + ramp // 4, 0]) < -32  # it swells
        power = np.abs(np.fft.rfft(inside)) ** 2
        bands = 10 * np.log10([part.mean() for part in np.array_split(power, 8)])
        assert np.ptp(bands) < 1.0  # white


def test_levels_that_would_be_clipped_are_refused():
    with pytest.raises(InputError, match="level_dbfs from -90 to -2 dB, got -1"):
        MaskingNoise(level_dbfs=-1)
    bound = Headphones(MaskingNoise(level_dbfs=-2))._bound
    assert 0.95 < bound < 1


@pytest.mark.parametrize(
    ("full_scale", "said"), [(None, "not known: measure the headphones"), (105.0, "at -20 dB .*, 85 dB SPL$")]
)
def test_the_level_is_stated(full_scale, said):
    assert re.search(said, MaskingNoise(level_dbfs=-20, full_scale_db=full_scale).said)


def test_headphones_that_are_not_there():
    _imported("sounddevice", "libportaudio2")
    with (
        pytest.raises(UnknownDeviceError, match=r"headphones: .*lists outputs"),
        Headphones(MaskingNoise(level_dbfs=-20), device="no such thing"),
    ):
        pass
