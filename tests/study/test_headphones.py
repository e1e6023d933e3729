"""Masking noise in the headphones, recorded by another JACK client."""

import contextlib
import importlib
import io
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from tests.devices.sensors.conftest import _environment, _imported, _needs, _portaudio, _started_jack
from tests.drives import save_drive
from tests.waiting import wait_until

from midair.cli import run as midair
from midair.errors import UnknownDeviceError
from midair.study.design.study_design import MaskingNoise
from midair.study.folder import StudyFolder
from midair.study.session.event_log import read_events
from midair.study.session.presenters import Headphones

RATE = 48000
TWO_STIMULI = """
name = "two"
participants = 1
seed = 1
cue = ""
noise = { level_dbfs = -30, ramp_s = 0.05 }
questions = [{ name = "felt", kind = "yes-no", text = "Felt?" }]
stimuli = [{ name = "a", source = "a.drive.h5" }, { name = "n", kind = "silence" }]
blocks = [{ name = "b", stimuli = ["a", "n"], questions = ["felt"], order = "fixed" }]
"""


@contextlib.contextmanager
def ears(folder):
    """A JACK server and a recording client; returns a function that ends the recording and returns it."""
    _needs("jackd", "jackd2")
    _imported("jack", "libjack-jackd2-0")
    quiet = _environment(JACK_NO_START_SERVER="1", JACK_NO_AUDIO_RESERVATION="1")
    with quiet, _portaudio() as release, _started_jack(RATE) as (name, server), _environment(JACK_DEFAULT_SERVER=name):
        command = [sys.executable, str(Path(__file__).parent / "ears.py"), str(folder / "heard.npy")]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as listener:
            assert listener.stdout.readline().strip() == "ready"
            # PortAudio lists devices once, so that this process must look again.
            release()
            importlib.import_module("sounddevice")._initialize()

            def heard():
                listener.stdin.write("end\n")
                listener.stdin.flush()
                assert listener.stdout.readline().strip() == "saved"
                return np.load(folder / "heard.npy")

            try:
                yield heard
            finally:
                release()
                server.terminate()
                with contextlib.suppress(subprocess.TimeoutExpired):
                    server.wait(5)
                listener.kill()


def decibels(samples):
    """Rms relative to a full-scale sine, in dB."""
    return 20 * np.log10(np.sqrt(2 * np.mean(np.square(samples))))


