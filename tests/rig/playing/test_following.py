"""Frames steered to a palm that a tracker reports: what sounds, when it is silent, and what the units get."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.palms import palm_path

from midair.cli.app import run
from midair.devices import ExposureChoices, VirtualUnits, check_exposure, phase_bytes, virtual_immediate
from midair.errors import ExposureError, InputError, UnknownDeviceError
from midair.files import DEFAULT_PROFILE, profile_named, save_palm_path
from midair.model import Acoustics, ControlGrid, Drive, PalmPath, Placement, TransducerArray
from midair.physics import (
    PoseBox,
    exposure,
    focus_phase,
    middle_of,
    on_the_palm,
    poses_at,
    propagate,
    steering_phase,
)
from midair.rig import PlaySettings, open_tracker, play
from midair.rig.playing import Follower, clear_followed, follow_simulated, immediate_array, play_followed, tracker_name
from midair.settings import Settings

ARRAY = TransducerArray.autd3(columns=1, rows=1)
GRID = ControlGrid(rows=4, columns=4, pitch=5e-3)
SOLVED = middle_of(GRID)
AIR = Acoustics()


def palm(centre, time=None, *, confidence=1.0, tilt=0.0) -> PalmPath:
    """A palm along centres (pose, 3) in m from the solved place, 100 poses a second."""
    centre = np.atleast_2d(centre) + SOLVED
    time = np.arange(len(centre)) / 100 if time is None else np.asarray(time)
    return palm_path(time, centre, confidence=confidence, tilt=tilt)


def swaying(duration=0.6) -> PalmPath:
    time = np.arange(round(duration * 100)) / 100
    return palm(np.stack([10e-3 * np.sin(2 * np.pi * time), 0 * time, 4e-3 * time], axis=1))


def focus(frames=600, rate=1000.0) -> Drive:
    phase = np.broadcast_to(focus_phase(ARRAY, SOLVED, acoustics=AIR), (frames, ARRAY.count))
    return Drive(phase=phase, level=np.full(frames, 0.5), rate=rate, array=ARRAY, acoustics=AIR)


def followed(path: PalmPath, folder, *, latency=0.0, freeze=0.0, drive=None, **options) -> tuple[Drive, list[str]]:
    file, lines = folder / "hand.csv", []
    save_palm_path(path, file)
    name = tracker_name(f"replay:{file}?freeze={freeze}", latency)
    return follow_simulated(drive or focus(), name, GRID, report=lines.append, **options), lines


def test_the_focus_stays_on_the_palm(tmp_path) -> None:
    truth = swaying()
    still = np.abs(propagate(focus(1), SOLVED[None]))[0, 0]
    times = np.arange(600) / 1000
    places = on_the_palm(SOLVED[None], SOLVED, poses_at(truth, times))[:, 0]
    for latency, least in ((0.0, 0.97), (0.02, 0.9)):
        steered, lines = followed(truth, tmp_path, latency=latency)
        assert lines[0].endswith("the palm is followed")
        some = range(200, 580, 20)
        loud = [np.abs(propagate(_frame(steered, at), places[[at]]))[0, 0] for at in some]
        assert min(loud) > least * still
    unsteered = [np.abs(propagate(_frame(focus(), at), places[[at]]))[0, 0] for at in range(200, 580, 20)]
    assert min(unsteered) < 0.5 * still


def _frame(drive: Drive, at: int) -> Drive:
    return replace(drive, phase=drive.phase[[at]], level=drive.level[[at]])


def test_the_steering_is_smooth_between_poses(tmp_path) -> None:
    steered, _ = followed(swaying(), tmp_path, latency=0.02)
    turn = np.diff(np.unwrap(steered.phase[100:], axis=0), n=2, axis=0)
    # 10 mm at 1 Hz bend the phase by less than .01 rad a frame squared; a held pose steps by .3 rad.
    assert np.abs(turn).max() < 0.05


CENTRE = np.zeros((60, 3))
LEAVES = CENTRE + np.where((np.arange(60) > 20) & (np.arange(60) < 40), 1, 0)[:, None] * [0, 0.04, 0]
FAR = CENTRE + np.clip(np.arange(60) - 20, 0, 20)[:, None] * [4e-3, 0, 0]


@pytest.mark.parametrize(
    ("path", "silent", "reason"),
    [
        (palm(FAR), (0.36, 0.58), "left the box"),
        (palm(CENTRE, confidence=np.where(np.arange(60) < 25, 1.0, 0.2)), (0.28, 0.58), "confidence 0.20"),
        (palm(CENTRE[:25]), (0.38, 0.58), "no pose for 100 ms"),
        (palm(CENTRE, tilt=0.4), (0.0, 0.58), "left the box"),
        (palm(CENTRE + np.minimum(np.arange(60), 20)[:, None] * [1e-3, 0, 0]), (0.33, 0.58), "not changed for 100 ms"),
    ],
    ids=["leaves the box", "low confidence", "tracker dies", "tilted", "freezes"],
)
def test_it_is_silent_when_the_palm_is_not_sure(path, silent, reason, tmp_path) -> None:
    steered, lines = followed(path, tmp_path, freeze=0.1 if "changed" in reason else 0.0)
    begin, end = (round(1000 * each) for each in silent)
    assert steered.level[begin:end].max() == 0
    assert steered.level[max(begin - 120, 0) : max(begin - 60, 0)].max(initial=0.5) == 0.5
    assert any(reason in line for line in lines) or "tilted" in reason or begin == 0


def test_it_comes_back_with_the_palm_and_the_log_says_when(tmp_path) -> None:
    away = palm(CENTRE, time=np.r_[np.arange(20), 60 + np.arange(40)] / 100)
    steered, lines = followed(away, tmp_path, drive=focus(900))
    assert [line.partition(": ")[2].split(",")[0] for line in lines if "follow:" in line] == [
        "follow: the palm is followed",
        "follow: no pose for 100 ms",
        "follow: the palm is followed",
    ]
    gone, back = (float(line.split(" ")[0]) for line in lines if "follow:" in line and not line.startswith("0.000"))
    assert (gone, back) == (pytest.approx(0.29, abs=0.003), pytest.approx(0.6, abs=0.003))
    # Faded within 20 ms, and risen as fast.
    assert steered.level[round(1000 * gone) + 20] == 0
    assert steered.level[round(1000 * back) + 20] == 0.5


@pytest.fixture(scope="module")
def solved() -> Drive:
    """A drive of .3 s that states its settings: a focus that swings at 100 Hz."""
    swing = 0.5 + 0.3 * np.sin(2 * np.pi * 100 * np.arange(300) / 1000)
    drive = replace(focus(300), level=swing)
    return replace(drive, provenance=Settings().but(grid=GRID).noted(drive.provenance))


@pytest.mark.long
def test_play_on_the_virtual_array_moves_the_palm_and_follows_it(solved, tmp_path) -> None:
    """The sensor on the moving palm records the rest's signal if it is followed, and another one if not."""
    file = tmp_path / "hand.csv"
    save_palm_path(palm(np.linspace(0, 1, 40)[:, None] * [12e-3, 0, 0]), file)
    rest = play(solved).take.recording.samples
    moved = play(solved, palm_path=file).take.recording.samples
    kept = play(solved, palm_path=file, follow=f"replay:{file}")
    assert kept.followed[0].endswith("the palm is followed")
    assert kept.take.recording.provenance.last("follow")["tracker"] == f"replay:{file}"
    part = slice(150, 290)
    alike = [np.corrcoef(rest[part].ravel(), each[part].ravel())[0, 1] for each in (moved, kept.take.recording.samples)]
    assert alike[0] < 0.8 < 0.97 < alike[1]


