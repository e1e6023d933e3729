import re
from types import SimpleNamespace

import numpy as np
import pytest

from midair.cli import run
from midair.cli.exposure_options import ExposureOptions
from midair.devices import ExposureChoices, check_exposure
from midair.errors import ExposureError, InputError
from midair.files import profile_named
from midair.model import Drive
from midair.rig import VirtualRig


def test_ear_protection_raises_the_limits_outside_it_and_is_named():
    chosen = ExposureOptions(ear_protection=12.0).choices().profile
    assert chosen.name == "occupational-110, 12 dB of ear protection stated by the user"
    assert [place.limit for place in chosen.places] == [122, 122, 122, 155]
    with pytest.raises(InputError, match="ear protection: expected 0 to 40 dB at 40 kHz, got 60 dB"):
        ExposureOptions(ear_protection=60.0).choices()


@pytest.mark.long
@pytest.mark.parametrize("command", ["play", "loop", "study run", "calibrate beam"])
def test_every_command_accepts_the_options_that_its_refusal_advises(command, capsys):
    array = VirtualRig().array
    loud = Drive(phase=np.zeros((20, array.count)), level=np.ones(20), rate=1000.0, array=array)
    device = SimpleNamespace(array=array, gated=True, steps_a_turn=256)
    with pytest.raises(ExposureError) as refused:
        check_exposure(loud, device, ExposureChoices(profile=profile_named("occupational-110")))
    advised = re.findall(r"--[a-z-]+", str(refused.value))
    assert {"--attenuate", "--override-exposure"} <= set(advised)
    assert run([*command.split(), "--help"]) == 0
    page = capsys.readouterr().out
    assert all(option in page for option in advised)
