"""The command `midair log` and its subcommand `export`."""

from pathlib import Path

from cyclopts import App

from midair.cli.console import banner, print_json, print_rows
from midair.cli.help_text import add_command, epilogue
from midair.cli.options import Force, Json
from midair.cli.output import may_write
from midair.files import for_json
from midair.rig import dose_report


def export_command(
    *, participant: str | None = None, out: Path | None = None, force: Force = False, json: Json = False
) -> None:
    """Write the log of played drives as a CSV table and a page: durations, levels, and the dose of each day.

    The table has a row for each order, played, stopped or killed, and a sum for each day (UTC) and participant.

    Parameters
    ----------
    participant
        Only the orders of this participant: as in midair play --participant, or STUDY/NUMBER for a study.
    out
        CSV table to write; the page has the same name and ends in .html. [default: dose.csv]

    Examples
    --------
    $ midair log export --participant P07 --out P07.csv
    """
    target = out or Path("dose.csv")
    may_write(target, force, ".csv")
    may_write(target.with_suffix(".html"), force)
    found = dose_report(participant)
    table, page = found.write(target)
    if json:
        document = {"orders": found.orders, "days": found.days, "unreadable_lines": found.unreadable}
        return print_json(for_json(document) | {"files": [str(table), str(page)]})
    banner(all(row["simulated"] for row in found.orders))
    rows = [(f"{row['day']} {row['participant']}".strip(), _day_text(row)) for row in found.days]
    if found.unreadable:
        rows.append(("not read", f"{found.unreadable} damaged lines of the log"))
    print_rows([*rows, ("table", str(table)), ("page", str(page))])
    return None


def _day_text(row: dict[str, object]) -> str:
    kind = "" if row["duration_is"] == "measured" else f"{row['duration_is']} "
    killed = f", {row['without_end']} without an end" if row["without_end"] else ""
    apart = " (simulated)" if row["simulated"] else ""
    return f"{row['orders']} orders, {kind}{row['duration_s']:.4g} s{killed}{apart}"


log_app = App(name="log", help_epilogue=epilogue(("midair log export --participant P07",)))
add_command(log_app, export_command, "export")