@pytest.mark.long
def test_compare_works_on_what_a_moving_palm_felt(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    save_palm_path(palm(np.linspace(0, 1, 60)[:, None] * [15e-3, 0, 5e-3]), Path("hand.csv"))
    assert run(["record", "virtual:towel", "take.h5", "--duration", "0.6s"]) == 0
    assert (
        run(["solve", "take.h5", "take.drive.h5", "--method", "fast", "--start-at", "0.4s", "--duration", "0.06s"]) == 0
    )
    found = []
    for number, more in enumerate(([], ["--palm-path", "hand.csv"], ["--palm-path", "hand.csv", "--follow"])):
        more = [*more, "replay:hand.csv", "--tracker-latency", "5ms"] if "--follow" in more else more
        assert run(["play", "take.drive.h5", "--output", f"{number}.h5", *more]) == 0
        capsys.readouterr()
        assert run(["compare", "take.h5", f"{number}.h5", "--json"]) == 0
        figures = json.loads(capsys.readouterr().out)["figures"]
        found.append(next(each["value"] for name, each in figures.items() if "signal to distortion" in name))
    rest, moved, followed = found
    assert moved < followed - 3
    assert abs(rest - followed) < 3


def test_a_drive_without_settings_is_not_followed(tmp_path) -> None:
    save_palm_path(swaying(), tmp_path / "hand.csv")
    with pytest.raises(InputError, match="settings of its solve"):
        play(focus(20), follow=f"replay:{tmp_path / 'hand.csv'}")


def test_the_fast_steering_is_the_steering(tmp_path) -> None:
    path, aim = tmp_path / "hand.csv", SOLVED + np.array([6e-3, -4e-3, 0.0])
    save_palm_path(swaying(), path)
    with open_tracker(f"replay:{path}") as tracker:
        follower = Follower(tracker, focus(8), GRID)
        pose = palm([[5e-3, 2e-3, -8e-3]], tilt=0.2)
        exact = steering_phase(ARRAY, AIR.medium, SOLVED, pose, aim=aim)[0]
        np.testing.assert_allclose(follower._steering(pose, aim), exact, atol=1e-9)


class AllFrames(VirtualUnits):
    """Keeps also the frames that came late, since the test's computer may be busy."""

    def __init__(self) -> None:
        super().__init__()
        self.put_frames: list = []

    def put(self, phases, intensity, instant) -> None:
        self.put_frames.append((phases.copy(), intensity, instant))
        super().put(phases, intensity, instant)


def rig_of() -> tuple:
    units = AllFrames()
    array = virtual_immediate(Placement.grid(columns=1, rows=1), units=units)
    return units, array


def test_the_units_get_the_bytes_of_the_steered_drive(tmp_path) -> None:
    file = tmp_path / "hand.csv"
    save_palm_path(swaying(0.8), file)
    settings = PlaySettings(follow=f"replay:{file}", tracker_latency=0.01)
    units, array = rig_of()
    drive, lines = focus(300), []
    with array, open_tracker(tracker_name(f"replay:{file}", 0.01)) as tracker:
        admission = clear_followed(drive, array, settings, GRID, samples=4)
        done = play_followed(drive, array, tracker, settings, admission, GRID, report=lines.append)
    sent = [each for each in units.put_frames if each[1]]
    assert done.report.frames == 300
    assert lines[0].startswith("follow: the palm is followed")
    first = done.report.start
    poses = swaying(0.8)
    for phases, _, instant in sent[100::40]:
        when = (instant - first) * 1e-9
        # The phases belong to one place of the palm, near the true one at that moment.
        true = poses_at(poses, np.array([when]))
        exact = focus_phase(ARRAY, SOLVED, acoustics=AIR) + steering_phase(ARRAY, AIR.medium, SOLVED, true)[0]
        off = phases.ravel() / 256 * 2 * np.pi - exact
        assert np.abs(np.angle(np.exp(1j * off) * np.exp(-1j * np.angle(np.exp(1j * off).sum())))).max() < 0.6
    assert done.reaction[0] < 0.2


def test_frames_of_a_block_are_bit_equal_to_the_steered_drive(tmp_path) -> None:
    """The same follower, once simulated and once as bytes: a palm that rests gives equal phases at any time."""
    file = tmp_path / "hand.csv"
    save_palm_path(palm(np.tile([[6e-3, -3e-3, 5e-3]], (100, 1))), file)
    settings = PlaySettings(follow=f"replay:{file}")
    units, array = rig_of()
    drive = focus(200)
    steered = follow_simulated(drive, f"replay:{file}", GRID, report=lambda _: None)
    with array, open_tracker(f"replay:{file}") as tracker:
        admission = clear_followed(drive, array, settings, GRID, samples=4)
        play_followed(drive, array, tracker, settings, admission, GRID, report=lambda _: None)
    expected = np.asarray(phase_bytes(steered, 1))[150]
    loud = [phases for phases, intensity, _ in units.put_frames if intensity == 128]
    assert len(loud) > 50
    assert all(np.array_equal(phases, expected) for phases in loud)


class Loud:
    name, array, gated, steps_a_turn = "loud", TransducerArray.autd3(), True, 256


@pytest.mark.long
def test_steered_frames_are_weakened_to_the_profile_and_refused_outside_the_box() -> None:
    array, profile = Loud.array, profile_named(DEFAULT_PROFILE)
    rng = np.random.default_rng(0)
    drive = Drive(phase=rng.uniform(0, 6, (8, array.count)), level=np.full(8, 0.05), rate=1000.0, array=array)
    settings = PlaySettings(exposure=ExposureChoices(profile=profile, attenuate=True))
    cleared = clear_followed(drive, Loud, settings, GRID, samples=16)
    assert cleared.outcome in ("kept", "attenuated")
    # All transducers in phase at an ear: far above the limit.
    ear = np.array(profile.places[0].position)
    loud = replace(drive, phase=np.tile(focus_phase(array, ear), (8, 1)))
    rest = palm(np.zeros((8, 3)))
    safe = cleared.steered(loud, rest)
    assert exposure(loud, profile).excess > 0 >= exposure(safe, profile, acoustics=cleared.exposure.airs).excess
    with pytest.raises(ExposureError, match="outside"):
        cleared.steered(drive, palm(np.tile([[0.06, 0, 0]], (8, 1))))
    with pytest.raises(ExposureError, match="check_exposure_steered"):
        check_exposure(drive, Loud, settings.exposure).steered(drive, rest)
    with pytest.raises(ExposureError, match="of full drive"):
        cleared.steered(replace(drive, level=np.ones(8)), rest)


def test_devices_without_single_frames_are_refused() -> None:
    with pytest.raises(UnknownDeviceError, match="single frames"):
        immediate_array(PlaySettings(device="pyautd3"), 1000.0)
    with pytest.raises(InputError, match="palm-path"):
        immediate_array(PlaySettings(device="autd3:emulator", palm_path=palm([[0, 0, 0]])), 1000.0)
    with pytest.raises(InputError, match="expected --follow"):
        PlaySettings(tracker_latency=0.02)


def test_the_box_admits_poses_by_place_and_tilt() -> None:
    box = PoseBox()
    poses = palm([[0.049, 0, 0], [0.051, 0, 0], [0, 0, 0.031], [0, -0.049, -0.029]])
    assert box.inside(poses, SOLVED).tolist() == [True, False, False, True]
    assert not box.inside(palm([[0, 0, 0]], tilt=np.radians(16)), SOLVED).any()
