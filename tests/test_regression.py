import h5py
import numpy as np
import pytest
from tests.regression.comparison import compared
from tests.regression.figures import numbers, of_file, of_json, printed
from tests.regression.recorder import HERE, record, rows

SAID = (
    "12.5 dB at 20 Hz (limit 110 dB), -0.1 ms, midair 0.1.0 on 2026-11-23 12:00, id 0a465387, /tmp/a7/b8, AUTD3 2 x 2"
)


def told(text, place="info | out"):
    return dict(printed(text, place))


def drive(path, phase):
    with h5py.File(path, "w") as file:
        file["phase"] = phase
        file.attrs["rate_hz"] = 4000.0
        file.attrs["created"] = "2026-11-23"
    return dict(of_file(path, "solve | x.drive.h5"))


def test_a_text_gives_its_numbers_without_dates_digests_versions_and_paths():
    assert numbers(SAID) == ["12.5", "20", "110", "-0.1", "2", "2"]
    assert numbers("1.2345678e-05,12345678e-05,-.5,20-470") == ["1.2345678e-05", "12345678e-05", "-.5", "20", "470"]


def test_a_changed_number_is_found_and_a_changed_word_is_not():
    reworded = SAID.replace("limit", "at most").replace("at 20 Hz", "in the band of 20 Hz").replace("-0.1", "-.1")
    assert compared(told(SAID), told(reworded)).differ == 0
    report = compared(told(SAID), told(SAID.replace("12.5", "12.6")))
    assert report.differ == 1
    assert "12.5 -> 12.6, relative difference 0.008" in report.text


def test_a_number_more_is_one_difference_and_one_that_moved_is_none():
    assert compared(told("1 2 3 4 5"), told("1 2 99 3 4 5")).differ == 1
    moved = compared(told("limit 110 dB, 146.7 dB"), told("146.7 dB, above the limit of 110 dB"))
    assert (moved.differ, "1 of the equal ones" in moved.text) == (0, True)


def test_values_of_json_are_compared_by_key():
    old = dict(of_json({"gain": 1.5, "E": 0.25, "ok": True, "said": "peak 3 Pa"}, "compare | out"))
    assert (
        compared(old, dict(of_json({"gain": 0.25, "E": 1.5, "ok": True, "said": "3 Pa"}, "compare | out"))).differ == 2
    )


def test_one_bit_of_an_array_is_found_and_another_name_of_it_is_counted(tmp_path):
    phase = np.linspace(0, 6, 12).reshape(3, 4)
    old = drive(tmp_path / "a.h5", phase)
    assert compared(old, drive(tmp_path / "b.h5", phase)).differ == 0
    phase[1, 2] = np.nextafter(phase[1, 2], 7)
    assert compared(old, drive(tmp_path / "c.h5", phase)).differ == 1
    renamed = {name.replace("phase", "angle"): value for name, value in old.items()}
    assert "1 of the equal ones stand at another place or under another name" in compared(old, renamed).text


def test_the_table_of_commands_can_be_read():
    table = rows((HERE / "commands.txt").read_text(encoding="utf-8"))
    assert len(table) > 90
    assert {row.words[0] for row in table} == {"midair", "script"}


@pytest.mark.long
def test_a_row_is_recorded_and_one_that_fails_says_so(tmp_path):
    text = "good | midair study power paired --effect 0.5\nbad | midair info none.h5"
    figures, _ = record(rows(text), tmp_path)
    assert (figures["good | exit status"], figures["bad | exit status"]) == ("0", "1")
    assert any(name.startswith("good | out | #") for name in figures)
