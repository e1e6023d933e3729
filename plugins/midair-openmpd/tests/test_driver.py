"""The driver against stand-ins that parse its bytes as the firmware does."""

import threading
import time

import numpy as np
import pytest
from board_simulator import OpenMpdSimulator, measured_board
from tests.simulators.exposure_override import clear_any_exposure

from midair.errors import DeviceError, DeviceStateError, InputError, LinkLostError, RateError
from midair.model import Drive
from midair_openmpd import Board, OpenMpdArray, array_of_boards
from midair_openmpd.driver import LEAD


@pytest.fixture
def stand_ins():
    made = []

    def make(count=1):
        made.extend(OpenMpdSimulator() for _ in range(count))
        return made[-count:]

    yield make
    for one in made:
        one.close()


def some_drive(boards, frames=6):
    array, rng = array_of_boards(*boards), np.random.default_rng(1)
    return Drive(phase=rng.uniform(-10, 10, (frames, array.count)), level=np.ones(frames), rate=1000.0, array=array)


def array_at(stand_ins, boards):
    return OpenMpdArray([one.port for one in stand_ins], boards)


def phases(stand_in, board):
    return np.array([one.sound()[board.pin] for one in stand_in.heard]) * np.exp(1j * board.offset)


@pytest.mark.long
@pytest.mark.parametrize("count", [1, 2], ids=["one", "twin"])
def test_every_frame_of_a_drive_sounds_once_in_its_order(stand_ins, count, attempts):
    boards = [measured_board(number) for number in range(count)]
    ports = stand_ins(count)
    drive = some_drive(boards, frames=120)
    device = array_at(ports, boards)
    with device:
        for _ in attempts:
            report = device.play(clear_any_exposure(drive, device, repeats=2))
            # On a busy computer a frame stands on for one that came too late, and the report says so.
            if report.late == 0:
                break
    assert (report.frames, report.late) == (240, 0)
    for number, (port, board) in enumerate(zip(ports, boards, strict=True)):
        port.settle()
        heard = phases(port, board)[-240:]  # of the last play
        assert heard.shape == (240, 256)
        own = np.tile(drive.phase[:, 256 * number : 256 * (number + 1)], (2, 1))
        assert np.abs(np.angle(heard * np.exp(-1j * own))).max() <= np.pi / 128 + 1e-9
        assert {one.divider for one in port.heard} == {40}
        assert not port.sounds


@pytest.mark.long
def test_another_rate_sets_another_divider(stand_ins):
    (port,) = stand_ins()
    boards = [Board.nominal()]
    base = some_drive(boards, frames=8)
    drive = Drive(phase=base.phase, level=base.level, rate=200.0, array=base.array)
    with array_at([port], boards) as device:
        device.play(clear_any_exposure(drive, device))
    assert {one.divider for one in port.heard} == {200}
    assert len(port.heard) == 8


@pytest.mark.long
def test_the_last_frame_lasts_for_its_time_on_the_board_s_clock(stand_ins):
    """Silence is queued right after it, so that a delay of the program at the end has no effect.

    A busy computer may delay one playback, but not ten.
    """
    (port,) = stand_ins()
    boards = [Board.nominal()]
    drive = some_drive(boards, frames=40)
    times = []
    with array_at([port], boards) as device:
        for _ in range(10):
            device.play(
                clear_any_exposure(drive, device), progress=lambda done, total: time.sleep(0.1 * (done == total))
            )
            port.settle()
            last = max(number for number, one in enumerate(port.frames) if one.sounds)
            times.append(port.begins[last + 1] - port.begins[last])
            if times[-1] == pytest.approx(1e-3, abs=1e-9):
                return
    raise AssertionError(times)


def test_what_another_program_left_sounding_is_silenced_on_opening(stand_ins):
    (port,) = stand_ins()
    with open(port.port, "wb", buffering=0) as line:
        line.write(bytes([0x80] + [0] * 255 + [64] * 256) + bytes([0x80] * 100))
        port.settle()
    assert port.sounds
    with OpenMpdArray([port.port]):
        port.settle()
        assert not port.sounds


@pytest.mark.long
def test_silence_from_another_thread_is_true_when_it_returns(stand_ins):
    (port,) = stand_ins()
    boards = [measured_board()]
    drive = some_drive(boards, frames=3000)
    begun, ended = threading.Event(), []
    with array_at([port], boards) as device:

        def play():
            with pytest.raises(DeviceError, match="silenced by another thread"):
                device.play(clear_any_exposure(drive, device), progress=lambda done, total: begun.set())
            ended.append(True)

        player = threading.Thread(target=play)
        player.start()
        assert begun.wait(30)
        device.silence()
        port.settle()
        assert not port.sounds
        count = len(port.heard)
        player.join(30)
        assert ended
        port.settle()
        assert len(port.heard) == count
    assert 0 < count < 3000


