import h5py
import numpy as np
import pytest
from tests.regression import HERE, differences, of_file, of_text, record

SAID = (
    "12.5 dB at 20 Hz (limit 110 dB), -0.1 ms, midair 0.1.0 on 2026-11-23 12:00, id 0a465387, /tmp/a7/b8, AUTD3 2 x 2"
)


def told(text):
    return dict(of_text(text, "info | out"))


def test_numbers_count_and_words_dates_digests_versions_and_paths_do_not():
    assert told(SAID) == {"info | out": "12.5 20 110 -0.1 2 2"}
    assert differences(told(SAID), told(SAID.replace("limit", "at most").replace("-0.1", "-.10"))) == []
    assert differences(told(SAID), told(SAID.replace("12.5", "12.6"))) == ["info | out: 12.5 -> 12.6"]


def test_values_of_json_are_compared_by_key():
    old, new = (told(f'{{"gain": {gain}, "E": [0.25], "said": "peak 3 Pa"}}') for gain in (1.5, 2.5))
    assert old == {"info | out/gain": "1.5", "info | out/said": "3", "info | out/E/0": "0.25"}
    assert differences(old, new) == ["info | out/gain: 1.5 -> 2.5"]


def test_one_bit_of_an_array_is_found(tmp_path):
    def drive(phase):
        with h5py.File(tmp_path / "x.h5", "w") as file:
            file["phase"] = phase
            file.attrs["rate_hz"], file.attrs["created"] = 4000.0, "2026-11-23"
        return dict(of_file(tmp_path / "x.h5", "solve | x.drive.h5"))

    phase = np.linspace(0, 6, 12).reshape(3, 4)
    old = drive(phase)
    assert old == drive(phase)
    phase[1, 2] = np.nextafter(phase[1, 2], 7)
    assert [line.partition(":")[0] for line in differences(old, drive(phase))] == ["solve | x.drive.h5 | phase"]


@pytest.mark.long
def test_a_row_is_recorded_and_one_that_fails_says_so(tmp_path):
    figures = record("good | midair study power paired --effect 0.5\nbad | midair info none.h5", tmp_path)
    assert (figures["good | exit status"], figures["bad | exit status"]) == ("0", "1")
    assert figures["good | out"].split()
    assert len((HERE / "commands.txt").read_text(encoding="utf-8").splitlines()) > 100
