import os
import re
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from midair.cli import run
from midair.errors import DeviceError, InputError, MismatchError
from midair.files import load
from midair.rig.names.sensor_names import source_sensor


def record(sensor, seconds):
    """Blocks of `seconds`, and their frames as the ramp, shape (frame, 16)."""
    blocks, got = [], 0
    while got < seconds * sensor.rate:
        blocks.append(sensor.read(100))
        got += len(blocks[-1].samples)
    return blocks, np.rint(np.concatenate([block.samples for block in blocks])).astype(int).reshape(-1, 16)


@pytest.mark.parametrize("seconds", [1, pytest.param(60, marks=pytest.mark.slow)])
def test_nothing_is_lost_or_permuted_between_two_processes(seconds, lsl_sender):
    name, _ = lsl_sender()
    with source_sensor(f"lsl:{name}?search=60&timeout=20") as sensor:
        sensor.start()
        # Without the option, the counter of frames is one more channel: 17 in a row.
        blocks, numbers = [], []
        while sum(map(len, numbers)) < seconds * 1000:
            blocks.append(sensor.read(100))
            numbers.append(blocks[-1].samples.reshape(-1, 17))
    ramp = np.concatenate(numbers).astype(int)
    assert not any(block.overflow for block in blocks)
    np.testing.assert_array_equal(np.diff(ramp[:, 16]), 1)
    np.testing.assert_array_equal(ramp[:, :16], (ramp[:, 16:] % 2048) * 16 + np.arange(16))


