"""Sound inputs through PortAudio: JACK's dummy driver, and a PulseAudio source from a pipe."""

import os
import subprocess
import sys
import textwrap
import time
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec

import numpy as np
import psutil
import pytest
from tests.waiting import wait_until

from midair.errors import DeviceError, InputError, UnknownDeviceError
from midair.files import open_take
from midair.rig.names.sensor_names import source_sensor


def record(sensor, seconds):
    blocks, got = [], 0
    while got < seconds * sensor.rate:
        blocks.append(sensor.read(round(sensor.rate / 10)))
        got += len(blocks[-1].samples)
    return blocks, np.concatenate([block.samples for block in blocks]).reshape(got, -1)


def check_ramp(sensor, seconds):
    """Read for a while, and check that every frame is present and every channel in its place; returns the lost frames.

    Nothing is stored, so that the memory in use at the end is that of the sensor. A busy JACK reports delays even
    without losses.
    """
    last, got, begin = None, 0, None
    while got < seconds * sensor.rate:
        ramp = np.rint(sensor.read(round(sensor.rate / 10)).samples * 32768).astype(int).reshape(-1, 16)
        number = ramp[:, 0] // 16
        np.testing.assert_array_equal(np.diff(number if last is None else np.append(last, number)) % 2048, 1)
        np.testing.assert_array_equal(ramp % 16, np.broadcast_to(np.arange(16), ramp.shape))
        last, got = number[-1], got + len(ramp)
        begin = begin or resident()
    assert resident() - begin < 30e6
    return int(sensor.describe()["lost frames"])


def resident():
    return psutil.Process().memory_info().rss


def tones(samples, rate):
    """The strongest frequency of each channel, in Hz, and the amplitude at any."""
    spectrum = 4 * np.abs(np.fft.rfft(samples * np.hanning(len(samples))[:, None], axis=0)) / len(samples)
    frequency = np.fft.rfftfreq(len(samples), 1 / rate)

    def amplitude(channel, wanted):
        return spectrum[np.abs(frequency - wanted).argmin(), channel]

    return frequency[spectrum.argmax(axis=0)], amplitude


@pytest.mark.parametrize(
    ("rate", "seconds"),
    [
        pytest.param(1000, 2, marks=pytest.mark.long),
        pytest.param(1000, 60, marks=pytest.mark.slow),
        pytest.param(48000, 60, marks=pytest.mark.slow),
    ],
)
def test_jack_gives_every_frame_in_order(rate, seconds, jack_server):
    with jack_server(rate), source_sensor(f"audio:skin?channels=16&rate={rate}&timeout=20") as sensor:
        sensor.start()
        check_ramp(sensor, seconds)
        assert sensor.describe()["driver"] == "JACK Audio Connection Kit"


@pytest.mark.parametrize("seconds", [pytest.param(2, marks=pytest.mark.long), pytest.param(60, marks=pytest.mark.slow)])
def test_pulseaudio_gives_every_frame_in_order(seconds, pulse_server, tmp_path):
    with (
        pulse_server(tmp_path, rate=1000, what="ramp"),
        source_sensor("audio:pulse?channels=16&native=1000&timeout=20") as sensor,
    ):
        sensor.start()
        assert check_ramp(sensor, seconds) == 0


@pytest.mark.parametrize("seconds", [pytest.param(1, marks=pytest.mark.long), pytest.param(60, marks=pytest.mark.slow)])
def test_48_khz_become_1_khz_with_one_tone_a_channel_and_no_aliases(seconds, pulse_server, tmp_path):
    with (
        pulse_server(tmp_path, rate=48000, what="tones"),
        source_sensor("audio:pulse?channels=16&native=48000&rate=1000&timeout=20") as sensor,
    ):
        sensor.start()
        blocks, samples = record(sensor, seconds)
        assert sensor.describe()["filter delay"] == "64 ms"
    loudest, amplitude = tones(samples[:1000], 1000)
    np.testing.assert_allclose(loudest, 60 + 25 * np.arange(16), atol=0.5)
    for channel in range(16):
        assert amplitude(channel, 60 + 25 * channel) == pytest.approx(0.25, rel=0.005)
        assert amplitude(channel, 30 + 25 * channel) < 0.25e-4
    assert not any(block.overflow for block in blocks)
    # A lost or double piece anywhere would break the phase of the tones.
    whole, _ = tones(samples[-1000:], 1000)
    np.testing.assert_array_equal(whole, loudest)


