"""A pressure is solved while it plays: nothing sounds unchecked, and an error anywhere ends in silence."""

import subprocess
import sys
import time
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from tests.drives import Loud, log
from tests.simulators.udp_proxy import UdpProxy
from tests.waiting import wait_until

from midair.cli import run
from midair.devices import ExposureChoices, measure_exposure
from midair.errors import ExposureError, InputError
from midair.files import load_solution, profile_named, save_solutions
from midair.model import PressureFrames, SensorGrid, TransducerArray
from midair.pipeline import reproduce_stream
from midair.rig import PlaySettings, open_rig, play, play_pressure, record
from midair.rig.opening import OpenRig
from midair.rig.playing.solving_ahead import SolvedAhead
from midair.settings import Settings
from midair.solvers import Glide

ARRAY = TransducerArray.autd3()
QUICK = Settings().but(
    method=Glide(cold=(10, 4, 10), bent=(4, 4, 4), rough=(6, 4, 4), block=256, jobs=1), rate=20.0, gain=1e-4
)
"""With 20 frames in a second, the first part of 257 frames lasts longer than everything else takes to solve."""
SURE = ExposureChoices(profile=profile_named("occupational-110"), override="A Person")
QUIET_ENOUGH = ExposureChoices(profile=SURE.profile.under(200.0))
FAILSAFE = 0x80
"""Bit of the state of a unit that its failsafe silenced."""


@pytest.fixture(autouse=True)
def _folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MIDAIR_STATE", "state")


def pressure(frames=800, rate=20.0):
    rng = np.random.default_rng(0)
    smooth = np.cumsum(rng.normal(size=(frames, 4, 4)), axis=0)
    # The touch moves to a corner, where the sound at one ear is louder.
    smooth[:300, [0, -1]], smooth[300:, 1:] = 0, 0
    return PressureFrames(pressure=smooth, rate=rate, sensor=SensorGrid())


def loud(exposure, device=None):
    return OpenRig(array=device or Loud(ARRAY), sensor=None, settings=PlaySettings(exposure=exposure))


def solver_that(does, monkeypatch):
    """The solver does something before each part, given its number, and the play begins with the first one."""

    def parts(*arguments, **how):
        target, made = reproduce_stream(*arguments, **how)

        def parts():
            for number, part in enumerate(made):
                does(number)
                yield part

        return target, parts()

    monkeypatch.setattr("midair.rig.playing.solving_ahead.reproduce_stream", parts)
    monkeypatch.setattr("midair.rig.playing.solving_ahead.SolvedAhead._lacks", lambda _: (0.0, np.inf))


@pytest.fixture(name="solved", scope="module")
def _solved(tmp_path_factory):
    """The file that `midair solve` writes."""
    path = tmp_path_factory.mktemp("solved") / "a.drive.h5"
    target, parts = reproduce_stream(pressure(), ARRAY, QUICK)
    save_solutions(parts, path, frames=target.frames, target=target)
    return path


@pytest.mark.long
def test_the_drive_is_that_of_a_solve_to_the_last_bit(solved):
    played = play_pressure(pressure(), QUICK, loud(SURE), path="b.drive.h5")
    with h5py.File("b.drive.h5") as one, h5py.File(solved) as other:
        assert set(one) == set(other)
        for name in one:
            np.testing.assert_array_equal(one[name][()], other[name][()], err_msg=name)
    assert (played.report.frames, len(played.error), played.outcome) == (800, 800, "overridden")
    end = log()[-1]
    assert (end["outcome"], end["checked"]["frames"]) == ("played", 800)
    whole = measure_exposure(load_solution(solved).drive, ARRAY, SURE.profile)
    assert end["checked"]["places"]["left ear"]["peak_db"] == pytest.approx(whole.peak[0], abs=0.02)


@pytest.mark.long
def test_the_virtual_rig_rerecords_what_it_would_of_the_file():
    played = play_pressure(pressure(400, 1000.0), QUICK.but(rate=1000.0), open_rig(), path="b.drive.h5")
    heard = play(load_solution("b.drive.h5")).take.recording
    np.testing.assert_allclose(played.take.recording.samples, heard.samples, atol=1e-9)


