import hashlib
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import soundfile
from PIL import Image

from midair.calibration import calibrate
from midair.cli import run as midair
from midair.errors import BrokenFileError, FileError, InputError, MismatchError, MissingFileError
from midair.files import load_solution, save, save_calibration, save_solution
from midair.model import ControlGrid, Drive, Solution, TransducerArray
from midair.physics import focus_phase
from midair.rig import VirtualRig, record
from midair.settings import Settings
from midair.study import StudyFolder, open_stimulus_rig, prepare_media, read_design
from midair.study.design.plan import draw_plan
from midair.study.design.question import Question, Stimulus
from midair.study.design.study_design import Block, Design
from midair.study.drives import check_digests, digest_of_file, prepare_drives

QUICK = Settings().but(grid=ControlGrid(rows=4, columns=4, pitch=11e-3), method="fast")


def solution(level=0.01, array=None, status="iterations"):
    array = array or TransducerArray.autd3()
    phase = np.broadcast_to(focus_phase(array, np.array([0, 0, 0.2])), (10, array.count))
    drive = Drive(phase=phase, level=np.full(10, level), rate=1000.0, array=array)
    return Solution(drive=drive, error=np.zeros(10), iterations=np.ones(10), status=(status,) * 10)


def design(*stimuli):
    felt = Question(name="felt", kind="yes-no", text="Felt?")
    block = Block(name="b", stimuli=tuple(one.name for one in stimuli), questions=("felt",))
    return Design(name="d", participants=1, seed=1, stimuli=stimuli, questions=(felt,), blocks=(block,))


A, B = (Stimulus(name=name, source=f"{name}.drive.h5") for name in "ab")


def test_existing_drives_are_copied_and_hashed(tmp_path):
    (tmp_path / "from").mkdir()
    (tmp_path / "to").mkdir()
    for name in "ab":
        save_solution(solution(), tmp_path / "from" / f"{name}.drive.h5")
    found = prepare_drives(design(A, B), tmp_path / "to", found_in=tmp_path / "from")
    assert [(one.source, one.how, one.duration) for one in found] == [
        ("a.drive.h5", "found", 0.01),
        ("b.drive.h5", "found", 0.01),
    ]
    copied = tmp_path / "to" / "a.drive.h5"
    assert found[0].digest == hashlib.sha256(copied.read_bytes()).hexdigest() == digest_of_file(copied)
    assert copied.stat().st_mode & 0o777 == 0o600


@pytest.mark.long
def test_a_pattern_is_drawn_unless_its_drive_is_newer(tmp_path):
    pattern, drive = tmp_path / "a.toml", tmp_path / "a.drive.h5"
    (tmp_path / "to").mkdir()
    pattern.write_text("duration_s = 0.01\n[[spot]]", encoding="utf-8")
    for age, how in ((None, "drawn"), (1, "found"), (-1, "drawn")):
        if age is not None:
            save_solution(solution(), drive)
            os.utime(drive, (when := pattern.stat().st_mtime + age, when))
        (one,) = prepare_drives(design(A), tmp_path / "to", found_in=tmp_path)
        assert (one.how, one.duration) == (how, 0.01)
    assert load_solution(tmp_path / "to" / "a.drive.h5").drive.provenance.source == "a.toml"
    pattern.write_text('name = "a study, not a pattern"', encoding="utf-8")
    assert prepare_drives(design(A), tmp_path / "to", found_in=tmp_path)[0].how == "found"


@pytest.mark.long
def test_recordings_and_virtual_strokes_are_solved(tmp_path):
    rig = VirtualRig()
    (tmp_path / "to").mkdir()
    with rig.touched_by("towel") as touched:
        recording = record(touched, 0.05).recording
        save(recording, tmp_path / "a.h5")
        save_calibration(touched.calibration, tmp_path / "a.calibration.h5")
        assert calibrate(recording, touched.calibration).frames
    made = replace(B, made_from="virtual:brush")
    with pytest.raises(MissingFileError, match=r"expected b\.drive\.h5 in .*b\.h5 and so on.*--drives"):
        prepare_drives(design(A, made), tmp_path / "to", found_in=tmp_path, settings=QUICK)
    (virtual,) = prepare_drives(design(made), tmp_path / "to", found_in=None, settings=QUICK)
    assert (virtual.how, load_solution(tmp_path / "to" / "b.drive.h5").drive.provenance.simulated) == ("virtual", True)
    assert virtual.duration > 1.28


