import pytest

from midair.errors import InputError
from midair.files import check_fits


def test_a_lack_of_memory_is_one_line(monkeypatch):
    monkeypatch.setattr("midair.ram.available", lambda: 2_000_000_000)
    said = r"a\.csv: expected 3 GB of free memory, because all of it is read at once, got 2 GB; cut it"
    with pytest.raises(InputError, match=said):
        check_fits(3e9, "a.csv", "cut it")
    check_fits(2e9, "a.csv", "cut it")


def test_an_unknown_amount_of_memory_is_no_error(monkeypatch):
    monkeypatch.setattr("midair.ram.available", lambda: None)
    check_fits(1e18, "a.csv", "cut it")
