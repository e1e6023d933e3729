"""Frames steered to a palm that a tracker reports: what sounds, when it is silent, and what the units get."""

import gc
import re
from contextlib import closing, nullcontext
from dataclasses import replace

import numpy as np
import pytest
from benchmarks.live_outside import plain, watch_in_time
from tests.devices.trackers.test_tracker_contract import Leap, Lsl, Osc
from tests.palms import palm_path
from tests.simulators.moving_hand import Hand

from midair.cli.app import run
from midair.devices import ExposureChoices, VirtualUnits, phase_bytes, virtual_immediate
from midair.errors import ExposureError, InputError, SilentFramesError, UnknownDeviceError
from midair.files import DEFAULT_PROFILE, load_solution, profile_named, save_palm_path, save_solution
from midair.model import Acoustics, ControlGrid, Drive, PalmPath, Placement, Solution, TransducerArray
from midair.physics import (
    PalmFit,
    PoseBox,
    aims_of,
    exposure,
    focus_phase,
    middle_of,
    on_the_palm,
    poses_at,
    propagate,
    steering_phase,
)
from midair.rig import PlaySettings, open_tracker, play
from midair.rig.playing.following import (
    Follower,
    clear_followed,
    follow_simulated,
    immediate_array,
    play_followed,
    tracker_name,
)
from midair.settings import Settings
from midair.solvers import one_blas_thread

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


@pytest.mark.long
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


@pytest.mark.long
def test_the_steering_is_smooth_between_poses(tmp_path) -> None:
    steered, _ = followed(swaying(), tmp_path, latency=0.02)
    turn = np.diff(np.unwrap(steered.phase[100:], axis=0), n=2, axis=0)
    # 10 mm at 1 Hz bend the phase by less than .01 rad a frame squared; a held pose steps by .3 rad.
    assert np.abs(turn).max() < 0.05


CENTRE = np.zeros((60, 3))
FAR = CENTRE + np.clip(np.arange(60) - 20, 0, 20)[:, None] * [4e-3, 0, 0]


@pytest.mark.long
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


@pytest.mark.long
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


def test_a_drive_without_settings_is_not_followed(tmp_path) -> None:
    save_palm_path(swaying(), tmp_path / "hand.csv")
    with pytest.raises(InputError, match="settings of its solve"):
        play(focus(20), follow=f"replay:{tmp_path / 'hand.csv'}")


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


@pytest.fixture
def in_time():
    """Real-time priority, if it is granted: a frame that is late is not on the wire."""
    watch_in_time()
    yield
    plain()
    gc.enable()


@pytest.fixture
def steered(monkeypatch) -> list:
    """(frames, pose at their end, whether they rise from silence) of each block that a follower steers."""
    blocks, real = [], Follower.steered

    def kept(follower, frames, times):
        rises = follower._gain == 0
        drive, pose = real(follower, frames, times)
        blocks.append((frames, pose if follower._audible else None, rises))
        return drive, pose

    monkeypatch.setattr(Follower, "steered", kept)
    return blocks


