"""Stop at any moment, from start-up to end: nothing sounds after the answer."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from tests.drives import Loud, noise
from tests.simulators.exposure_override import clear_any_exposure

from midair.devices import (
    BankedArray,
    ExposureChoices,
    VirtualArray,
    check_exposure,
    ordered_at,
    state_folder,
    stop_playing,
)
from midair.devices.arrays.banks import Banks
from midair.devices.safety.stop_channel import uptime
from midair.errors import DeviceError, HeldError, StoppedError
from midair.files import profile_named, save_solution
from midair.model import Placement, Solution

ONE = Placement.grid(columns=1, rows=1)
MS = 1_000_000
PLAYER = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN); from midair.cli import main; main()"


class ClockedBanks(Banks):
    """Banks of units that record when they sound, on this computer's clock; commands arrive with a delay."""

    emulated, frames_max, margin, patience, failsafe = True, 1024, 2 * MS, 2 * MS, 0.0

    def __init__(self, rng):
        self.rng, self.frames, self.sounds = rng, {}, []

    def _way(self):
        time.sleep(self.rng.uniform(0, 2e-3))

    def set_silencer(self, silencer):
        self._way()

    def load(self, bank, phases, intensity, divider):
        self._way()
        self.frames[bank] = len(phases) * divider * 25_000

    def switch(self, bank, instant):
        self._way()
        self.sounds.append((instant, instant + self.frames[bank]))

    def now(self):
        return time.monotonic_ns()

    def wait_until(self, instant):
        time.sleep(max(0, instant - self.now()) * 1e-9)

    def silence(self):
        self._way()
        now = self.now()
        self.sounds = [(begin, min(end, now)) for begin, end in self.sounds if begin < now]

    def emitting(self):
        return any(begin <= self.now() < end for begin, end in self.sounds)

    def describe(self):
        return {}

    def close(self):
        self.silence()

    def sounds_after(self, instant):
        return [each for each in self.sounds if each[1] > instant]


def stopped_at(seed):
    """Play in a thread and stop at a random moment; return the sound after the answer, the answers, the end, and if it
    sounded.

    One in four stops comes during the start, one during sound, one after the end, and one at any time.
    """
    rng = np.random.default_rng(seed)
    banks = ClockedBanks(np.random.default_rng(seed + 1))
    opening, checking = rng.uniform(0, 0.02), rng.uniform(0, 0.02)

    def connect(_):
        time.sleep(opening)
        return banks

    array = BankedArray(connect, ONE, name="clocked", block=0.02)
    ordered, ended, drive = uptime(), [], noise(100)

    def play():
        try:
            with ordered_at(ordered), array.reserved():
                time.sleep(checking)
                clearance = clear_any_exposure(drive, array)
                with array:
                    array.play(clearance)
        except StoppedError:
            ended.append("stopped")
        else:
            ended.append("played")

    player = threading.Thread(target=play)
    player.start()
    while (seed % 4 == 1 and not (banks.sounds or ended)) or (seed % 4 == 2 and not ended):
        time.sleep(0.001)
    time.sleep(rng.uniform(0, (0.05, 0.1, 0.01, 0.22)[seed % 4]))
    answers = [one.outcome for one in stop_playing()]
    answered = banks.now()
    player.join(20)
    return banks.sounds_after(answered), answers, ended, len(banks.sounds) > 0


def stop_often(times):
    results = [stopped_at(seed) for seed in range(times)]
    assert [seed for seed, (after, *_) in enumerate(results) if after] == []
    assert {answer for _, answers, _, _ in results for answer in answers} == {"silent"}
    # Before anything sounded, while it did, and after its end: all of it was tried.
    kinds = {(ended, sounded) for _, _, (ended,), sounded in results}
    assert kinds >= {("stopped", False), ("stopped", True), ("played", True)}


@pytest.mark.long
def test_nothing_sounds_after_a_stop_at_random_moments():
    stop_often(12)


@pytest.mark.slow
def test_nothing_sounds_after_a_stop_at_two_hundred_random_moments():
    stop_often(200)


