import json

import numpy as np
import pytest

from midair.devices.arrays.frame_bytes import amplitude_of, intensity_bytes
from midair.devices.arrays.gate import admit, load_profiles, profile_named
from midair.errors import ExposureError, FileError, InputError, MissingFileError, UnknownDeviceError
from midair.model import Drive, Provenance, TransducerArray
from midair.physics import exposure, focus_phase
from midair.rig.names.array_names import array_named
from midair.rig.playing.play_log import log_order

ARRAY = TransducerArray.autd3()
PROFILE = profile_named("occupational-110")


@pytest.fixture(autouse=True)
def _state(tmp_path, monkeypatch):
    monkeypatch.setenv("MIDAIR_STATE", str(tmp_path / "state"))


def focus(level=1.0, frames=3):
    phase = np.tile(focus_phase(ARRAY, np.array([0, 0, 0.2])), (frames, 1))
    return Drive(phase=phase, level=np.full(frames, level), rate=1000.0, array=ARRAY, provenance=Provenance(source="t"))


@pytest.mark.parametrize(
    ("name", "simulated"),
    [
        ("autd3", False),
        ("autd3:eth0", False),
        ("autd3:emulator", True),
        ("pyautd3", False),
        ("pyautd3:eth0", False),
        ("pyautd3:twincat", False),
        ("pyautd3:remote:127.0.0.1:8080", False),
        ("pyautd3:audit", True),
        ("pyautd3:nop", True),
    ],
)
def test_names_of_arrays(name, simulated):
    array = array_named(name)
    assert array.simulated is simulated
    assert array.gated
    assert array.array.same_as(ARRAY)


@pytest.mark.parametrize("name", ["", "virtual", "autd9", "autd3:", "pyautd3:", "soem"])
def test_names_that_nothing_answers_to(name):
    with pytest.raises(UnknownDeviceError, match="expected virtual, autd3"):
        array_named(name)


def test_a_loud_drive_is_refused_with_level_and_place():
    with pytest.raises(ExposureError, match=r"14\d\.\d dB at the (left|right) ear \(.* mm\) in frame \d.*limit 110 dB"):
        admit(focus(), PROFILE)


def test_a_quiet_drive_passes_as_it_is():
    drive = focus(level=0.01)
    admission = admit(drive, PROFILE)
    assert admission.outcome == "kept"
    assert admission.drive is drive


def test_attenuation_keeps_the_profile_as_the_firmware_rounds_it():
    admission = admit(focus(), PROFILE, attenuate=True)
    assert admission.outcome == "attenuated"
    assert -1.0 < admission.exposure.excess <= 0
    assert admission.drive.provenance.steps[-1].stage == "attenuate"
    made = amplitude_of(intensity_bytes(admission.drive, 4))
    heard = Drive(phase=admission.drive.phase, level=made, rate=1000.0, array=ARRAY)
    assert exposure(heard, PROFILE).excess <= 0


def test_an_override_needs_a_name_and_is_logged():
    admission = admit(focus(), PROFILE, override=" A Person ")
    assert (admission.outcome, admission.by) == ("overridden", "A Person")
    with pytest.raises(InputError, match="name of the person"):
        admit(focus(), PROFILE, override="  ")
    path = log_order("x.drive.h5", "autd3", admission, repeats=2)
    log_order("y.drive.h5", "autd3", admit(focus(level=0.01), PROFILE), repeats=1)
    first, second = (json.loads(line) for line in path.read_text(encoding="utf-8").splitlines())
    assert (first["override_by"], first["exposure"], first["repeats"]) == ("A Person", "overridden", 2)
    assert first["places"]["left ear"]["peak_db"] > 110
    assert (second["override_by"], second["exposure"]) == ("", "kept")


def test_what_makes_no_sound_is_told_and_not_refused():
    admission = admit(focus(), PROFILE, gated=False)
    assert admission.outcome == "exceeded"


def test_profiles_by_name_and_from_files(tmp_path):
    with pytest.raises(InputError, match="occupational-110, public-100"):
        profile_named("loud")
    with pytest.raises(MissingFileError, match=r"mine\.toml"):
        load_profiles(tmp_path / "mine.toml")
    (tmp_path / "mine.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="no text"):
        load_profiles(tmp_path / "mine.toml")


def test_nothing_plays_without_a_log(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("MIDAIR_STATE", str(tmp_path / "file" / "state"))
    with pytest.raises(FileError, match="MIDAIR_STATE"):
        log_order("x.drive.h5", "autd3", admit(focus(level=0.01), PROFILE), repeats=1)
