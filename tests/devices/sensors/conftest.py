"""Senders for tests of live sensors, each over its real transport.

All send the ramp: channel c of frame i is (i mod 2048) * 16 + c, so that lost, repeated or permuted frames are
detected.
"""

import contextlib
import importlib
import os
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from tests.waiting import wait_until

HERE = Path(__file__).parent
os.environ.setdefault("LSLAPICFG", str(HERE / "lsl_api.cfg"))

PULSE_MAP = ",".join(
    [
        "front-left,front-right,rear-left,rear-right,front-center,lfe,side-left,side-right",
        *(f"aux{number}" for number in range(8)),
    ]
)
"""Channel names in the order in which ALSA and PulseAudio agree on them; with any other, PulseAudio mixes channels."""


@contextlib.contextmanager
def _program(*command, env=None):
    """A helper program that has reported that it is ready; killed at the end."""
    with subprocess.Popen([str(part) for part in command], env=env, stdout=subprocess.PIPE, text=True) as running:
        try:
            assert running.stdout.readline().strip() == "ready"
            yield running
        finally:
            running.kill()


@contextlib.contextmanager
def _lsl_senders():
    pytest.importorskip("pylsl")
    with contextlib.ExitStack() as stack:

        def start(*, unit="-", hole=0, once=0, base=0, how="cast"):
            name = f"midair {os.getpid()} {time.monotonic_ns()}"
            arguments = (HERE / "lsl_sender.py", name, unit, hole, once, base, how)
            return name, stack.enter_context(_program(sys.executable, *arguments))

        yield start


@pytest.fixture
def lsl_sender():
    """Starts a sender; returns its name and process. It ends with its test, since a sender needs processor time."""
    with _lsl_senders() as start:
        yield start


@pytest.fixture(scope="module")
def lsl_sender_of_a_module():
    with _lsl_senders() as start:
        yield start


class SerialLine:
    """A sensor on a pty: sends the ramp at its rate from a thread, optionally with noise and gaps."""

    def __init__(self, *, rate=1000.0, width=2, noise=False, hole=0):
        from midair.devices.sensors.serial_frames import encode

        self._encode, self._rate, self._width = encode, rate, width
        self._noise, self._hole = noise, hole
        self._master, self._slave = os.openpty()
        self.port = os.ttyname(self._slave)
        self.sends, self._ends = True, threading.Event()
        import tty

        tty.setraw(self._slave)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def unplug(self):
        self._ends.set()
        self._thread.join(5)
        for end in ("_master", "_slave"):
            descriptor, _ = getattr(self, end), setattr(self, end, None)
            if descriptor is not None:
                os.close(descriptor)

    def _run(self):
        rng = np.random.default_rng(0)
        begin, sent = time.monotonic(), 0
        os.set_blocking(self._master, False)
        while not self._ends.is_set():
            due = int((time.monotonic() - begin) * self._rate)
            data = b"".join(self._frame(number, rng) for number in range(sent, due) if number % 200 >= self._hole)
            if self.sends:
                self._write(data)
            sent = due
            self._ends.wait(0.005)

    def _frame(self, number, rng):
        ramp = (number % 2048) * 16 + np.arange(16)
        clock = {"time_us": round(number * 1e6 / self._rate), "period_ns": round(1e9 / self._rate)}
        frame = self._encode(ramp, counter=number, width=self._width, **clock)
        return rng.bytes(int(rng.integers(0, 9))) + frame if self._noise else frame

    def _write(self, data):
        while data and not self._ends.is_set():
            try:
                data = data[os.write(self._master, data) :]
            except BlockingIOError:  # no reader: a real line would lose it too
                if not self._ends.wait(0.001):
                    continue


@pytest.fixture
def serial_line():
    pytest.importorskip("serial")
    with contextlib.ExitStack() as stack:

        def start(**settings):
            line = SerialLine(**settings)
            stack.callback(line.unplug)
            return line

        yield start


@contextlib.contextmanager
def _portaudio():
    """PortAudio, and a function that releases it before its server ends: otherwise it aborts the process."""
    sounddevice = _imported("sounddevice", "libportaudio2")
    sounddevice._terminate()
    try:
        # The next device that is opened searches for servers itself.
        sounddevice._initialize()
        yield sounddevice._terminate
    finally:
        sounddevice._initialize()


def _imported(name, package):
    """A module that needs a C library, which it loads on import."""
    try:
        return importlib.import_module(name)
    except (ImportError, OSError) as wrong:
        pytest.skip(f"{name}: {wrong}; apt-get install {package}")


def _needs(program_name, package):
    if shutil.which(program_name) is None:
        pytest.skip(f"{program_name} is not there: apt-get install {package}")


@contextlib.contextmanager
def _environment(**values):
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.update({name: value})


@pytest.fixture(scope="session")
def jack_server():
    return _jack_server