@pytest.mark.long
def test_frames_that_the_sender_left_out_show_in_its_counter(lsl_sender):
    name, _ = lsl_sender(hole=7)
    with source_sensor(f"lsl:{name}?search=60&counter=16") as sensor:
        sensor.start()
        blocks, ramp = record(sensor, 0.5)
        lost = int(sensor.describe()["lost frames"])
    steps = np.diff(ramp[:, 0] // 16) % 2048
    assert sorted(set(steps)) == [1, 8]
    assert [block.overflow for block in blocks].count(True) == (steps == 8).sum() >= 2
    assert lost == 7 * (steps == 8).sum()
    assert blocks[-1].first + len(blocks[-1].samples) == len(ramp) + lost


@pytest.mark.slow
def test_the_clocks_of_sender_and_computer_agree_where_they_are_the_same(lsl_sender):
    name, _ = lsl_sender()
    with source_sensor(f"lsl:{name}?search=60&counter=16") as sensor:
        sensor.start()
        blocks, _ = record(sensor, 2)
    device, host = ([getattr(block, clock) for block in blocks] for clock in ("device_time", "host_time"))
    # liblsl settles in the first seconds; a wrong rate or another clock would be off by far more than one in a hundred.
    assert np.polyfit(device, host, 1)[0] == pytest.approx(1, abs=0.01)
    assert 0 < time.monotonic() - host[-1] < 5


@pytest.mark.long
@pytest.mark.parametrize(
    ("unit", "options", "factor"), [("microvolts", "", 1e-6), ("V", "", 1.0), ("-", "&unit=V", 1.0)]
)
def test_the_unit_is_the_senders_or_the_stated_one(unit, options, factor, lsl_sender):
    name, _ = lsl_sender(unit=unit)
    with source_sensor(f"lsl:{name}?search=60{options}") as sensor:
        sensor.start()
        assert sensor.unit == "V"
        samples = sensor.read(1).samples.ravel() / factor
        np.testing.assert_allclose(np.diff(samples[:16]), 1, rtol=1e-4)


@pytest.mark.long
def test_a_unit_that_contradicts_the_sender_and_a_counter_that_is_no_channel_are_refused(lsl_sender):
    name, _ = lsl_sender(unit="V")
    with pytest.raises(MismatchError, match="the source states V"):
        source_sensor(f"lsl:{name}?search=60&unit=Pa").open()
    with pytest.raises(InputError, match="a counter among channels 0 to 16, got 17"):
        source_sensor(f"lsl:{name}?search=60&counter=17").open()


def test_a_stream_without_a_sender(lsl_sender):
    from midair.devices.sensors.lsl import LslSource

    lsl_sender()
    with pytest.raises(DeviceError, match=r"a stream called 'Missing', found none in 0\.3 s.*Streams found: midair"):
        LslSource("Missing", search=0.3).open()


@pytest.mark.long
def test_one_of_two_streams_of_a_name_is_chosen_by_its_source_id():
    pylsl = pytest.importorskip("pylsl")
    from midair.devices.sensors.lsl import LslSource

    outlets = [pylsl.StreamOutlet(pylsl.StreamInfo("twins", "", 4, 100, pylsl.cf_float32, each)) for each in "ab"]
    for _ in range(4):  # Either of the two may answer first.
        source = LslSource("twins", source_id="b", search=60.0)
        assert source.open().channels == 4
        source.close()
    del outlets


def numbered(sensor, seconds, *, cells=16):
    """Frame numbers from midair over `seconds`, and the sender's own (mod 2048)."""
    sensor.start()
    found, sent = [], []
    while not found or found[-1][-1] < seconds * sensor.rate:
        block = sensor.read(100)
        found.append(block.first + np.arange(len(block.samples)))
        sent.append(np.rint(block.samples.reshape(len(block.samples), -1)[:, 0]).astype(int) // cells)
    return np.concatenate(found), np.concatenate(sent)


@pytest.mark.parametrize(
    ("how", "once"),
    [("stamped", 1200), *(pytest.param(how, 2500, marks=pytest.mark.slow) for how in ("stamped", "cast"))],
)
def test_missing_frames_are_found_from_stamps_without_a_counter(how, once, lsl_sender):
    """Before, 100 missing frames appeared as a drift of 14,700 ppm."""
    name, _ = lsl_sender(once=once, how=how)
    with source_sensor(f"lsl:{name}?search=60&timeout=20") as sensor:
        found, sent = numbered(sensor, 1.6 * once / 1000)
        lost = int(sensor.describe()["lost frames"])
        assert sensor.describe()["gaps found by"] == "its stamps"
    steps, true = np.diff(found), np.diff(sent) % 2048
    assert true[true > 1].tolist() == [101]
    if how == "stamped":
        np.testing.assert_array_equal(steps, true)
    # A busy machine keeps a sender from stamping evenly that only stamps what it pushes.
    assert abs(lost - 100) <= 50
    assert abs(int((steps > 1).argmax()) - int((true > 1).argmax())) <= 500


@pytest.mark.long
def test_the_stamps_count_on_when_a_float32_counter_is_full(lsl_sender):
    """At 48 kHz the limit is reached after 5.8 minutes."""
    name, _ = lsl_sender(base=2**24 - 700)
    with source_sensor(f"lsl:{name}?search=60&counter=16&timeout=20") as sensor:
        found, sent = numbered(sensor, 1.6)
        by = sensor.describe()["gaps found by"]
    assert by == "its counter, and since that is full its stamps"
    np.testing.assert_array_equal(np.diff(sent) % 2048, 1)
    np.testing.assert_array_equal(np.diff(found), 1)


@pytest.mark.long
@pytest.mark.parametrize("options", ["", "&counter=16"])
def test_stamps_that_jump_are_one_event_and_no_drift(options, lsl_sender):
    """Before, 12,000 frames had status 0, no word, and a rate that was off by 234,733 ppm."""
    name, _ = lsl_sender(once=3000, how="back")
    with source_sensor(f"lsl:{name}?search=60&timeout=20{options}") as sensor:
        sensor.start()
        blocks = [sensor.read(100)]
        while blocks[-1].first < 5000:
            blocks.append(sensor.read(100))
        assert sensor.describe()["jumps of its stamps"] == "1, the last by -3 s"
        assert sensor.describe()["lost frames"] == "0"
    (jump,) = [block for block in blocks if block.overflow]
    # The sender may have begun before the first frame here.
    assert jump.first <= 3000
    # A jump would also be in the times; a busy machine delays the correction of the clocks by a few milliseconds.
    assert np.ptp([block.host_time - block.first / 1000 for block in blocks]) < 0.15


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")
def test_the_program_for_a_flexitac_sends_its_frames(tmp_path):
    """12 x 32 bytes at 85 Hz: 10 Hz on one cell and the sync word inside a frame come back."""
    page = Path(__file__).parents[3] / "docs" / "build-a-sensor.md"
    (program,) = re.findall(
        r"```python\n(import time\nimport pylsl.*?)```", page.read_text(encoding="utf-8"), re.DOTALL
    )
    sensor, port = os.openpty()
    stop, rng = threading.Event(), np.random.default_rng(0)

    def send():
        begun = time.monotonic()
        for number in range(10_000):
            frame = rng.integers(0, 3, (12, 32)).astype(np.uint8)
            frame[3, 7], frame[5, :2] = round(128 + 100 * np.sin(2 * np.pi * 10 * number / 85)), (0xAA, 0x55)
            os.write(sensor, b"\xaa\x55" + frame.tobytes())
            if stop.wait(max(0, begun + (number + 1) / 85 - time.monotonic())):
                return

    name = f"FlexiTac{os.getpid()}"
    program = program.replace("/dev/ttyUSB0", os.ttyname(port)).replace('"FlexiTac"', f'"{name}"')
    sender = subprocess.Popen([sys.executable, "-c", program])
    thread = threading.Thread(target=send)
    thread.start()
    try:
        source = f"lsl:{name}?rows=12&columns=32&search=60&timeout=20"
        assert run(["record", source, str(tmp_path / "press.h5"), "--duration", "4s"]) == 0
    finally:
        sender.kill()
        sender.wait()
        stop.set()
        thread.join()
    recording = load(tmp_path / "press.h5")
    assert recording.sensor.shape == (12, 32)
    assert recording.rate == pytest.approx(85, rel=0.02)
    assert (recording.samples[:, 5, :2] == (0xAA, 0x55)).all()
    spectrum = np.abs(np.fft.rfft(recording.samples[:, 3, 7] - 128))
    assert spectrum.argmax() * recording.rate / recording.frames == pytest.approx(10, abs=0.3)
