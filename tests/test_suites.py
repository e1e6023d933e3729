import sys

from tests import suites


def test_a_suite_that_fails_does_not_stop_the_next_and_the_table_has_both(tmp_path, monkeypatch, capsys):
    def suite(said, status):
        return [sys.executable, "-S", "-c", f"print({said!r}); raise SystemExit({status})"]

    made = {
        "first": suite("FAILED tests/a.py::b\n1 failed, 2 passed, 4 skipped in 0.10s", 1),
        "second": suite("=== 3 passed in 61.20s (0:01:01) ===\n== 5 passed, 2 errors in 1.00s ==", 1),
        "third": suite("7 passed in 0.10s", 2),
        "fourth": suite("8 passed in 0.10s", 0),
    }
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(suites, "SUITES", made)
    assert suites.main([]) == 1
    printed = capsys.readouterr().out
    assert "FAILED tests/a.py::b" in printed
    rows = {row[0]: row[1:] for row in map(str.split, printed.splitlines()) if row[0] in made}
    assert [rows[name][:3] for name in made] == [["2", "1", "4"], ["8", "2", "0"], ["7", "0", "0"], ["8", "0", "0"]]
    assert rows["third"][4:] == ["exit", "status", "2"]
    assert all((tmp_path / ".suites" / f"{name}.log").exists() for name in made)
    assert suites.main(["fourth"]) == 0
    assert suites.main(["unknown"]) == 2
