"""`midair.live`: play a sensor's signal on an array while it is measured."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from midair.devices import Cooling, ExposureClearance, LeaseToken, PlayLease
from midair.model import RATE
from midair.rig.live_touch.live_settings import LiveSettings
from midair.rig.live_touch.process import live_rig
from midair.rig.live_touch.session import LiveSession
from midair.rig.session import Session


def live(
    sensor: str | None = None,
    device: str | None = None,
    *,
    settings: LiveSettings | None = None,
    cooling: Cooling | None = None,
    keep: str | Path | None = None,
    notes: dict[str, str] | None = None,
    permit: PlayLease | None = None,
    leave: LeaseToken | None = None,
    report: Callable[[str], object] | None = None,
    **changes: Any,
) -> LiveSession:
    """Play a sensor's signal on an array, 13 ms later by default; a context manager that is silent after leaving.

    It runs in a separate process. A script has to start it below ``if __name__ == "__main__":``, since that process
    imports the script as well. Raises InputError if a value is out of range, or a sensor is too slow for live touch.

    Parameters
    ----------
    sensor, device : str, optional
        Names of the sensor and of the array, as in `LiveSettings`.
    settings : LiveSettings, optional
        All settings; the defaults if None.
    cooling : Cooling, optional
        How to wait in silence for units that are too hot; without it they end the session with TooHotError.
    keep : str or Path, optional
        File for a take of the sensor's samples and the emitted phases.
    notes : dict of str to str, optional
        Notes of the take.
    permit : PlayLease, optional
        Lease that another program renews and can stop; a lease of its own if None.
    leave : LeaseToken, optional
        Token of that lease's arming; armed here if None.
    report : callable, optional
        Called by ``wait`` with one line when following the palm begins or ends; with ``cooling`` also for its pauses.
    **changes
        Fields of `LiveSettings` that differ from `settings`, such as ``height=0.15``. Calibration, wiring and placement
        may be the path of a file.

    Returns
    -------
    LiveSession
        Enter it with ``with``: ``wait(seconds)``, ``statistics``, ``stop()``.

    Examples
    --------
    >>> with midair.live("virtual:towel", duration=2.0) as session:
    ...     session.wait()
    ...     print(session.statistics.late)
    """
    named: dict[str, Any] = {
        name: value for name, value in (("sensor", sensor), ("device", device)) if value is not None
    }
    if cooling is not None:
        named["cooling_limit"] = cooling.limit
    order = (settings or LiveSettings()).but(**named, **changes)
    return LiveSession(
        order,
        keep=None if keep is None else Path(keep),
        notes=notes,
        permit=permit,
        leave=leave,
        report=report or (None if cooling is None else cooling.report),
    )


def live_clearance(order: LiveSettings) -> ExposureClearance:
    """Check the exposure of live settings without opening a device; `live` checks again with the device.

    `rate` is the frame rate in Hz. Raises ExposureError if the worst case at this level exceeds the profile without an
    override.
    """
    return Session(rig=live_rig(order, RATE)).clear_level(order.level, order.schedule(RATE).formed * RATE)
