"""Dose of sound from the log of playback: durations and levels for each participant and day, as CSV and HTML."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from midair.devices import playing_now, read_log
from midair.errors import InputError
from midair.figures import render_page
from midair.files import csv_text, write_file
from midair.version import __version__

REFERENCE = 20e-6
"""Reference of sound pressure levels, in Pa."""

WORKDAY = 8 * 3600.0
"""Duration to which a dose is related, in s."""

Row = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class DoseReport:
    """Orders to play of one participant, or of all, and their sums for each day."""

    participant: str | None
    """None for all."""
    orders: tuple[Row, ...]
    """One row for each order, oldest first."""
    days: tuple[Row, ...]
    """One row for each day (UTC) and participant, simulated arrays apart, with the keys of `orders`."""
    unreadable: int
    """Number of lines of the log that cannot be read."""

    def write(self, path: Path) -> tuple[Path, Path]:
        """Write the CSV table, and a page of the same name that ends in .html; return both paths."""
        page = path.with_suffix(".html")
        for target, text in ((path, csv_text([*self.orders, *self.days])), (page, self._page())):
            write_file(target, text)
        return path, page

    def _page(self) -> str:
        whose = "all participants" if self.participant is None else f"participant {self.participant}"
        return render_page(
            "rig/dose.html.j2",
            title=f"Exposure of {whose} to ultrasound",
            simulated=all(row["simulated"] for row in self.orders),
            tables=[("Sums for each day (UTC)", _shown(self.days)), ("Orders", _shown(self.orders))],
            unreadable=self.unreadable,
            notes=f"midair {__version__}, {datetime.now(UTC).isoformat(timespec='minutes')}",
        )


def dose_report(participant: str | None = None) -> DoseReport:
    """Read the log and compute the dose of one participant, or of all.

    The dose of a drive that was played to its end is its mean energy times its duration. For every other order, the
    level of the loudest frame and the longest possible duration give an upper bound. InputError if the log has no
    order, or none of this participant.
    """
    events, unreadable = read_log()
    ends = {each["order"]: each for each in events if each["event"] == "end"}
    active = {entry["process"] for entry in playing_now()}
    # A drive that was checked while it played is described at its end.
    checked = {order: end.get("checked", {}) for order, end in ends.items()}
    orders = [each | checked.get(each["order"], {}) for each in events if each.get("event") == "play"]
    # A drive of midair serve plays any number of times; its own length bounds nothing.
    triggered = {each["order"] for each in events if each["event"] == "trigger"}
    orders = [each | ({"frames": None} if each["order"] in triggered else {}) for each in orders]
    known = sorted({str(each.get("participant", "")) for each in orders})
    if participant is not None and participant not in known:
        named = ", ".join(name for name in known if name) or "none"
        raise InputError(f"--participant: expected one of the log ({named}), got {participant}")
    if not orders:
        raise InputError("log: expected at least one order to play, got none; play a drive, or set MIDAIR_STATE")
    chosen = [each for each in orders if participant in (None, each.get("participant", ""))]
    places = tuple(dict.fromkeys(name for each in chosen for name in each.get("places", {})))
    rows = [_order_row(each, ends.get(each["order"]), places, active) for each in chosen]
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault((row["day"], row["participant"], row["simulated"]), []).append(row)
    days = [_day_row(groups[key], places) for key in sorted(groups)]
    return DoseReport(participant=participant, orders=tuple(rows), days=tuple(days), unreadable=unreadable)


def _shown(rows: Sequence[Row]) -> list[Row]:
    """Rows of a table on the page: without columns that are empty in all rows, and with one of the two hashes."""
    names = [name for name in rows[0] if name not in ("row", "sha256") and any(row[name] != "" for row in rows)]
    return [{name: row[name] for name in names} for row in rows]


def _order_row(order: Mapping[str, Any], end: Mapping[str, Any] | None, places: Sequence[str], active: set[int]) -> Row:
    outcome, reason = _ending(order, end, active)
    duration, kind = _duration(order, end)
    texts = ("user", "command", "drive", "file_sha256", "sha256", "device")
    row: Row = {
        "row": "order",
        "day": order["time"][:10],
        "start_utc": order["time"],
        "participant": order.get("participant", ""),
        "simulated": bool(order.get("simulated", False)),
        "orders": 1,
        "without_end": int(end is None),
        **{name: order.get(name) or "" for name in texts},
        "level": _or_empty(order.get("level")),
        **{name: order.get(name) or "" for name in ("exposure", "override_by")},
        "duration_s": _or_empty(duration),
        "duration_is": kind,
        "end": outcome,
        "reason": reason,
        **{name: _or_empty(order.get(name)) for name in ("palm_pa", "palm_w_m2", "palm_warming_k")},
    }
    for name in places:
        found = order.get("places", {}).get(name, {})
        peak, mean = found.get("peak_db"), found.get("mean_db")
        level = mean if kind == "measured" else peak
        dose = None if level is None or duration is None else REFERENCE**2 * 10 ** (level / 10) * duration
        row |= _place_fields(name, peak, dose)
    return row


def _place_fields(name: str, peak: float | None, dose: float | None) -> Row:
    """Loudest level in dB, dose in Pa2 s, and the level with the same dose over 8 hours in dB; empty if unknown."""
    key = name.replace(" ", "_")
    steady = None if not dose else float(10 * np.log10(dose / (REFERENCE**2 * WORKDAY)))
    return {f"{key}_peak_db": _or_empty(peak), f"{key}_dose_pa2_s": _or_empty(dose), f"{key}_8h_db": _or_empty(steady)}


def _ending(order: Mapping[str, Any], end: Mapping[str, Any] | None, active: set[int]) -> tuple[str, str]:
    if end is not None:
        return str(end.get("outcome", "unknown")), str(end.get("reason", ""))
    if order.get("process") in active:
        return "playing", ""
    return "unknown", "the log has no end: the program was killed, or the computer stopped"


def _duration(order: Mapping[str, Any], end: Mapping[str, Any] | None) -> tuple[float | None, str]:
    """Duration in s, and whether it was measured or is the longest possible; None if there is no bound."""
    if end is not None and "plays" in end:
        return float(end["duration_s"]), "at most"
    if end is not None and end.get("outcome") == "played" and "duration_s" in end:
        return float(end["duration_s"]), "measured"
    bounds: list[float] = []
    if order.get("frames") is not None:
        bounds.append(order["frames"] * order.get("repeats", 1) / order["rate_hz"])
    if end is not None:
        bounds.append((datetime.fromisoformat(end["time"]) - datetime.fromisoformat(order["time"])).total_seconds())
    return (max(0.0, min(bounds)), "at most") if bounds else (None, "unknown")


def _day_row(rows: Sequence[Row], places: Sequence[str]) -> Row:
    """Sum of the orders of a day; a maximum for levels. An order of unknown duration makes the sum a lower bound."""
    kinds = {row["duration_is"] for row in rows}
    day = dict.fromkeys(rows[0], "") | {key: rows[0][key] for key in ("day", "participant", "simulated")}
    day |= {
        "row": "day",
        "orders": len(rows),
        "without_end": sum(row["without_end"] for row in rows),
        "override_by": ", ".join(sorted({row["override_by"] for row in rows} - {""})),
        "duration_s": float(sum(row["duration_s"] or 0.0 for row in rows)),
        "duration_is": "at least" if "unknown" in kinds else "at most" if "at most" in kinds else "measured",
    }
    for name in ("level", "palm_pa", "palm_w_m2", "palm_warming_k"):
        day[name] = _highest(rows, name)
    for name in places:
        key = name.replace(" ", "_")
        peak, dose = _highest(rows, f"{key}_peak_db"), sum(row[f"{key}_dose_pa2_s"] or 0.0 for row in rows)
        day |= _place_fields(name, None if peak == "" else peak, dose)
    return day


def _highest(rows: Sequence[Row], name: str) -> Any:
    return max((row[name] for row in rows if row[name] != ""), default="")


def _or_empty(value: float | None) -> float | str:
    return "" if value is None else float(value)
