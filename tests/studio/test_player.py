import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, suppress
from multiprocessing import Pipe

import numpy as np
import pytest
from tests.devices.trackers.test_tracker_contract import Osc
from tests.drives import log, save_drive
from tests.simulators.moving_hand import Hand
from tests.waiting import wait_until

from midair.cli import run
from midair.devices import PlayLease
from midair.errors import DeviceError, DeviceStateError, ExposureError, StoppedError
from midair.files import DEFAULT_PROFILE, load_solution
from midair.model import AmplitudeFrames, ControlGrid, Medium, Provenance
from midair.rig import record
from midair.settings import Settings
from midair.studio.player import NoiseOutput, _Player
from midair.studio.work import SolveRequest, solve_take
from midair.studio.worker_process import StudioPipe
from midair.study.design.study_design import MaskingNoise


def player_on(device):
    """A player, its lease, and the other end of its pipe."""
    (here, there), lease = Pipe(), PlayLease()
    return _Player(StudioPipe(there), lease, device, 0), lease, here


CHECKED = {"profile": DEFAULT_PROFILE, "attenuate": False, "override": "", "repeats": 1}


def test_stimulus_with_noise_needs_a_sound_output_and_a_computer_without_is_told_what_to_choose():
    """A participant who hears the array is not blinded."""
    noise = NoiseOutput()
    with pytest.raises(DeviceError, match="expected an open sound output"), noise.over(True):
        raise AssertionError("presented without noise")
    assert noise.take(None, "") == ""
    with noise.over(False):
        pass
    if not pytest.importorskip("sounddevice", exc_type=(ImportError, OSError)).query_devices():
        with pytest.raises(DeviceError, match=r"connect one, or choose the noise none$"):
            noise.take(MaskingNoise(level_dbfs=-60), "default")


@pytest.mark.long
def test_the_participant_of_a_trial_is_logged_and_not_kept_for_the_next_drive(tmp_path):
    pytest.importorskip("autd3")
    path = save_drive(tmp_path / "a.drive.h5", frames=50)
    player, lease, _ = player_on("autd3:emulator")
    with player.held:
        for about in ({"participant": "touch/3"}, {}):
            found = player.act({"do": "admit", "path": str(path), **CHECKED})
            token = lease.arm(lasts=10.0)
            player.act(
                {"do": "play", "clearance": found["number"], "masked": False, "output": "", "token": token} | about
            )
            lease.disarm()
    assert [row["participant"] for row in log() if row["event"] == "play"] == ["touch/3", ""]
    assert [row["outcome"] for row in log() if row["event"] == "end"] == ["played", "played"]


@pytest.mark.long
@pytest.mark.parametrize("device", ["virtual", "autd3:emulator"])
def test_a_take_plays_while_it_is_solved_and_leaves_its_drive(tmp_path, device):
    if device != "virtual":
        pytest.importorskip("autd3")
    record("virtual:towel", 0.3, path=(take := tmp_path / "a.h5"))
    how = {"mode": "paper", "choices": (("method", "live"),)}
    path, apart = tmp_path / "a.drive.h5", tmp_path / "apart.drive.h5"
    admit = {"do": "admit", "path": str(path), "solve": SolveRequest(take=str(take), drive=str(path), **how)}
    player, lease, _ = player_on(device)
    play = {"do": "play", "masked": False, "output": "", "token": lease.arm(lasts=10.0)}
    with player.held, player.solver:
        if device != "virtual":
            # In words of the page, without options of a command.
            with pytest.raises(ExposureError, match=r"dB too loud: .* limit 110 dB; solve it to see what you can do"):
                player.act(admit | CHECKED)
        found = player.act(admit | CHECKED | {"protection": 40.0})
        assert "each part is checked before it sounds" in found["verdict"]
        lease.stop()
        with pytest.raises(StoppedError):
            player.act(play | {"clearance": found["number"]})
        assert not path.exists()
        found = player.act(admit | CHECKED | {"protection": 40.0})
        report = player.act(play | {"clearance": found["number"], "token": lease.arm(lasts=10.0)})
    solve_take(SolveRequest(take=str(take), drive=str(apart), **how), lambda *_: None)
    assert np.array_equal(load_solution(path).drive.phase, load_solution(apart).drive.phase)
    assert report["frames"] == load_solution(path).drive.frames


