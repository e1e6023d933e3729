"""Panel Calibrate: response and uncertainty of a sensor. Channels are identified by `RecordPanel.taps`."""

from typing import Any

import numpy as np

from midair.files import load_calibration, open_take
from midair.rig import calibration_rows
from midair.studio.jobs import Progressed
from midair.studio.panels.panel import WEB, Panel, PanelContext
from midair.studio.panels.reproduce_panel import TakeNamed
from midair.studio.studio_state import Page


class CalibratePanel(Panel):
    """Calibrations of takes and calibration files."""

    name, title, script, place = "calibrate", "Calibrate", WEB / "room-calibrate.js", 3

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context)
        self._offer(look=TakeNamed, watchers=True)

    async def look(self, _: Page, order: TakeNamed) -> Any:
        """Return the calibration of a take's sensor, or None if the take has none."""
        path = str(self._takes.path(order.take))
        return await self._context.reading.result(f"calibration of {order.take}", calibration_facts, path)


def calibration_facts(path: str, _: Progressed) -> dict[str, Any] | None:
    """Return a calibration for the page: table rows, and the response of every channel with its uncertainty.

    The frequencies are reduced to 160 on a logarithmic axis; a screen shows no more.
    """
    held = load_calibration(path) if path.endswith(".calibration.h5") else open_take(path).calibration
    if held is None:
        return None
    kept = np.flatnonzero((held.frequency >= 5) & (held.frequency <= 2000))
    if len(kept) > 160:
        wanted = np.geomspace(held.frequency[kept[0]], held.frequency[kept[-1]], 160)
        kept = np.unique(kept[np.clip(np.searchsorted(held.frequency[kept], wanted), 0, len(kept) - 1)])
    size = np.abs(held.response[kept]).reshape(len(kept), -1)
    middle = int(np.argmin(np.abs(held.frequency - 100.0)))
    sensitivity = np.abs(held.response[middle]).ravel()
    dead = [int(n) for n in np.flatnonzero(sensitivity < 0.05 * np.median(sensitivity))]
    measured = held.measurement
    unsure = None if measured is None else np.asarray(measured.magnitude_uncertainty)[kept].reshape(len(kept), -1)
    return {
        "rows": [list(row) for row in calibration_rows(held)],
        "unit": f"{held.unit}/Pa",
        "frequency": np.round(held.frequency[kept], 2).tolist(),
        "response": np.asarray([[float(f"{value:.4g}") for value in row] for row in size.T]).tolist(),
        "uncertainty": None if unsure is None else np.round(2 * unsure.T, 4).tolist(),
        "sensitivity": [float(f"{value:.4g}") for value in sensitivity],
        "rows_of_cells": held.sensor.rows,
        "columns": held.sensor.columns,
        "dead": dead,
        "simulated": held.provenance.simulated,
    }
