"""Output of calibrations: options, comparison with an earlier one, rows to print."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from cyclopts import Parameter

from midair.cli.options import Force, Json
from midair.cli.output import may_write, print_result
from midair.errors import MismatchError, MissingFileError
from midair.files import CALIBRATION_SUFFIX, load_calibration, save_calibration
from midair.model import Calibration, SensorGrid
from midair.rig import calibration_rows, check_page_name, write_calibration_page


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class OutputOptions:
    """Where to write a calibration."""

    output: Path | None = None
    """File to write, NAME.calibration.h5. [default: the sensor's name and the date]"""
    date: str | None = None
    """Date of the measurement, ISO 8601. [default: today]"""
    supersedes: Path | None = None
    """Earlier calibration of the same sensor: the new one gets the next version and is compared with it."""
    figure: Path | None = None
    """Write figures of the calibration to NAME.png or NAME.html."""
    force: Force = False
    json: Json = False

    @property
    def day(self) -> str:
        """Date of the measurement."""
        return self.date or datetime.now(UTC).date().isoformat()

    def path(self, sensor: SensorGrid) -> Path:
        """Output file, after checking that it may be written."""
        name = re.sub(r"[^\w.-]+", "-", sensor.name).strip("-") or "sensor"
        target = self.output or Path(f"{name}-{self.day}{CALIBRATION_SUFFIX}")
        may_write(target, self.force)
        prepare_page(self.figure, self.force)
        return target

    def version(self, sensor: SensorGrid) -> int:
        """Version of the superseded calibration plus one, or 1."""
        if self.supersedes is None:
            return 1
        old = require_calibration(self.supersedes)
        if old.sensor != sensor:
            raise MismatchError(
                f"{self.supersedes}: expected a calibration of {sensor.name!r}, got one of {old.sensor.name!r}"
            )
        return old.version + 1

    def write(self, calibration: Calibration, notes: list[str]) -> None:
        """Write calibration and page, and print the difference from the superseded one."""
        target = self.path(calibration.sensor)
        if self.supersedes is not None:
            notes = [*notes, drift(require_calibration(self.supersedes), calibration)]
        save_calibration(calibration, target)
        print_calibration(calibration, [("written", str(target))], page=self.figure, json=self.json, notes=notes)


def drift(old: Calibration, new: Calibration) -> str:
    """Difference between two calibrations of a sensor, and whether their uncertainties explain it."""
    low, high = max(old.frequency[0], new.frequency[0]), min(old.frequency[-1], new.frequency[-1])
    if low > high:
        return "no comparison: it has no frequency in common with the superseded calibration"
    frequency = np.linspace(low, high, 64)
    was, now = np.abs(old.response_at(frequency)), np.abs(new.response_at(frequency))
    heard = (was > 0) & (now > 0)
    change = np.divide(now, was, out=np.ones_like(was), where=heard) - 1
    worst = np.unravel_index(int(np.argmax(np.abs(change))), change.shape)
    channel = int(worst[1]) * old.sensor.columns + int(worst[2])
    told = f"since {old.identifier} (version {old.version}, {old.date}) the response has changed by "
    told += f"{100 * np.median(change):.2g} % (median), at most {100 * change[worst]:.2g} % (channel {channel}"
    told += f", {frequency[worst[0]]:.0f} Hz)"
    before, after = old.uncertainty_at(frequency), new.uncertainty_at(frequency)
    if before is None or after is None:
        return told
    # E_n of ISO 13528, 9.7: difference over the root of the sum of squares of both expanded uncertainties.
    score = np.abs(change) / np.maximum(2 * np.hypot(before, after), 1e-12)
    return f"{told}; E_n {np.median(score[heard]):.2g} (median), {100 * (score[heard] > 1).mean():.1f} % above 1"


def require_calibration(path: Path) -> Calibration:
    """The calibration in a file; MissingFileError if there is none."""
    found = load_calibration(path)
    if found is None:
        raise MissingFileError(f"{path}: expected a calibration in it, found none; run midair calibrate measure")
    return found


def prepare_page(page: Path | None, force: bool) -> None:
    """Refuse a page that cannot be written, before the work begins."""
    if page is not None:
        check_page_name(page)
        may_write(page, force)


def print_calibration(
    calibration: Calibration, rows: list[tuple[str, str]], *, page: Path | None, json: bool, notes: Sequence[str] = ()
) -> None:
    """Print a calibration, and write its page if requested."""
    if page is not None:
        write_calibration_page(calibration, page)
        rows = [*rows, ("page", str(page))]
    rows = [*calibration_rows(calibration), *rows, *(() if json else (("note", note) for note in notes))]
    print_result(rows, simulated=calibration.provenance.simulated, json=json, notes=notes)
