"""Doses from the log of playback, checked by hand from its lines."""

import csv
import json
import math

import pytest

from midair.devices import make_state_folder
from midair.errors import InputError
from midair.rig import dose_report

PLACES = {"left ear": {"peak_db": 100.0, "mean_db": 90.0}, "palm": {"peak_db": 150.0, "mean_db": 140.0}}


def order(number, time="2026-03-01T10:00:00.000+00:00", **fields):
    return {
        "time": time,
        "event": "play",
        "order": number,
        "participant": "P1",
        "process": 999_999,
        "simulated": False,
        "frames": 2000,
        "rate_hz": 1000.0,
        "repeats": 2,
        "places": PLACES,
    } | fields


def end(number, time="2026-03-01T10:00:03.000+00:00", **fields):
    return {"time": time, "event": "end", "order": number, "outcome": "played"} | fields


def write(*lines):
    text = "".join(line if isinstance(line, str) else json.dumps(line) + "\n" for line in lines)
    (make_state_folder() / "played.jsonl").write_text(text, encoding="utf-8")


def test_a_played_drive_counts_its_mean_energy():
    """90 dB are 0.4 Pa2 rms (20 uPa rms squared times 1e9); times 4 s that is 1.6 Pa2 s."""
    write(order("a"), end("a", duration_s=4.0))
    (row,), (day,) = dose_report().orders, dose_report().days
    assert (row["duration_s"], row["duration_is"], row["end"]) == (4.0, "measured", "played")
    assert row["left_ear_dose_pa2_s"] == day["left_ear_dose_pa2_s"] == pytest.approx(1.6)
    assert row["left_ear_8h_db"] == pytest.approx(90 + 10 * math.log10(4 / 28800))
    assert day["palm_peak_db"] == 150.0


def test_a_killed_play_counts_as_its_loudest_frame_for_the_whole_drive():
    write(order("a"))
    (row,) = dose_report().orders
    assert (row["end"], row["duration_s"], row["duration_is"]) == ("unknown", 4.0, "at most")
    assert row["left_ear_dose_pa2_s"] == pytest.approx(4e-10 * 1e10 * 4)
    assert "killed" in row["reason"]


def test_a_stopped_play_counts_until_it_was_stopped():
    write(order("a"), end("a", outcome="stopped", reason="midair stop"))
    (row,) = dose_report().orders
    assert (row["end"], row["reason"], row["duration_s"]) == ("stopped", "midair stop", 3.0)


def test_killed_live_touch_makes_the_sum_a_lower_bound():
    write(order("a"), end("a", duration_s=4.0), order("b", frames=None))
    report = dose_report()
    assert [row["duration_is"] for row in report.orders] == ["measured", "unknown"]
    (day,) = report.days
    assert (day["duration_s"], day["duration_is"], day["without_end"]) == (4.0, "at least", 1)


def test_days_participants_and_simulated_arrays_are_summed_apart():
    later = "2026-03-02T00:00:01.000+00:00"
    write(order("a"), order("b"), order("c", time=later), order("d", participant="P2"), order("e", simulated=True))
    found = [(day["day"], day["participant"], day["simulated"], day["orders"]) for day in dose_report().days]
    assert found == [
        ("2026-03-01", "P1", False, 2),
        ("2026-03-01", "P1", True, 1),
        ("2026-03-01", "P2", False, 1),
        ("2026-03-02", "P1", False, 1),
    ]
    assert [row["participant"] for row in dose_report("P2").orders] == ["P2"]


def test_an_unknown_participant_is_refused_with_those_of_the_log():
    write(order("a"), order("b", participant="P2"))
    with pytest.raises(InputError, match=r"expected one of the log \(P1, P2\), got P3"):
        dose_report("P3")


def test_an_empty_log_is_an_error():
    with pytest.raises(InputError, match="expected at least one order"):
        dose_report()


def test_damaged_lines_and_orders_of_older_versions_are_reported(tmp_path):
    old = {key: value for key, value in order("a").items() if key != "participant"}
    write(old, '{"time": "2026-03-01T10:0\n', "7\n", end("a", duration_s=4.0))
    report = dose_report()
    assert report.unreadable == 2
    assert (report.orders[0]["participant"], report.orders[0]["level"]) == ("", "")
    _, page = report.write(tmp_path / "dose.csv")
    assert "2 lines of the log cannot be read" in page.read_text(encoding="utf-8")


def test_the_table_is_safe_in_a_spreadsheet_and_the_page_in_a_browser(tmp_path):
    write(order("a", participant="=1+1", drive="<script>"), end("a", duration_s=4.0))
    table, page = dose_report().write(tmp_path / "dose.csv")
    with table.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["row"] for row in rows] == ["order", "day"]
    assert rows[0]["participant"] == "'=1+1"
    assert "<script>" not in page.read_text(encoding="utf-8")
    assert "SIMULATED" not in page.read_text(encoding="utf-8")