@pytest.mark.long
def test_a_recording_keeps_its_frames_when_its_device_vanishes(pulse_server, tmp_path):
    """PulseAudio's server ends, as for a card that is unplugged; in a program of its own, as a person types it."""
    sensor = "audio:pulse?channels=16&native=8000&rate=8000&timeout=2&rows=4&columns=4"
    with pulse_server(tmp_path, rate=8000, what="ramp") as server:
        command = [sys.executable, "-m", "midair", "record", sensor, "out.h5"]
        with subprocess.Popen(
            command, cwd=tmp_path, env=os.environ, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        ) as process:
            wait_until(lambda: (tmp_path / "out.h5").exists() or process.poll() is not None)
            time.sleep(1.0)
            server.kill()
            printed = process.communicate(timeout=60)[1]
    assert process.returncode == 1
    assert "frames so far are safe" in " ".join(printed.split())
    ramp = np.rint(open_take(tmp_path / "out.h5").recording.samples * 32768).astype(int).reshape(-1, 16)
    assert len(ramp) > 4000
    np.testing.assert_array_equal(np.diff(ramp[:, 0] // 16) % 2048, 1)


@pytest.mark.slow
def test_a_jack_server_that_ends_is_an_error_in_time_and_the_program_ends(jack_server):
    # In a process of its own: PortAudio never recovers from it.
    program = """
        import os, signal, sys
        from midair.errors import DeviceError
        from midair.rig.names.sensor_names import source_sensor

        try:
            with source_sensor("audio:skin?channels=16&rate=8000&timeout=2") as sensor:
                sensor.start()
                sensor.read(800)
                os.kill(int(sys.argv[1]), signal.SIGKILL)
                while True:
                    sensor.read(800)
        except DeviceError as wrong:
            print(wrong)
    """
    with jack_server(8000) as server:
        command = [sys.executable, "-c", textwrap.dedent(program), str(server.pid)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60, env=os.environ)
        assert done.stdout.startswith("audio: lost 'skin'; plug it in")
        assert done.returncode == 0


def test_a_device_or_channels_that_are_not_there_are_refused(jack_server):
    with jack_server(8000):
        with pytest.raises(
            UnknownDeviceError, match=r"for 'cello', got: No input.*; name one of: .*skin \(16 channels"
        ):
            source_sensor("audio:cello").open()
        with pytest.raises(DeviceError, match=r"expected 99 channels at 8000 Hz from 'skin'"):
            source_sensor("audio:skin?channels=99").open()


class NoLibrary(MetaPathFinder, Loader):
    """Finds a sounddevice that finds no library."""

    def find_spec(self, name, path, target=None):
        return ModuleSpec(name, self) if name == "sounddevice" else None

    def exec_module(self, module):
        raise OSError("PortAudio library not found")


def test_without_portaudio_the_debian_package_is_named(monkeypatch):
    for loaded in ("sounddevice", "midair.devices.sensors.audio"):
        monkeypatch.delitem(sys.modules, loaded, raising=False)
    monkeypatch.setattr(sys, "meta_path", [NoLibrary(), *sys.meta_path])
    with pytest.raises(
        DeviceError, match=r"^audio: expected the library PortAudio \(Debian: apt-get install libportaudio2\)"
    ):
        source_sensor("audio:x")
    with pytest.raises(InputError, match="option channels"):
        source_sensor("audio:x?channels=none")


@pytest.mark.slow
def test_pulseaudio_with_its_own_channel_names_permutes_and_one_tone_a_channel_shows_it(pulse_server, tmp_path):
    with (
        pulse_server(tmp_path, rate=8000, what="tones", channel_map=""),
        source_sensor("audio:pulse?channels=16&native=8000&rate=1000") as sensor,
    ):
        sensor.start()
        _, samples = record(sensor, 1)
    loudest, _ = tones(samples, 1000)
    assert (np.abs(loudest - (60 + 25 * np.arange(16))) > 1).any()