@pytest.mark.long
def test_the_exposure_is_checked_in_the_stated_air_and_phases_are_corrected_for_it(tmp_path):
    grid = ControlGrid()
    target = AmplitudeFrames(amplitude=np.ones((50, grid.count)), rate=1000.0, grid=grid)
    path = save_drive(tmp_path / "a.drive.h5", frames=50, target=target)
    room = Medium.at(temperature=25.0, humidity=0.4)
    player, _, _ = player_on("virtual")
    order = {"do": "admit", "path": str(path), **CHECKED}
    assert "14 to 30 °C" in player.act(order)["measured_in"]
    found = player.act(order | {"room": room})
    assert "23 to 27 °C" in found["measured_in"]
    assert found["solved_c"] == pytest.approx(Medium().degrees, abs=0.01), "340 m/s"
    assert "palm warms by" in found["heat"]
    protected = player.act(order | {"protection": 12.0})
    assert "12 dB of ear protection stated by the user" in protected["profile"]
    ears = [{place["name"]: place["limit_db"] for place in each["places"]}["left ear"] for each in (found, protected)]
    assert ears[1] == ears[0] + 12
    corrected = player.act(order | {"room": room, "correct": True})
    assert corrected["solved_c"] == 25.0
    session, cleared, _ = player.checked[corrected["number"]]
    assert cleared.drive.acoustics.medium == room
    assert session.rig.settings.acoustics.medium == room


@pytest.mark.long
@pytest.mark.parametrize("device", ["virtual", "autd3:emulator"])
def test_a_live_tracker_is_shown_and_followed_until_a_stop(tmp_path, device):
    """Poses over a socket, on the virtual array in real time and on emulated units, which are open again afterwards."""
    path = save_drive(tmp_path / "a.drive.h5", frames=400, provenance=Settings().noted(Provenance()))
    player, lease, here = player_on(device)
    messages = []

    def read():
        with suppress(EOFError, OSError):
            while True:
                messages.append(here.recv())

    threading.Thread(target=read, daemon=True).start()
    with player.held, closing(Osc()) as sender, Hand(sender, lambda values, stamp, _: (values, stamp, 1.0)):
        found = player.act({"do": "admit", "path": str(path), **CHECKED, "follow": sender.name})
        wait_until(
            lambda: any(said["palm"] and said["palm"].get("sure") for said in messages if said["kind"] == "palm")
        )
        play = {"do": "play", "clearance": found["number"], "masked": False, "output": ""}
        report = player.act(play | {"token": lease.arm(lasts=10.0)})
        assert report["frames"] == 400
        assert "follow: the palm is followed" in player.palm.said
        found = player.act({"do": "admit", "path": str(path), **CHECKED, "repeats": 50, "follow": sender.name})
        threading.Timer(0.5, lease.stop).start()
        with pytest.raises(StoppedError):
            player.act(play | {"clearance": found["number"], "token": lease.arm(lasts=10.0)})
        assert player.act({"do": "unfollow"})
        assert (player.array is None) == (device == "virtual")
    wait_until(lambda: messages[-1] == {"kind": "palm", "palm": None})


@pytest.mark.long
@pytest.mark.parametrize("device", ["virtual", "autd3:emulator"])
def test_a_pattern_in_a_loop_is_changed_while_it_plays_until_a_stop(tmp_path, device):
    if device != "virtual":
        pytest.importorskip("autd3")
    path, answers = tmp_path / "pattern.toml", []
    player, lease, here = player_on(device)

    def write(pressure):
        path.write_text(f"duration_s = 0.05\nrate_hz = 1000\n[[spot]]\npressure_pa = {pressure}", encoding="utf-8")

    def plays():
        return lease.renew(lasts=10.0) and player.loops and player.loops.state()["drive"]

    def ask(pressure):
        write(pressure)
        here.send({"do": "change", "id": pressure, "path": str(path)})
        wait_until(
            lambda: plays() and here.poll() and (said := here.recv())["kind"] != "sounds" and [answers.append(said)]
        )

    def change():
        wait_until(plays)
        before = plays()
        ask(1e6)
        if device != "virtual":
            ask(20)
        ask(0.5)
        wait_until(lambda: 0 < plays() < 0.8 * before)
        lease.stop()

    write(1)
    assert run(["draw", str(path), str(tmp_path / "pattern.drive.h5"), "-q"]) == 0
    admit = {"do": "admit", "path": str(tmp_path / "pattern.drive.h5"), **CHECKED, "override": "a test"}
    with player.held, ThreadPoolExecutor(1) as pool:
        found = player.act(admit | {"room": Medium.at()})
        play = {"do": "play", "clearance": found["number"], "masked": False, "output": "", "loop": True}
        changed = pool.submit(change)
        with pytest.raises(StoppedError):
            player.act(play | {"token": lease.arm(lasts=10.0)})
        changed.result()
        with pytest.raises(DeviceStateError, match="expected a pattern that plays in a loop"):
            player.act({"do": "change", "path": str(path)})
    assert "pressure_pa: expected 0 to 10000 Pa" in answers[0]["error"]
    # The override was for the pattern that was checked.
    assert device == "virtual" or "expected at most" in answers[1]["error"]
    assert len([row for row in log() if row["event"] == "play"]) == 2, "what was refused never played"
