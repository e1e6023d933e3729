"""Every command that can play passes the air of the room to the exposure check only if it was typed."""

import os
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from tests.drives import plan_of, save_drive

from midair.cli import run
from midair.cli.exposure_options import ExposureOptions
from midair.devices import ExposureChoices, check_exposure
from midair.devices.frame_bytes import actual_level
from midair.errors import ExposureError, InputError
from midair.files import profile_named
from midair.model import Acoustics, Drive, Medium, TransducerArray
from midair.physics import exposure, focus_phase, transfer_matrix
from midair.rig import VirtualRig

pytestmark = pytest.mark.usefixtures("own_state")
ARRAY = TransducerArray.autd3()
NOWHERE = f"autd3:nowhere{os.getpid()}"
"""An interface of this run alone, since a lock holds for the whole computer."""
PROFILE = profile_named("occupational-110")
WARM = Acoustics(medium=Medium.at(temperature=45.0))
TYPED, UNKNOWN = ("38", "40", "42"), ("14", "22", "30")


def loud():
    """A drive whose file states air of 45 °C."""
    return save_drive("loud.drive.h5", np.tile(focus_phase(ARRAY, np.array([0, 0, 0.2])), (10, 1)), 1.0, acoustics=WARM)


def test_exposure_and_play_take_the_room_s_air_only_if_it_was_typed(answer, monkeypatch):
    """With one unit, as the command computes the exposure; of a play, what it hands to the check."""
    save_drive("one.drive.h5", level=1.0, array=TransducerArray.autd3(columns=1, rows=1), acoustics=WARM, frames=2)
    rooms = []

    def seen(*_, settings, **__):
        rooms.append(settings.exposure.room)
        raise InputError("enough")

    monkeypatch.setattr("midair.rig.play", seen)
    for words, expected in (([], UNKNOWN), (["--temperature", "40C"], TYPED)):
        assert f"{answer('exposure', 'one.drive.h5', *words)['loudest_air']['temperature_c']:.0f}" in expected
        assert run(["play", "one.drive.h5", "--device", NOWHERE, *words]) == 1
    assert [room and room.temperature for room in rooms] == [None, 40.0]


@pytest.mark.long
def test_a_study(capsys):
    pytest.importorskip("autd3")
    loud()
    Path("plan.toml").write_text(plan_of("loud.drive.h5"), encoding="utf-8")
    assert run(["study", "new", "s", "--source", "plan.toml"]) == 0
    for words in ([], ["--temperature", "40C"]):
        capsys.readouterr()
        assert run(["study", "run", "s", "--participant", "1", "--array", "autd3:emulator", *words]) == 1
        assert "too loud" in capsys.readouterr().err, words


def test_a_loop(take, monkeypatch):
    found = []

    def stop_before_solving(*, settings):
        found.append(settings.exposure.room)
        raise InputError("enough")

    monkeypatch.setattr("midair.cli.commands.loop.open_rig", stop_before_solving)
    for words in ([], ["--temperature", "40C"]):
        assert run(["loop", "take.h5", "--mode", "paper", "--duration", "0.08s", *words]) == 1
    assert [room and room.temperature for room in found] == [None, 40.0]


@pytest.mark.long
def test_a_drive_that_is_quiet_in_the_papers_air_alone_is_refused(capsys):
    """The former check, in the paper's air and that of the file, kept it; at 22 °C it is above the limit."""
    ear = PROFILE.places[0]
    edge = np.linspace(-ear.reach, ear.reach, 11)
    points = np.stack(np.meshgrid(edge, edge, edge), axis=-1).reshape(-1, 3) + ear.position
    quiet = transfer_matrix(points, ARRAY)
    power = quiet.conj().T @ quiet / len(quiet)
    power[np.diag_indices(ARRAY.count)] += 1e-3 * np.linalg.norm(power, 2)
    corner = np.array(ear.position) + ear.reach * np.array([[1.0, 1.0, 1.0]])
    room = Acoustics(medium=Medium.at(temperature=22.0))
    q = np.linalg.solve(power, transfer_matrix(corner, ARRAY, acoustics=room)[0].conj())
    phase = np.rint(np.angle(q) * 128 / np.pi) * np.pi / 128
    for share in 10 ** (-np.arange(0, 3, 0.0125)):
        level = np.rint(255 * share * np.abs(q)[None] / np.abs(q).max()) / 255
        former = Drive(phase=phase[None], level=actual_level(level), rate=1000.0, array=ARRAY)
        if exposure(former, PROFILE).excess <= 0:
            break
    save_drive("hidden.drive.h5", former.phase, level, acoustics=Acoustics())
    assert run(["play", "hidden.drive.h5", "--device", NOWHERE, "--temperature", "22C"]) == 1
    refused = " ".join(capsys.readouterr().err.split())
    assert "dB too loud" in refused


def test_a_file_of_no_air_is_refused(capsys, monkeypatch):
    phase = np.zeros((2, ARRAY.count))
    save_drive("slow.drive.h5", phase, 1.0, acoustics=Acoustics(medium=Medium(speed=100.0)))
    # The search around the ears must not begin.
    monkeypatch.delattr("midair.physics.exposure_level.searches_of")
    for line in ("exposure slow.drive.h5", "play slow.drive.h5", f"play slow.drive.h5 --device {NOWHERE}"):
        assert run(line.split()) == 1, line
        assert "expected a speed of sound of 300 to 370 m/s, as in air, got 100 m/s" in capsys.readouterr().err, line


def test_ear_protection_raises_the_limits_outside_it_and_is_named():
    chosen = ExposureOptions(ear_protection=12.0).choices().profile
    assert chosen.name == "occupational-110, 12 dB of ear protection stated by the user"
    assert [place.limit for place in chosen.places] == [122, 122, 122, 155]


@pytest.mark.long
def test_every_command_accepts_the_options_that_its_refusal_advises(capsys):
    array = VirtualRig().array
    loud = Drive(phase=np.zeros((20, array.count)), level=np.ones(20), rate=1000.0, array=array)
    device = SimpleNamespace(array=array, gated=True, steps_a_turn=256)
    with pytest.raises(ExposureError) as refused:
        check_exposure(loud, device, ExposureChoices(profile=profile_named("occupational-110")))
    advised = set(re.findall(r"--[a-z-]+", str(refused.value)))
    assert {"--attenuate", "--override-exposure"} <= advised
    for command in ("play", "loop", "study run", "calibrate beam"):
        assert run([*command.split(), "--help"]) == 0
        page = capsys.readouterr().out
        assert [option for option in advised if option not in page] == [], command