@pytest.mark.long
def test_an_inadmissible_later_part_ends_the_play_in_silence_and_leaves_no_file(solved, monkeypatch):
    solver_that(lambda part: part and wait_until(Path("state/played.jsonl").exists), monkeypatch)
    drive = load_solution(solved).drive
    part = replace(drive, phase=drive.phase[:257], level=drive.level[:257])
    first, rest = (measure_exposure(each, ARRAY, SURE.profile).peak for each in (part, drive))
    # Only the place that gets louder later is limited.
    louder = int((rest - first)[:3].argmax())
    assert rest[louder] > first[louder] + 0.2, "the case needs a later part that is louder"
    limits = np.full(len(first), 200.0)
    limits[louder] = first[louder] + 0.1
    places = tuple(replace(each, limit=limit) for each, limit in zip(SURE.profile.places, limits, strict=True))
    device = Loud(ARRAY)
    with pytest.raises(ExposureError, match="dB too loud: "):
        choices = ExposureChoices(profile=replace(SURE.profile, places=places))
        play_pressure(pressure(), QUICK, loud(choices, device), path="b.drive.h5")
    assert not device.emitting
    assert list(Path().glob("*drive*")) == []
    assert (log()[-1]["outcome"], log()[-1]["checked"]["frames"]) == ("failed", 257)


@pytest.mark.long
def test_a_person_who_overrides_answers_for_all_parts_before_the_first_sound(monkeypatch):
    """A louder part came in while the first one sounded, and no bound held it."""
    sounds = []
    solver_that(lambda _: sounds.append(Path("state/played.jsonl").exists()), monkeypatch)
    played = play_pressure(pressure(), QUICK, loud(SURE))
    assert sounds == [False, False]
    assert played.outcome == "overridden"


@pytest.mark.long
def test_an_error_of_the_solver_silences_the_array(monkeypatch):
    def fail(number):
        if number:
            wait_until(Path("state/played.jsonl").exists)
            raise InputError("the solver: expected to go on, got an error")

    solver_that(fail, monkeypatch)
    device = Loud(ARRAY)
    with pytest.raises(InputError, match="expected to go on"):
        play_pressure(pressure(), QUICK, loud(QUIET_ENOUGH, device), path="b.drive.h5")
    assert not device.emitting
    assert (log()[-1]["outcome"], log()[-1]["checked"]["frames"]) == ("failed", 257)
    assert list(Path().glob("*drive*")) == []


@pytest.mark.long
def test_a_slow_computer_says_so_and_begins_when_the_rest_will_come_in_time():
    """Parts of .5 s take 1 s, the next one begins to sound with frame 513: 1.2 * 1 - 513 / 500 + .3 = .47 s."""
    ahead = SolvedAhead(pressure(), ARRAY, Loud(ARRAY), QUICK.but(rate=500.0), PlaySettings(), None)
    lines, now = [], time.monotonic()
    ahead._arrived, ahead._frames = [(now - 3, 0), (now - 1, 257), (now, 513)], 800
    ahead._solved, ahead._stream = Future(), SimpleNamespace(clearance=lambda: "cleared")
    ahead._news.put(None)
    assert ahead.in_time(lines.append) == "cleared"
    assert 0.473 <= time.monotonic() - now < 0.9
    (line,) = lines
    assert line == (
        "this computer solves 0.51 s of touch in a second: the first sound comes in about 1 s, so that there is no gap"
    )


def test_the_wait_of_a_high_frame_rate_names_the_quick_mode():
    ahead = SolvedAhead(pressure(), ARRAY, Loud(ARRAY), QUICK.but(rate=2000.0), PlaySettings(), None)
    lines, now = [], time.monotonic()
    ahead._arrived, ahead._frames, ahead._solved = [(now - 3, 0), (now - 1, 257), (now, 513)], 800, Future()
    with pytest.raises(StopIteration):
        ahead.in_time(lines.append, iter([None]).__next__)
    assert lines[0].endswith("so that there is no gap; mode quick begins sooner")