def by_command(tap, folder, moment):
    """`midair play` in a process that ignores SIGINT, as in the background; stopped after a while by `midair stop`."""
    drive = noise(600, level=0.01)
    solution = Solution(drive=drive, error=np.zeros(600), iterations=np.ones(600, int), status=("converged",) * 600)
    path, placement = folder / "a.drive.h5", folder / "one.toml"
    if not path.exists():
        save_solution(solution, path)
        placement.write_text('name = "one"\n[[unit]]\nposition_mm = [0, 0, 0]\n', encoding="utf-8")
    device = ["--device", f"autd3:{tap.address}", "--placement", str(placement), "--attenuate"]
    command = [sys.executable, "-c", PLAYER, "play", str(path), *device]
    begin = len(tap.sent)
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as player:
        time.sleep(moment)
        answers = [one.outcome for one in stop_playing()]
        answered = time.monotonic()
        out, err = player.communicate(timeout=60)
    orders = [(at, kind) for at, _, kind, _ in tap.frames() if kind in (0x12, 0x16)]
    new = [(at, kind) for at, kind in orders if at >= tap.sent[begin][0]] if len(tap.sent) > begin else []
    return new, answered, answers, player.returncode, out + err


def check_by_command(tap, folder, times, longest):
    rng = np.random.default_rng(0)
    endings = []
    for _ in range(times):
        orders, answered, answers, status, said = by_command(tap, folder, rng.uniform(0, longest))
        assert set(answers) <= {"silent"}
        assert "Traceback" not in said
        # The switch of a bank is what makes sound, and the last word before the answer is silence.
        assert [at for at, kind in orders if kind == 0x12 and at > answered] == []
        before = [kind for at, kind in orders if at <= answered]
        assert not before or before[-1] == 0x16
        assert status == (0 if "\ntiming " in said else 1), said
        endings.append((status, bool(before)))
    return endings


@pytest.mark.long
def test_nothing_sounds_after_a_stop_of_a_command(tap, tmp_path):
    pytest.importorskip("autd3")
    check_by_command(tap, tmp_path, 2, 2.0)


@pytest.mark.slow
def test_nothing_sounds_after_a_stop_of_a_command_at_two_hundred_moments(tap, tmp_path):
    pytest.importorskip("autd3")
    endings = check_by_command(tap, tmp_path, 200, 4.0)
    # Some were stopped before the units were opened, some while they played, some had ended.
    assert set(endings) == {(1, False), (1, True), (0, True)}


def quiet(array):
    exposure = ExposureChoices(profile=profile_named("occupational-110"), attenuate=True)
    return check_exposure(noise(300), array, exposure)


@pytest.mark.long
def test_what_plays_from_python_is_logged_and_can_be_stopped():
    array, stops = Loud(ONE.array()), []

    def stop(done, total):
        if not stops:
            stops.extend(stop_playing())

    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with array:
            clearance = quiet(array)
            with pytest.raises(StoppedError, match="midair stop"):
                array.play(clearance, source="a script", progress=stop)
            # For as long as the array is open, in every thread.
            with pytest.raises(StoppedError, match="midair stop"):
                array.play(clearance)
            assert not array.emitting
    finally:
        signal.signal(signal.SIGINT, before)
    assert [one.outcome for one in stops] == ["silent"]
    log = (state_folder() / "played.jsonl").read_text(encoding="utf-8")
    assert log.count("\n") == 2
    assert '"a script"' in log
    assert '"midair stop"' in log
    # Opened once more, it plays once more.
    with array:
        assert array.play(clearance).frames == 300


def test_the_main_thread_is_interrupted_where_it_waits():
    array = Loud(ONE.array())
    stopper = threading.Timer(0.2, stop_playing)
    with pytest.raises(StoppedError, match="midair stop"), array:
        stopper.start()
        time.sleep(60)
        pytest.fail("the wait was not interrupted")
    stopper.join()


@pytest.mark.long
def test_a_second_program_does_not_get_an_array():
    array, other = Loud(ONE.array()), Loud(ONE.array())
    array.exclusive = other.exclusive = "autd3"
    with array:
        with pytest.raises(HeldError, match=f"process {os.getpid()} "), other:
            pass
        with pytest.raises(HeldError):
            other.play(quiet(other))
        assert array.play(quiet(array)).frames == 300
    with other:
        pass


def test_a_device_that_fails_to_open_is_not_locked():
    class Broken(Loud):
        def open(self):
            raise DeviceError("no answer")

    broken, array = Broken(ONE.array()), Loud(ONE.array())
    broken.exclusive = array.exclusive = "autd3"
    with pytest.raises(DeviceError, match="no answer"), broken:
        pass
    with array:
        pass
    assert list(Path(state_folder()).glob("*-*")) == []


def test_what_cannot_sound_asks_for_no_state_folder(monkeypatch, tmp_path):
    (tmp_path / "file").touch()
    monkeypatch.setenv("MIDAIR_STATE", str(tmp_path / "file" / "state"))
    with VirtualArray(ONE.array()) as array:
        assert array.play(clear_any_exposure(noise(5), array)).frames == 5
