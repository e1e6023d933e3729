import pytest

from midair.cli import console
from midair.cli.console import progress_bars, work_of
from midair.cli.time_estimates import Speeds, Work, duration_text, estimate_text

SOLVE, PLAY = Work(kind="solve exact 256", frames=3000), Work(kind="play", frames=3000)


def test_estimates_add_up_and_need_every_speed():
    speeds = Speeds().updated(Work(kind=SOLVE.kind, frames=100), 10.0)
    assert speeds.seconds([SOLVE]) == pytest.approx(300)
    assert speeds.seconds([SOLVE, PLAY]) is None
    assert speeds.updated(Work(kind="play", frames=500), 1.0).seconds([SOLVE, PLAY]) == pytest.approx(306)
    assert "no time estimate" in estimate_text(speeds, [SOLVE, PLAY])
    assert estimate_text(speeds, [SOLVE]) == "this takes about 5 min, by the speed of the last run on this machine"
    assert estimate_text(speeds, [Work(kind=SOLVE.kind, frames=30)]) == ""


def test_speeds_are_averaged_geometrically():
    speeds = Speeds().updated(SOLVE, 100.0).updated(SOLVE, 400.0)
    assert speeds.seconds([SOLVE]) == pytest.approx(200, rel=1e-3)


@pytest.mark.parametrize(
    ("seconds", "words"), [(3.4, "3 s"), (44.4, "44 s"), (100, "1.7 min"), (3300, "55 min"), (9000, "2.5 h")]
)
def test_durations_are_printed_in_two_digits(seconds, words):
    assert duration_text(seconds) == words


def test_speeds_are_stored_and_a_broken_file_is_ignored(monkeypatch, tmp_path):
    monkeypatch.setenv("MIDAIR_STATE", str(tmp_path / "state"))
    assert Speeds.load().rates == {}
    Speeds().updated(SOLVE, 10.0).save()
    assert Speeds.load().rates == {SOLVE.kind: 300.0}
    (tmp_path / "state" / "speeds.toml").write_text("rates = [")
    assert Speeds.load().rates == {}
    monkeypatch.setenv("MIDAIR_STATE", str(tmp_path / "state" / "speeds.toml"))
    Speeds().updated(SOLVE, 10.0).save()


def test_a_stage_updates_the_speed_for_the_next_estimate(monkeypatch, capsys):
    monkeypatch.setattr(console, "MEASURED", 0.0)
    with progress_bars([work_of("solve", "exact", 3000)]) as stage:
        stage("solve, pass 1", "exact")(3000, 3000)
    assert "no time estimate yet" in capsys.readouterr().err
    rate = Speeds.load().rates["solve exact"]
    with progress_bars([work_of("solve", "exact", round(40 * rate))]):
        pass
    assert "this takes about 40 s" in capsys.readouterr().err


def test_interrupted_work_updates_no_speed(monkeypatch):
    monkeypatch.setattr(console, "MEASURED", 0.0)
    with pytest.raises(KeyboardInterrupt), progress_bars() as stage:
        stage("solve", "exact")(10, 3000)
        raise KeyboardInterrupt
    assert Speeds.load().rates == {}
