"""Playback on AUTD3's emulator over loopback, in real time, with a record of every datagram."""

import re
import signal
import socket
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from tests.drives import noise
from tests.simulators.exposure_override import clear_any_exposure
from tests.simulators.udp_proxy import READ_STATE
from tests.waiting import wait_until

from midair.devices import Cooling, autd3_array, autd3_immediate
from midair.devices.arrays.banks import TooLateError
from midair.devices.frame_bytes import TICK, phase_bytes
from midair.errors import DeviceError, LinkLostError, TooHotError, UnknownDeviceError
from midair.model import Drive, Placement

pytest.importorskip("autd3")

ONE = Placement.grid(columns=1, rows=1)
WRITE, SWITCH, SILENCE, CONFIG = 0x13, 0x12, 0x16, 0x11
PATTERN, FAILSAFE = 0x08, 0x80
"""Bits of the FPGA's state: a single pattern, which midair uses only for silence; and an active failsafe."""

PLAYER = """
import sys
import numpy as np
from midair.devices import Cooling, autd3_array
from midair.model import Drive, Placement
from midair.devices import signals_end_the_program
from tests.simulators.exposure_override import clear_any_exposure

placement = Placement.grid(columns=1, rows=1)
array = placement.array()
phase = np.random.default_rng(0).uniform(0, 6, (500, array.count))
drive = Drive(phase=phase, level=np.ones(500), rate=1000.0, array=array)
with signals_end_the_program(), autd3_array(sys.argv[1], placement) as device:
    said = lambda done, total: print("plays", flush=True)
    device.play(clear_any_exposure(drive, device, repeats=1000), progress=said)
"""


def phases_sent(tap):
    """Phases of all frames in their order, without the silent ones: (frame, transducer)."""
    parts = []
    for _, _, command, datagram in tap.frames():
        if command == WRITE and datagram[13] > 0:
            parts.append(np.frombuffer(datagram[16:], np.uint8).reshape(datagram[12], 249))
    return np.concatenate(parts)


def assert_last_word_is_silence(tap):
    """The last active pattern has intensity 0 everywhere."""
    commands = [command for _, _, command, _ in tap.frames() if command in (SWITCH, SILENCE)]
    last = [datagram for _, _, command, datagram in tap.frames() if command == SILENCE][-1]
    assert commands[-1] == SILENCE
    assert not any(last[-249:])


def patterns(tap):
    """States without the failsafe, which acts soon after a process has ended."""
    return [state & ~FAILSAFE for state in tap.states()]