@pytest.mark.long  # JACK misses a period where other programs take the processor.
def test_jack_receives_white_noise_at_the_stated_level_only_while_on(tmp_path):
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
        assert decibels(samples[begin : begin + ramp // 4, 0]) < -32  # fade-in
        power = np.abs(np.fft.rfft(inside)) ** 2
        bands = 10 * np.log10([part.mean() for part in np.array_split(power, 8)])
        assert np.ptp(bands) < 1.0  # white


@pytest.mark.long
def test_a_session_has_noise_while_the_array_presents_and_none_while_it_asks(tmp_path, monkeypatch):
    monkeypatch.setenv("MIDAIR_STATE", str(tmp_path))
    save_drive(tmp_path / "a.drive.h5", frames=5)
    (tmp_path / "a.toml").write_text(TWO_STIMULI)
    assert midair(["study", "new", f"{tmp_path}/s", "--source", f"{tmp_path}/a.toml"]) == 0
    with ears(tmp_path) as heard:
        monkeypatch.setattr("sys.stdin", io.StringIO("yes\nno\n"))
        words = ["study", "run", f"{tmp_path}/s", "--participant", "1", "--array", "virtual", "--noise", "ears"]
        assert midair(words) == 0
        loud = np.abs(heard()[:, 0]) > 0
    edges = np.flatnonzero(np.diff(np.concatenate(([False], np.convolve(loud, np.ones(99)) > 0, [False])).astype(int)))
    assert len(edges) == 4, "one burst for the drive and one for the silence"
    assert StudyFolder(tmp_path / "s").sessions()[0].next_trial == 2
    assert read_events(tmp_path / "s" / "sessions" / "sub-01.jsonl")[0]["noise_dbfs"] == -30


PLAYS = """
import time
from midair.study.design.study_design import MaskingNoise
from midair.study.session.presenters import Headphones
with Headphones(MaskingNoise(level_dbfs=-20, ramp_s=0.05), seed=1) as phones:
    phones.on(); time.sleep(0.6); phones.off(); time.sleep(0.3)
"""


@contextlib.contextmanager
def pulse(folder, rate):
    """PulseAudio with a null output; returns the environment variables for its clients."""
    _imported("sounddevice", "libportaudio2")
    if not list(Path("/usr/lib").glob("*/alsa-lib/libasound_module_pcm_pulse.so")):
        pytest.skip("ALSA has no way to PulseAudio: apt-get install libasound2-plugins")
    where = f"unix:{folder / 'socket'}"
    runs = os.environ | {"HOME": str(folder), "XDG_RUNTIME_DIR": str(folder), "PULSE_SERVER": where}
    (folder / ".asoundrc").write_text("pcm.!default { type pulse }\nctl.!default { type pulse }\n")
    sink = f"module-null-sink sink_name=ears rate={rate} format=float32le"
    door = f"module-native-protocol-unix socket={folder / 'socket'} auth-anonymous=1"
    words = ["-n", "--daemonize=no", "--exit-idle-time=-1", "--use-pid-file=no", "--disable-shm=yes", "-L", sink]
    with subprocess.Popen(["pulseaudio", *words, "-L", door], env=runs, stderr=subprocess.DEVNULL) as server:
        try:
            ask = {"args": ["pactl", "info"], "env": runs, "capture_output": True}
            wait_until(lambda: subprocess.run(**ask, check=False).returncode == 0, 10)
            yield runs
        finally:
            server.terminate()


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("pulseaudio") is None, reason="needs PulseAudio: apt-get install pulseaudio")
@pytest.mark.parametrize(("rate", "level"), [(44100, -20.0), (48000, -20.8)])
def test_pulseaudio_loses_one_decibel_when_resampling(tmp_path, rate, level):
    with pulse(tmp_path, rate) as runs, open(tmp_path / "heard.raw", "wb") as file:
        words = ["parec", "-d", "ears.monitor", "--format=float32le", f"--rate={rate}", "--channels=2"]
        with subprocess.Popen(words, env=runs, stdout=file) as ears:
            wait_until(lambda: os.fstat(file.fileno()).st_size > rate)  # An eighth of a second of silence
            subprocess.run([sys.executable, "-c", PLAYS], env=runs, check=True, timeout=60)
            time.sleep(1)
            ears.terminate()
    heard = np.fromfile(tmp_path / "heard.raw", np.float32).reshape(-1, 2)
    np.testing.assert_array_equal(heard[:, 0], heard[:, 1])
    parts = heard[: len(heard) // 441 * 441, 0].reshape(-1, 441)
    # A busy computer may cause gaps; the median of the complete parts has the level of the noise.
    whole = parts[(parts != 0).all(axis=1)]
    assert len(whole) > 20
    assert np.median([decibels(part) for part in whole]) == pytest.approx(level, abs=0.3)
    assert (heard[: rate // 10] == 0).all(), "silence before"


def test_the_loudest_level_is_not_clipped_and_levels_are_stated():
    bound = Headphones(MaskingNoise(level_dbfs=-2))._bound
    assert 0.95 < bound < 1
    for full_scale, said in ((None, "unknown: state it in the plan"), (105.0, "at -20 dB .*, 85 dB SPL$")):
        assert re.search(said, MaskingNoise(level_dbfs=-20, full_scale_db=full_scale).said)


@pytest.mark.long
def test_missing_headphones_are_an_error():
    _imported("sounddevice", "libportaudio2")
    with (
        pytest.raises(UnknownDeviceError, match=r"headphones: .*lists outputs"),
        Headphones(MaskingNoise(level_dbfs=-20), device="no such thing"),
    ):
        pass
