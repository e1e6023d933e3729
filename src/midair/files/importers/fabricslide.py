"""Recordings of FabricSlide: a robot arm slides a capacitive finger with 16 taxels over fabrics and gratings.

Wang et al. 2022, doi 10.3389/fnbot.2022.808222. Columns: timestamp in ms, two proximity readings, channel1 to channel16
in raw counts, at about 35.6 Hz. File names are material_F<force set-point>_V<velocity>mmps_<repeat>.
"""

import re
from pathlib import Path

from midair.files.importers.text_table import TextTable
from midair.files.opened_take import ImportedData, ImportOptions
from midair.files.timestamps import to_fixed_rate
from midair.model import SensorGrid

COLUMNS = ("timestamp", "proximity1", "proximity2", *(f"channel{i}" for i in range(1, 17)))
"""Column names that identify its files."""

_NAME = re.compile(r"(?P<material>[^_]+)_F(?P<force>\d+)_V(?P<velocity>-?\d+)mmps_(?P<repeat>\d+)")
_LAYOUT = (
    "Neither the layout nor the pitch of the 16 taxels is documented: 4 x 4 in the order of the "
    "channels, 11 mm apart as in the paper's sensor, was assumed."
)


def imported(table: TextTable, path: Path, given: ImportOptions) -> ImportedData:
    """The 16 taxels at a fixed rate, without the proximity readings."""
    even = to_fixed_rate(table.values[:, 0] / 1e3, table.values[:, 3:], rate=given.rate)
    layout = {} if given.sensor else {"layout": _LAYOUT}
    return ImportedData(
        samples=even.samples,
        form="CSV of FabricSlide",
        rate=even.rate,
        unit="count",
        names=COLUMNS[3:],
        sensor=SensorGrid(name="CPM-finger of FabricSlide"),
        notes={**_notes(path), **layout},
        settings={"left_out": COLUMNS[1:3], "rate_hz": even.rate, "interpolation": "linear"},
        report=(
            *even.report,
            "Columns proximity1 and proximity2 were left out: not taxels.",
            *layout.values(),
        ),
    )


def _notes(path: Path) -> dict[str, str]:
    found = _NAME.fullmatch(path.stem)
    if found is None:
        return {}
    return {
        "material": found["material"],
        "force": f"set-point {found['force']}, unit not stated",
        "speed": f"{found['velocity']} mm/s",
        "repeat": found["repeat"],
    }