def playing(tap):
    """A process that has begun to play on the tap's emulator; a query of the units would disturb it now."""
    process = subprocess.Popen([sys.executable, "-c", PLAYER, tap.address], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "plays\n"
    return process


@pytest.mark.long
def test_the_wire_carries_every_frame_and_exact_instants(tap):
    frames = 600
    drive = noise(frames)
    device = autd3_array(tap.address, ONE)
    with device:
        begin = time.monotonic()
        report = device.play(clear_any_exposure(drive, device))
        end = time.monotonic()
        telemetry = device.units.describe()
    np.testing.assert_array_equal(phases_sent(tap), phase_bytes(drive, 1)[:, 0])
    switches = [
        int.from_bytes(datagram[12:20], "little") for _, _, command, datagram in tap.frames() if command == SWITCH
    ]
    assert (report.frames, report.late, report.repeated, report.gap) == (frames, 0, 0, 0)
    assert switches[0] == report.start
    assert set(np.diff(switches)) <= {250_000_000}
    assert max(np.diff([at for at, _, _ in tap.sent if begin <= at <= end])) < 0.4
    assert "acted 0 times" in telemetry["failsafe"]
    assert_last_word_is_silence(tap)


def switched_to(tap, port, *, late=False):
    """(instants, frames) that one unit played, from its two banks as received.

    `late`: a block that comes again was taken back by silence, and started at a later instant.
    """
    memory, size, instants, frames = np.zeros((2, 1024, 249), np.uint8), [0, 0], [], []
    for _, to, command, datagram in tap.frames():
        if to != port or command not in (WRITE, CONFIG, SWITCH):
            continue
        bank = datagram[10]
        if command == WRITE:
            first, count = int.from_bytes(datagram[14:16], "little"), datagram[12]
            memory[bank, first : first + count] = np.frombuffer(datagram[16:], np.uint8).reshape(count, 249)
        elif command == CONFIG:
            size[bank] = int.from_bytes(datagram[14:16], "little") - 1  # the last pattern is the silent one
        elif (instant := int.from_bytes(datagram[12:20], "little")) not in instants:  # else it was sent again
            block = memory[bank, : size[bank]].copy()
            if late and frames and np.array_equal(frames[-1], block):
                instants.pop(), frames.pop()
            instants.append(instant)
            frames.append(block)
    return instants, np.concatenate(frames)


@pytest.mark.clock
@pytest.mark.slow
@pytest.mark.parametrize("tap", [4], indirect=True)
def test_a_minute_of_60000_frames_on_four_units_bit_by_bit(tap):
    placement = Placement.grid()
    array, rng = placement.array(), np.random.default_rng(3)
    drive = Drive(phase=rng.uniform(0, 6, (6000, array.count)), level=np.ones(6000), rate=1000.0, array=array)
    with autd3_array(tap.address, placement) as device:
        report = device.play(clear_any_exposure(drive, device, repeats=10))
        tap.states()
        units = {port: answer[7] for port, answer in tap.answers.items()}
    assert sorted(units.values()) == [0, 1, 2, 3]
    assert (report.frames, report.repeated) == (60000, 0)
    wanted = phase_bytes(drive, 4)
    for port, unit in units.items():
        instants, frames = switched_to(tap, port)
        np.testing.assert_array_equal(frames, np.tile(wanted[:, unit], (10, 1)))
        if not report.late:
            assert set(np.diff(instants)) == {250_000_000}
            assert instants[0] == report.start


@pytest.mark.long
def test_heartbeats_with_and_without_playback(tap):
    """The failsafe acts after 500 ms: the longest pause is far below it."""
    with autd3_array(tap.address, ONE) as device:
        begin = time.monotonic()
        time.sleep(0.55)
        device.play(clear_any_exposure(noise(300), device))
        assert tap.states() == [PATTERN]
        assert tap.gap(begin) < 0.4
        assert sum(datagram[1] == 7 for at, _, datagram in tap.sent if at >= begin) > 20


@pytest.mark.long
def test_a_lost_link_ends_playing_and_the_failsafe_silences(tap):
    def cut(done, _):
        if done >= 250:
            tap.passes = False

    with pytest.raises(LinkLostError, match=r"check.*power"), autd3_array(tap.address, ONE) as device:
        device.play(clear_any_exposure(noise(2000), device), progress=cut)
    time.sleep(0.55)
    assert [state & FAILSAFE for state in tap.states()] == [FAILSAFE]


@pytest.mark.long
@pytest.mark.parametrize("answer", [False, True], ids=["order", "answer"])
def test_a_lost_datagram_of_each_kind_does_not_end_playing(tap, answer):
    drive, lost = noise(750), {0: [WRITE, CONFIG], 250: [SWITCH], 500: [READ_STATE, SILENCE]}

    def lose(done, _):
        for command in lost.pop(done, []):
            tap.lose(command, answer=answer)

    with autd3_array(tap.address, ONE) as device:
        report = device.play(clear_any_exposure(drive, device), progress=lose)
        assert tap.lost == 5
        assert report.frames == 750
        assert "orders sent again" in report.units
        assert tap.states() == [PATTERN]
    (port,) = tap.answers
    np.testing.assert_array_equal(switched_to(tap, port)[1], phase_bytes(drive, 1)[:, 0])
    assert_last_word_is_silence(tap)


# Slow, since a busy computer adds answers that are late to those that are lost.
@pytest.mark.slow
def test_a_play_survives_two_lost_datagrams_of_a_hundred(tap):
    drive = noise(4000)
    with autd3_array(tap.address, ONE) as device:
        tap.loss = 0.02
        report = device.play(clear_any_exposure(drive, device))
        tap.loss = 0.0
        assert tap.lost > 10
        assert report.frames == 4000
        assert tap.states() == [PATTERN]
    (port,) = tap.answers
    np.testing.assert_array_equal(switched_to(tap, port, late=True)[1], phase_bytes(drive, 1)[:, 0])


@pytest.mark.long
@pytest.mark.parametrize("bank", [0, 1])
@pytest.mark.parametrize("tap", [2], indirect=True)
def test_a_switch_that_reached_some_units_only_is_taken_back_and_can_be_sent_again(tap, bank):
    """The second attempt is 50 ms after the first, so that the unit that misses it refuses it."""
    frames, levels = np.zeros((500, 2, 249), np.uint8), np.full(500, 200, np.uint8)

    def switch(bank, ahead):
        instant = (banks.now() + ahead) // TICK * TICK
        banks.switch(bank, instant)
        banks.wait_until(instant + 5_000_000)

    with autd3_array(tap.address, Placement.grid(columns=2, rows=1)) as device:
        banks = device.units
        for number in (1, 0):
            banks.load(number, frames, levels, 40)
            if number == bank:
                break
            switch(number, 100_000_000)
        tap.lose(SWITCH)
        with pytest.raises(TooLateError):
            switch(bank, 55_000_000)
        assert tap.lost == 1
        assert_last_word_is_silence(tap)
        assert not banks.emitting()
        switch(bank, 100_000_000)
        assert banks.emitting()


@pytest.mark.long
def test_a_datagram_that_is_lost_again_and_again_ends_playing(tap):
    def lose(done, _):
        if done == 250:
            for _again in range(9):
                tap.lose(SWITCH)

    with pytest.raises(LinkLostError, match=r"frames \d+ to 1499 of 1500"), autd3_array(tap.address, ONE) as device:
        device.play(clear_any_exposure(noise(1500), device), progress=lose)
    assert tap.lost == 5


@pytest.mark.long
def test_doubled_datagrams_are_refused_at_opening_and_harmless_later(tap):
    tap.twice = True
    with pytest.raises(LinkLostError, match="datagrams arrive twice: connect the units to a card of their own"):
        autd3_array(tap.address, ONE).open()
    assert not any(command in (WRITE, SWITCH) for _, _, command, _ in tap.frames())
    tap.twice = False
    with autd3_array(tap.address, ONE) as device:
        tap.twice = True
        report = device.play(clear_any_exposure(noise(600), device))
    assert report.units == "not too hot, no errors"
    assert patterns(tap) == [PATTERN]


@pytest.mark.long
def test_units_do_not_execute_replayed_commands(tap):
    """A unit executes the next number of its sequence only; it answers old commands with the last one that it executed.

    The emulator contains the makers' own firmware logic. A flipped bit is another matter: the command has no checksum,
    so that only those of UDP and Ethernet protect it.
    """
    with autd3_array(tap.address, ONE) as device:
        device.play(clear_any_exposure(noise(600), device))
    answers = []
    tap._back = lambda datagram, _: answers.append(datagram)
    old = [(port, datagram) for _, port, command, datagram in tap.frames() if command in (WRITE, SWITCH)]
    last = tap.sequence[old[0][0]]
    for port, datagram in old:
        before = len(answers)
        tap.inner.sendto(datagram, ("::1", port))
        wait_until(lambda before=before: len(answers) > before)
    assert {answer[4] for answer in answers} == {last}
    port, datagram = old[0]
    tap.inner.sendto(datagram[:4] + bytes([(last + 1) % 256]) + datagram[5:], ("::1", port))
    wait_until(lambda: answers[-1][4] == (last + 1) % 256)


@pytest.mark.long
def test_a_hang_of_python_leaves_no_standing_frame_under_the_heartbeat(tap):
    """The SDK's heartbeat continues, so that the failsafe does not act: each block ends in a silent pattern instead."""
    sounds, since = [], []

    def hang(done, _total):
        if done > 900:
            sounds.append(device.emitting)
            since.append(time.monotonic())
            time.sleep(1.0)
            sounds.append(device.emitting)
            raise RuntimeError("hung")

    with autd3_array(tap.address, ONE) as device, pytest.raises(RuntimeError, match="hung"):
        device.play(clear_any_exposure(noise(500), device, repeats=10), progress=hang)
    assert sounds == [True, False]
    beats = [at for at, _, _ in tap.sent if since[0] < at < since[0] + 1]
    assert len(beats) > 30
    assert max(np.diff(beats)) < 0.4


@pytest.mark.long
def test_silence_from_another_thread_ends_playing(tap):
    import threading

    with autd3_array(tap.address, ONE) as device:
        timer = threading.Timer(0.1, device.silence)

        def begin(done, total):
            if done == 0:
                timer.start()

        with pytest.raises(DeviceError, match="by another thread"):
            device.play(clear_any_exposure(noise(5000), device), progress=begin)
        assert tap.states() == [PATTERN]
        assert_last_word_is_silence(tap)


@pytest.mark.long
def test_units_that_are_too_hot_from_the_start_never_sound_and_play_once_they_have_cooled(tap):
    tap.hot = range(65536)
    with autd3_array(tap.address, ONE) as device:
        with pytest.raises(TooHotError, match=r"unit 0 too hot before the first frame; let them cool"):
            device.play(clear_any_exposure(noise(300), device))
        assert SWITCH not in {command for _, _, command, _ in tap.frames()}
        tap.hot = ()
        assert device.play(clear_any_exposure(noise(20), device)).units == "not too hot, no errors"


@pytest.mark.long
@pytest.mark.parametrize(
    ("tap", "rate"), [(2, 1000.0), pytest.param(1, 0.625, marks=pytest.mark.long)], indirect=["tap"]
)
def test_a_unit_that_gets_too_hot_silences_all_units_at_once(tap, rate):
    """Units are queried every quarter of a second, also within a longer frame."""
    placement, began = Placement.grid(columns=tap.units, rows=1), []
    array = placement.array()
    drive = Drive(phase=np.zeros((2000, array.count)), level=np.ones(2000), rate=rate, array=array)

    def heat(done, total):
        if not began:
            tap.hot = {max(tap.sequence)}
            began.append(time.monotonic())

    with autd3_array(tap.address, placement) as device:
        with pytest.raises(TooHotError, match=r"got unit \d too hot after \d+ of 2000 frames"):
            device.play(clear_any_exposure(drive, device), progress=heat)
        assert tap.states() == [PATTERN] * placement.units
    assert_last_word_is_silence(tap)
    silent = next(at for at, _, command, datagram in tap.frames() if at > began[0] and command == SILENCE)
    assert silent - began[0] < 0.6


def heat_once(tap, hot, *, at=0, seconds=0.2):
    """A progress callback that makes the units too hot once, from frame `at` on and for some seconds."""

    def progress(done, total):
        if done >= at and not hot:
            tap.hot = range(65536)
            hot.append(time.monotonic())
            threading.Timer(seconds, lambda: setattr(tap, "hot", ())).start()

    return progress


@pytest.mark.long
def test_a_play_that_may_wait_is_silent_while_a_unit_is_too_hot_and_continues_at_the_same_frame(tap):
    drive, hot, told = noise(1500), [], []
    with autd3_array(tap.address, ONE) as device:
        device.cooling = Cooling(report=lambda text: told.append((time.monotonic(), text)))
        report = device.play(clear_any_exposure(drive, device), progress=heat_once(tap, hot, at=250))
    assert (report.frames, report.duration) == (1500, 1.5)
    assert 1.0 < report.paused < 5.0
    assert [text.partition(";")[0].partition(" after")[0] for _, text in told] == [
        "array: expected units that are not too hot, got unit 0 too hot",
        "units have cooled",
    ]
    paused, continued = (at for at, _ in told)
    silent = next(at for at, _, command, _ in tap.frames() if at > hot[0] and command == SILENCE)
    assert silent <= paused
    assert paused - hot[0] < 0.3
    between = {command for at, _, command, _ in tap.frames() if silent < at < continued - 0.05}
    assert not between & {SWITCH, WRITE, CONFIG}, "nothing but questions while it pauses"
    # Frames before the pause, then all from the paused one on: none is left out.
    sent, wanted = phases_sent(tap), phase_bytes(drive, 1)[:, 0]
    frame = int(re.search(r"after (\d+) of 1500 frames", told[0][1])[1])
    np.testing.assert_array_equal(sent[-(1500 - frame) :], wanted[frame:])
    np.testing.assert_array_equal(sent[: len(sent) - (1500 - frame)], wanted[: len(sent) - (1500 - frame)])
    assert_last_word_is_silence(tap)


@pytest.mark.long
def test_a_pause_has_a_limit_and_other_threads_can_end_it(tap):
    tap.hot, told = range(65536), []
    with autd3_array(tap.address, ONE) as device:
        device.cooling = Cooling(limit=0.3)
        with pytest.raises(TooHotError, match=r"no second without heat in a pause of 0\.3 s; let them cool"):
            device.play(clear_any_exposure(noise(50), device))
        device.cooling = Cooling(report=lambda text: (told.append(text), threading.Timer(0.1, device.silence).start()))
        with pytest.raises(DeviceError, match="silenced by another thread"):
            device.play(clear_any_exposure(noise(50), device))
    assert len(told) == 1
    assert SWITCH not in {command for _, _, command, _ in tap.frames()}


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_signals_silence_on_the_way_out(tap, number):
    with playing(tap) as process:
        process.send_signal(number)
        process.wait(10)
    assert patterns(tap) == [PATTERN]
    assert_last_word_is_silence(tap)


def kill_and_look(tap, after):
    with playing(tap) as process:
        time.sleep(after)
        process.kill()
        process.wait(10)
    killed = time.monotonic()
    time.sleep(0.55)
    assert max(at for at, _, _ in tap.sent) <= killed
    assert [state & FAILSAFE for state in tap.states()] == [FAILSAFE]


@pytest.mark.long
def test_the_failsafe_silences_after_a_kill(tap):
    kill_and_look(tap, 0.1)


@pytest.mark.long
def test_the_failsafe_silences_when_the_process_is_stopped(tap):
    """SIGSTOP, as for a computer in sleep mode or a paused machine."""
    with playing(tap) as process:
        process.send_signal(signal.SIGSTOP)
        time.sleep(0.55)
        states = tap.states()
        process.kill()
        process.wait(10)
    assert [state & FAILSAFE for state in states] == [FAILSAFE]


PLAYS_AGAIN = """
import sys
import numpy as np
from midair.devices import Cooling, autd3_array
from midair.errors import SilentFramesError
from midair.model import Drive, Placement
from tests.simulators.exposure_override import clear_any_exposure

placement = Placement.grid(columns=1, rows=1)
array = placement.array()
drive, short = (Drive(phase=np.ones((n, array.count)), level=np.ones(n), rate=1000.0, array=array) for n in (3000, 300))
with autd3_array(sys.argv[1], placement) as device:
    try:
        device.play(clear_any_exposure(drive, device), progress=lambda done, total: print("plays", flush=True))
    except SilentFramesError as wrong:
        print(wrong, flush=True)
    report = device.play(clear_any_exposure(short, device))
    print(report.frames, report.late, report.units, flush=True)
"""


@pytest.mark.long
def test_a_hang_that_trips_the_failsafe_ends_the_play_with_the_silent_frames_and_the_next_play_sounds(tap):
    command = [sys.executable, "-c", PLAYS_AGAIN, tap.address]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "plays\n"
        begun = time.monotonic()
        time.sleep(0.3)
        process.send_signal(signal.SIGSTOP)
        stopped = 1000 * (time.monotonic() - begun)
        time.sleep(0.8)  # the failsafe acts after 0.5 s
        process.send_signal(signal.SIGCONT)
        said = [line for line in process.communicate(timeout=20)[0].splitlines() if line != "plays"]
    first = int(re.search(r"failsafe silenced unit 0: frames (\d+) to 2999 of 3000", said[0])[1])
    # What lay in the two memories sounds on for up to two blocks; nothing comes after them.
    assert first % 250 == 0
    assert stopped - 250 <= first <= stopped + 750
    assert said[1] == "300 0 not too hot, unit 0 counted failsafe 1 times"
    assert process.returncode == 0
    assert patterns(tap) == [PATTERN]


@pytest.mark.slow
def test_fifty_kills_at_random_moments(tap):
    for after in np.random.default_rng(7).uniform(0, 0.6, 50):
        kill_and_look(tap, after)


def test_units_report_that_they_are_emulated(tap):
    device = autd3_array(tap.address, ONE)
    device.simulated = False
    with device:
        assert device.simulated


@pytest.mark.parametrize(
    ("where", "error", "words"),
    [
        ("simulator:50123", LinkLostError, r"no simulator answers at \[::1\]:50123"),
        ("server:50124", LinkLostError, r"no server accepts a connection at \[::1\]:50124"),
        ("[::1]:9", DeviceError, "check power, cables"),
    ],
)
def test_what_does_not_run_is_an_error_with_advice(where, error, words):
    with pytest.raises(error, match=words):
        autd3_array(where, ONE).open()


def test_a_server_does_not_play_single_frames_since_its_heartbeat_keeps_units_on():
    with pytest.raises(UnknownDeviceError, match="a server's heartbeat keeps them on"):
        autd3_immediate("server", ONE).open()


def test_a_simulator_at_its_port_receives_the_geometry(tap):
    """The emulator accepts no geometry, which a simulator receives at the next port: the SDK fails there."""
    port = int(tap.address.rsplit(":", 1)[1])
    with pytest.raises(LinkLostError, match=rf"did not answer the geometry at \[::1\]:{port + 1}"):
        autd3_array(f"simulator:{port}", ONE).open()
    assert tap.sent


def test_a_server_at_its_port_that_does_not_answer_is_an_error():
    with socket.create_server(("::1", 0), family=socket.AF_INET6) as server:
        port = server.getsockname()[1]
        with pytest.raises(LinkLostError, match=r"the server did not answer within 1s"):
            autd3_array(f"server:{port}", ONE).open()
        call, _ = server.accept()
        with call:
            assert len(call.recv(4096)) > 0  # the SDK speaks first