@one_blas_thread()
def assert_bytes(sent: dict, blocks: list, drive: Drive, period: int, first: int, *, fitted: bool = False) -> int:
    """Count the frames of the wire; each equals the phases for the predicted palm, linear since the block before."""
    aims, before, found = aims_of(drive, GRID), None, 0
    fit = PalmFit(drive.array, drive.acoustics, GRID) if fitted else None
    for frames, pose, rises in blocks:
        end, beside = None, 0.0
        if pose is not None:
            aim = aims[frames.stop - 1]
            end = held = steering_phase(drive.array, AIR.medium, SOLVED, pose, aim=aim)[0]
            if fit is not None:
                fit.move(pose)
        if fit is not None and (end is not None or before is not None):
            beside = np.angle(fit(drive.phase[frames], drive.phase[frames] + held))
        if rises:
            before = end  # as after the failsafe acted: there is nothing to turn from
        if before is not None and end is not None:
            count = frames.stop - frames.start
            share = (np.arange(count) + 1)[:, None] / count
            phase = share * (end - before) + before + drive.phase[frames] + beside
            moved = replace(drive, phase=phase, level=drive.level[frames])
            for number, exact in enumerate(phase_bytes(moved, drive.array.count // 249), frames.start):
                if (got := sent.get(first + number * period)) is not None:
                    np.testing.assert_array_equal(got, exact)
                    found += 1
        before = end
    return found


@pytest.mark.long
@pytest.mark.parametrize("fit", [False, True])
def test_the_bytes_are_those_of_the_steered_drive_while_the_palm_moves(fit, in_time, steered, tmp_path) -> None:
    file = tmp_path / "hand.csv"
    save_palm_path(swaying(0.8), file)
    settings = PlaySettings(follow=f"replay:{file}", tracker_latency=0.01, steer_only=not fit)
    units, array = rig_of()
    drive, lines = focus(300), []
    with array, open_tracker(tracker_name(f"replay:{file}", 0.01)) as tracker:
        clearance = clear_followed(drive, array, settings, GRID, samples=4)
        report, reaction = play_followed(drive, array, tracker, settings, clearance, GRID, report=lines.append)
    if fit and "too slow" in str(lines):
        pytest.skip("this computer is too slow now to fit frames in time, and said so")
    assert lines[0].startswith("follow: the palm is followed")
    sent = {instant: phases for phases, _, instant in units.put_frames}
    assert assert_bytes(sent, steered, drive, 1_000_000, report.start, fitted=fit) > 200
    # The palm is that of the moment at which the frames sound, by 1.5 mm.
    for frames, pose, _ in steered[30:]:
        true = poses_at(swaying(0.8), np.array([(frames.stop - 1) / 1000]))
        assert np.linalg.norm(pose.centre - true.centre) < 1.5e-3
    assert reaction[0] < 0.2


@pytest.mark.clock
@pytest.mark.long
@pytest.mark.parametrize("sender", [Leap, Osc, Lsl])
def test_each_tracker_steers_four_emulated_units_and_the_wire_has_the_steered_bytes(
    in_time, sender, solved, steered, tap, tmp_path, capsys
) -> None:
    array = TransducerArray.autd3()
    phase = np.broadcast_to(focus_phase(array, SOLVED, acoustics=AIR), (300, array.count))
    # Half the usual rate, since the emulated units take their share of this process.
    drive = replace(solved, phase=phase, level=np.full(300, 0.4), array=array, rate=500.0)
    made = {"error": np.zeros(300), "iterations": np.ones(300, int), "status": ("converged",) * 300}
    save_solution(Solution(drive=drive, **made), tmp_path / "x.drive.h5")
    drive = load_solution(tmp_path / "x.drive.h5").drive
    with closing(sender()) as made, Hand(made, lambda values, stamp, _: (values, stamp, 1.0)):
        line = ["play", str(tmp_path / "x.drive.h5"), "--follow", made.name, "--device", f"autd3:{tap.address}"]
        assert run([*line, "--override-exposure", "a test", "--steer-only", "--all"]) == 0
    out, err = capsys.readouterr()
    assert "the palm is followed" in err
    ports, parts = list(dict.fromkeys(port for _, port, _, _ in tap.frames())), {}
    for _, port, _, datagram in (each for each in tap.frames() if each[2] == 0x16):
        instant = 1000 * int.from_bytes(datagram[6:10], "little")
        parts.setdefault(instant, {})[port] = np.frombuffer(datagram[20:269], np.uint8)
    sent = {at: np.stack([each[port] for port in ports]) for at, each in parts.items() if len(each) == len(ports) == 4}
    first = int(re.search(r"first frame +(\d+) ns", out)[1])
    assert assert_bytes(sent, steered, drive, 2_000_000, first) > 200


def test_the_repeats_of_a_followed_play_count_as_heat() -> None:
    """0.6 s at half of full drive, 100 times: a duty of half, against .005 for one pass."""
    array = virtual_immediate(Placement.grid(columns=1, rows=1))
    for repeats, endless, duty in ((1, False, 0.005), (100, False, 0.5), (1, True, 0.5)):
        how = {"samples": 1, "endless": endless}
        cleared = clear_followed(focus(), array, PlaySettings(repeats=repeats, steer_only=True), GRID, **how)
        assert cleared.exposure.duty == pytest.approx(duty, rel=0.01)


class Silenced(AllFrames):
    """Units whose failsafe acts at some frames."""

    def __init__(self, at: tuple[int, ...]) -> None:
        super().__init__()
        self.at, self.released = at, 0

    def put(self, phases, intensity, instant) -> None:
        super().put(phases, intensity, instant)
        if len(self.put_frames) in self.at:
            raise SilentFramesError("the failsafe acted")

    def release(self) -> None:
        self.released += 1


@pytest.mark.long
@pytest.mark.parametrize(("at", "ends"), [((2, 60, 80), False), (range(60, 67), True)])
def test_sound_rises_again_after_the_failsafe_acted_but_not_for_ever(in_time, at, ends, tmp_path) -> None:
    file, units = tmp_path / "hand.csv", Silenced(tuple(at))
    save_palm_path(swaying(), file)
    array = virtual_immediate(Placement.grid(columns=1, rows=1), units=units)
    with array, open_tracker(f"replay:{file}") as tracker:
        clearance = clear_followed(focus(100), array, PlaySettings(), GRID, samples=4)
        with pytest.raises(SilentFramesError) if ends else nullcontext():
            play_followed(focus(100), array, tracker, PlaySettings(), clearance, GRID, report=lambda _: None)
    assert units.released == (6 if ends else 4)
    if not ends:
        levels = np.array([intensity for _, intensity, _ in units.put_frames])
        assert levels[59] == levels[-1] > 0
        assert 0 < levels[60:70].min() < 0.5 * levels[59]


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
    strong = clear_followed(replace(drive, level=np.ones(8)), Loud, settings, GRID, samples=16)
    assert strong.verdict().startswith("attenuated: within the limit: 1")
    # Below the limit by less than a step of the intensity.
    assert -20 * np.log10(1 + 1 / (255 * strong.level)) < strong.exposure.excess <= 0
    # All transducers in phase at an ear: far above the limit.
    ear = np.array(profile.places[0].position)
    loud = replace(drive, phase=np.tile(focus_phase(array, ear), (8, 1)))
    rest = palm(np.zeros((8, 3)))
    safe = cleared.steered(loud, rest)
    assert exposure(loud, profile).excess > 0 >= exposure(safe, profile, acoustics=cleared.exposure.airs).excess
    with pytest.raises(ExposureError, match="outside"):
        cleared.steered(drive, palm(np.tile([[0.06, 0, 0]], (8, 1))))
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