def test_a_short_last_part_has_the_speed_of_one_thread():
    """Two threads take as long for a block of 256 frames as for two, here 1 s; it begins to sound after 769 frames."""
    settings = QUICK.but(method=replace(QUICK.solver.solver(), jobs=2), rate=2000.0)
    ahead, now = SolvedAhead(pressure(), ARRAY, Loud(ARRAY), settings, PlaySettings(), None), time.monotonic()
    ahead._arrived, ahead._frames = [(now - 3, 0), (now - 1, 257), (now, 769)], 769 + 256
    assert ahead._lacks()[0] == pytest.approx(1.2 - 769 / 2000 + 0.3, abs=0.05)


@pytest.mark.long
def test_nothing_sounds_before_a_check_that_was_begun_earlier_is_ready():
    ready = Future()
    with SolvedAhead(pressure(), ARRAY, Loud(ARRAY), QUICK, PlaySettings(exposure=QUIET_ENOUGH), None, ready) as ahead:
        ready.set_exception(InputError("no check"))
        with pytest.raises(InputError, match="no check"):
            ahead.first_part()


def test_what_needs_the_whole_drive_is_refused():
    for settings, choices in ((QUICK.but(ears=110.0), SURE), (QUICK, replace(SURE, override=None, attenuate=True))):
        with pytest.raises(InputError, match="use midair solve"):
            play_pressure(pressure(), settings, loud(choices))


@pytest.mark.long
def test_a_play_that_waits_for_frames_is_silent_and_goes_on(monkeypatch):
    """Frames that come too late on emulated units: a gap, no repeated frame, and all frames are played."""
    pytest.importorskip("autd3")
    solver_that(lambda part: part and wait_until(Path("state/played.jsonl").exists) and time.sleep(1.0), monkeypatch)
    rig = open_rig("autd3:emulator", exposure=QUIET_ENOUGH)
    report = play_pressure(pressure(rate=1000.0), QUICK.but(rate=1000.0), rig).report
    assert (report.frames, report.repeated) == (800, 0)
    assert report.gap > 0.5
    assert report.late > 0


@pytest.mark.long
@pytest.mark.parametrize("case", ["killed", "stopped", "starved"])
def test_a_recording_that_plays_on_emulated_units_is(case, request):
    """`midair play` in a program of its own; starved: two busy programs beside it."""
    pytest.importorskip("autd3")
    tap = UdpProxy(1)
    request.addfinalizer(tap.close)
    Path("one.toml").write_text('name = "one"\n[[unit]]\nposition_mm = [0, 0, 0]\n', encoding="utf-8")
    record("virtual:towel", 4.0, path="take.h5")
    python = [sys.executable, "-c"]
    busy = [subprocess.Popen([*python, "while True: pass"]) for _ in range(2 if case == "starved" else 0)]
    words = "play take.h5 --rate 500Hz --jobs 1 --placement one.toml --drive b.drive.h5 --override-exposure A --all"
    player = [*python, "from midair.cli import main; main()", *words.split(), "--device", f"autd3:{tap.address}"]
    with subprocess.Popen(player, stdout=-1, stderr=-1, text=True) as playing:
        if case != "starved":
            wait_until(Path("state/played.jsonl").exists)
            time.sleep(0.3)
            playing.kill() if case == "killed" else run(["stop"])
        output, _ = playing.communicate(timeout=120)
    for each in busy:
        each.kill()
        each.wait()
    time.sleep(0.6)
    assert all(state & FAILSAFE for state in tap.states())
    run(["stop"])
    end = log()[-1]
    print(case, playing.returncode, end["outcome"], end["reason"], end.get("gap_s"))
    # Beside busy programs, the units can lose the computer: then all ends in silence.
    # Solving may also come too late: then the touch has gaps, which ends with status 1 as well.
    played = case == "starved" and (playing.returncode == 0 or end.get("gap_s", 0) > 0)
    assert (end["event"], end["outcome"]) == ("end", "played" if played else "failed" if case != "stopped" else case)
    # A drive that was solved before the end stays, whole.
    files = list(Path().glob("*drive*"))
    assert played <= len(files) <= 1
    assert all(load_solution(each).drive.frames == 2_150 for each in files)
    if case == "killed":
        assert "died after" in end["reason"]
    if played:
        assert end["frames"] == end["checked"]["frames"] == 2_150
        assert any(words in " ".join(output.split()) for words in (" 0 repeated", "every frame in time"))
