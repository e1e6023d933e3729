from multiprocessing import Pipe

import numpy as np
import pytest

from midair.errors import DeviceError, MidairError
from midair.files import DEFAULT_PROFILE, save_solution
from midair.model import Drive, Solution, TransducerArray
from midair.rig import PlayLease, dose_report
from midair.studio.player import NoiseOutput, _Player
from midair.studio.worker_process import StudioPipe
from midair.study.design import MaskingNoise


def test_stimulus_with_noise_needs_a_sound_output():
    """A participant who hears the array is not blinded."""
    noise = NoiseOutput()
    with pytest.raises(DeviceError, match="expected an open sound output"), noise.over(True):
        raise AssertionError("presented without noise")
    assert noise.take(None, "") == ""
    ran = []
    with noise.over(False):
        ran.append(True)
    assert ran == [True]


def test_missing_sound_output_is_reported_before_the_session():
    with pytest.raises(MidairError, match="headphones"):
        NoiseOutput().take(MaskingNoise(level_dbfs=-60), "no such output")


def test_the_participant_of_a_trial_is_logged_and_not_kept_for_the_next_drive(tmp_path):
    pytest.importorskip("autd3")
    array, path = TransducerArray.autd3(), tmp_path / "a.drive.h5"
    drive = Drive(phase=np.zeros((50, array.count)), level=np.full(50, 0.001), rate=1000.0, array=array)
    solved = {"error": np.zeros(50), "iterations": np.ones(50), "status": ("converged",) * 50}
    save_solution(Solution(drive=drive, **solved), path)
    _, studio = Pipe()
    permit = PlayLease()
    player = _Player(StudioPipe(studio), permit, "autd3:emulator", 0)
    with player.held:
        for about in ({"participant": "touch/3"}, {}):
            checked = {"profile": DEFAULT_PROFILE, "attenuate": False, "override": "", "repeats": 1}
            found = player.act({"do": "admit", "path": str(path), **checked})
            leave = permit.arm(lasts=10.0)
            player.act(
                {"do": "play", "admission": found["number"], "masked": False, "output": "", "leave": leave} | about
            )
            permit.disarm()
    assert [(row["participant"], row["end"]) for row in dose_report().orders] == [("touch/3", "played"), ("", "played")]