def test_silent_and_missing_drives_and_those_of_another_array_are_refused(tmp_path):
    (tmp_path / "to").mkdir()
    save_solution(solution(level=0.0, status="silent"), tmp_path / "a.drive.h5")
    with pytest.raises(BrokenFileError, match=r"a\.drive\.h5: expected a drive with sound"):
        prepare_drives(design(A), tmp_path / "to", found_in=tmp_path)
    (tmp_path / "a.drive.h5").unlink()
    save_solution(solution(), tmp_path / "a.drive.h5")
    save_solution(solution(array=TransducerArray.autd3(columns=1, rows=1)), tmp_path / "b.drive.h5")
    with pytest.raises(MismatchError, match=r"b\.drive\.h5: expected a drive for AUTD3 2 x 2 .* got one for .* 249"):
        prepare_drives(design(A, B), tmp_path / "to", found_in=tmp_path)
    with pytest.raises(MissingFileError, match=r"expected a\.drive\.h5, b\.drive\.h5 in a folder"):
        prepare_drives(design(A, B), tmp_path, found_in=None)


def test_a_changed_drive_is_refused(tmp_path):
    save_solution(solution(), tmp_path / "a.drive.h5")
    known = {"a.drive.h5": digest_of_file(tmp_path / "a.drive.h5")}
    check_digests(tmp_path, known, (A,))
    with pytest.raises(MissingFileError, match="drawn without; run it with --simulate only"):
        check_digests(tmp_path, {}, (A,))
    with (tmp_path / "a.drive.h5").open("ab") as file:
        file.write(b"x")
    with pytest.raises(MismatchError, match="changed after the plan was drawn"):
        check_digests(tmp_path, known, (A,))
    (tmp_path / "a.drive.h5").unlink()
    with pytest.raises(MissingFileError, match="copy it back"):
        check_digests(tmp_path, known, (A,))


PLAN = Path(__file__).with_name("plans").joinpath("media.toml").read_text(encoding="utf-8")


@pytest.fixture
def source(tmp_path):
    (tmp_path / "plan.toml").write_text(PLAN)
    Image.new("RGB", (4, 3)).save(tmp_path / "a.png")
    soundfile.write(tmp_path / "b.wav", np.zeros(80), 8000)
    return tmp_path


def test_media_are_copied_with_their_digests_and_a_change_is_refused(source, capsys):
    assert midair(["study", "new", str(source / "s"), "--source", str(source / "plan.toml")]) == 0
    assert "Next: midair studio" in capsys.readouterr().out
    folder = StudyFolder(source / "s")
    plan = folder.plan()
    assert set(plan.drives) == {"a.png", "b.wav"}
    assert (folder.path / "a.png").read_bytes() == (source / "a.png").read_bytes()
    check_digests(folder.path, plan.drives, plan.design.stimuli)
    (folder.path / "a.png").write_bytes(b"other")
    with pytest.raises(MismatchError, match="expected the picture of the plan"):
        check_digests(folder.path, plan.drives, plan.design.stimuli)


def test_a_terminal_refuses_pictures_before_the_session_starts(source):
    plan = draw_plan(read_design(PLAN))
    with (
        pytest.raises(InputError, match="got a picture, which a terminal cannot present; run this study in the studio"),
        open_stimulus_rig("none", StudyFolder(source), plan),
    ):
        pass


def test_files_that_are_missing_no_media_or_too_large_are_refused(source):
    for number, (name, spoil, error, words) in enumerate(
        (
            ("a.png", lambda path: path.write_bytes(b"no picture"), BrokenFileError, "a.png"),
            ("a.png", lambda path: os.truncate(path, 20_000_001), FileError, "a.png"),
            ("b.wav", lambda path: path.write_bytes(b"no sound"), BrokenFileError, "b.wav"),
            ("b.wav", Path.unlink, MissingFileError, "b.wav: expected the sound in"),
        )
    ):
        spoil(source / name)
        (source / f"into{number}").mkdir()
        with pytest.raises(error, match=words):
            prepare_media(read_design(PLAN), source / f"into{number}", found_in=source)
        Image.new("RGB", (4, 3)).save(source / "a.png")