@pytest.fixture(scope="session")
def pulse_server():
    return _pulse_server


@contextlib.contextmanager
def _jack_server(rate, what="ramp"):
    """JACK with its dummy driver and a client "skin" that plays; yields the server's process."""
    _needs("jackd", "jackd2")
    _imported("jack", "libjack-jackd2-0")
    quiet = _environment(JACK_NO_START_SERVER="1", JACK_NO_AUDIO_RESERVATION="1")
    with quiet, _portaudio() as release, _started_jack(rate) as (name, server), _environment(JACK_DEFAULT_SERVER=name):  # noqa: SIM117
        # The server ends before its client: otherwise it waits for it.
        with _program(sys.executable, HERE / "tone_sender.py", "jack", rate, what):
            try:
                yield server
            finally:
                release()
                server.terminate()
                with contextlib.suppress(subprocess.TimeoutExpired):
                    server.wait(5)


@contextlib.contextmanager
def _started_jack(rate):
    """A server under the first free name of a list: JACK has 8 places, and keeps those of killed servers."""
    period = 16 if rate <= 8000 else 1024
    for name in (f"midair{number}" for number in range(4)):
        # Synchronous: the server waits for its clients, so that a busy computer makes it late but loses nothing.
        options = f"-r --no-mlock -S -t 10000 -n {name} -d dummy -C 16 -P 16 -r {rate} -p {period}".split()
        with subprocess.Popen(["jackd", *options], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as server:
            try:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    server.wait(0.3)
                    continue
                yield name, server
                return
            finally:
                server.kill()
    pytest.skip("JACK does not start here: all of its places are taken")


@contextlib.contextmanager
def _pulse_server(folder, *, rate, what, channel_map=PULSE_MAP):
    """PulseAudio with a source of 16 channels from a pipe; yields the server's process."""
    _needs("pulseaudio", "pulseaudio libasound2-plugins")
    _imported("sounddevice", "libportaudio2")
    folder = Path(folder)
    own = dict.fromkeys(("HOME", "XDG_RUNTIME_DIR", "PULSE_STATE_PATH"), str(folder))
    own["PULSE_RUNTIME_PATH"] = str(folder / "run")
    mapped = f"channel_map={channel_map}" if channel_map else ""
    source = f"module-pipe-source source_name=skin file={folder}/pipe format=s16le rate={rate} channels=16 {mapped}"
    options = ["--daemonize=no", "--exit-idle-time=-1", "--use-pid-file=no", "--disable-shm=yes", "--high-priority=no"]
    native = f"module-native-protocol-unix socket={folder}/native auth-anonymous=1"
    with (
        _environment(PULSE_SERVER=f"unix:{folder}/native", HOME=str(folder)),
        subprocess.Popen(
            ["pulseaudio", "-n", *options, "-L", native, "-L", source], env=os.environ | own, stdout=-3, stderr=-3
        ) as server,
    ):
        try:
            wait_until(lambda: (folder / "pipe").exists() and (folder / "native").exists(), 20)
            with _program(sys.executable, HERE / "tone_sender.py", folder / "pipe", rate, what):
                yield server
        finally:
            server.kill()


class FakeTask:
    """A driver's task as `NiSource` uses it: the ramp in shares of 10 V, at its rate, until it is unplugged."""

    def __init__(self):
        self.calls, self.unplugged = [], False
        self.channel_names = [f"Dev1/ai{number}" for number in range(16)]
        self.ai_channels = self.timing = self.in_stream = self
        self.samp_clk_rate = 0.0
        self._begin, self._given = None, 0

    def add_ai_voltage_chan(self, name, **settings):
        self.calls.append((name, settings))

    def cfg_samp_clk_timing(self, rate, **settings):
        self.samp_clk_rate = rate
        self.calls.append((rate, settings))

    def start(self):
        self._check()
        self._begin, self._given = time.monotonic(), 0

    @property
    def avail_samp_per_chan(self):
        self._check()
        due = int((time.monotonic() - self._begin) * self.samp_clk_rate)
        return due - self._given

    def read(self, number_of_samples_per_channel, timeout):
        number = np.arange(self._given, self._given + number_of_samples_per_channel)
        self._given += number_of_samples_per_channel
        ramp = ((number[None, :] % 2048) * 16 + np.arange(len(self.channel_names))[:, None]) / 32768 * 10
        return (ramp if len(ramp) > 1 else ramp[0]).tolist()

    def stop(self):
        self._check()

    def close(self):
        self._check()

    def _check(self):
        from nidaqmx.errors import DaqError

        if self.unplugged:
            raise DaqError("Device is not available for routing.\nIt is possible that it was removed.", -88709)


@pytest.fixture
def ni_task():
    pytest.importorskip("nidaqmx")
    return FakeTask()
