import pytest

from midair.errors import InputError
from midair.files import check_memory_for


def test_a_lack_of_memory_is_one_line(monkeypatch):
    monkeypatch.setattr("midair.ram.available_memory", lambda: 2_000_000_000)
    said = r"a\.csv: expected 3 GB of free memory, because all of it is read at once, got 2 GB; cut it"
    with pytest.raises(InputError, match=said):
        check_memory_for(3e9, "a.csv", "cut it")
    check_memory_for(2e9, "a.csv", "cut it")


def test_an_unknown_amount_of_memory_is_no_error(monkeypatch):
    monkeypatch.setattr("midair.ram.available_memory", lambda: None)
    check_memory_for(1e18, "a.csv", "cut it")