@pytest.mark.long
def test_few_frames_are_buffered_when_silence_is_sent(stand_ins):
    """After an error, at most the lead's number of frames has been sent, whatever the state of the board."""
    (port,) = stand_ins()
    boards = [measured_board()]
    device = array_at([port], boards)
    told = []

    def fail(done, total):
        told.append(done)
        if done > 100:
            raise RuntimeError

    with device, pytest.raises(RuntimeError):
        device.play(clear_any_exposure(some_drive(boards, frames=5000), device), progress=fail)
    port.settle()
    assert not port.sounds
    assert told[-1] < len(port.heard) <= told[-1] + LEAD * 1000


@pytest.mark.long
def test_a_board_without_a_cable_is_an_error_and_the_other_is_silenced(stand_ins):
    ports = stand_ins(2)
    boards = [measured_board(0), measured_board(1)]
    device = array_at(ports, boards)

    def pull(done, total):
        if done > 20 and ports[0]._master >= 0:
            ports[0].unplug()

    with pytest.raises(LinkLostError, match="it repeats its last frame: switch off its power now"), device:
        device.play(clear_any_exposure(some_drive(boards, frames=2000), device), progress=pull)
    ports[1].settle()
    assert ports[0].sounds
    assert not ports[1].sounds
    assert device.emitting


@pytest.mark.long
def test_a_board_that_accepts_no_more_bytes_is_an_error(stand_ins):
    (port,) = stand_ins()
    boards = [measured_board()]
    device = array_at([port], boards)

    def stall(done, total):
        port.stalled = True

    with pytest.raises(LinkLostError, match="switch off its power"), device:
        device.play(clear_any_exposure(some_drive(boards, frames=2000), device), progress=stall)


def test_a_board_without_its_file_can_be_silenced_and_not_played_on(stand_ins):
    (port,) = stand_ins()
    device = OpenMpdArray([port.port])
    assert device.array.same_as(array_of_boards(Board.nominal()))
    with device, pytest.raises(DeviceStateError, match=r"\?board=board_N\.pat"):
        device.play(clear_any_exposure(some_drive([Board.nominal()]), device))
    assert port.heard == []


def test_what_cannot_be_played_is_refused_before_a_sound(stand_ins):
    (port,) = stand_ins()
    boards = [Board.nominal()]
    base = some_drive(boards)
    slow = Drive(phase=base.phase, level=base.level, rate=100.0, array=base.array)
    with array_at([port], boards) as device, pytest.raises(RateError, match="40 kHz / N"):
        device.play(clear_any_exposure(slow, device))
    faint = Drive(phase=base.phase, level=np.full(base.frames, 0.02), rate=1000.0, array=base.array)
    with array_at([port], boards) as device, pytest.raises(InputError, match=r"at least 2\.5%.*got 2\.0%"):
        device.play(clear_any_exposure(faint, device))
    assert port.heard == []
    with pytest.raises(InputError, match="a board file for each of 2 ports, got 1"):
        OpenMpdArray(["a", "b"], boards)
    with pytest.raises(InputError, match="this firmware has none"):
        OpenMpdArray(["a"], boards, silencer="half")


def test_a_port_that_is_not_there_is_one_line():
    with pytest.raises(DeviceError, match="expected a port /dev/nothing"):
        OpenMpdArray(["/dev/nothing"]).open()


@pytest.mark.long  # The board's stand-in has to keep its time beside other work.
def test_a_delay_prolongs_a_frame_and_is_reported(stand_ins):
    (port,) = stand_ins()
    boards = [measured_board()]
    slow = iter([False] * 5 + [True] + [False] * 10_000)

    def hesitate(done, total):
        if next(slow):
            time.sleep(6 * LEAD)

    with array_at([port], boards) as device:
        report = device.play(clear_any_exposure(some_drive(boards, frames=150), device), progress=hesitate)
    port.settle()
    assert report.repeated >= 1
    assert len(port.heard) == 150


def test_it_describes_the_limits_of_its_knowledge(stand_ins):
    (port,) = stand_ins()
    with array_at([port], [measured_board()]) as device:
        said = device.describe()
    assert "cannot be confirmed" in said["boards"]
    assert said["failsafe"].startswith("none on the board")
