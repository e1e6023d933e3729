"""Compare a thermometer with the air that a drive was solved for, while it plays."""

import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager

from midair.devices import Thermometer, log_drift
from midair.errors import DeviceError
from midair.model import Medium

DRIFT = 1.0
"""Temperature difference in K from which a warning is given."""


@contextmanager
def watch_air(
    thermometer: Thermometer | None,
    solved: Medium,
    warn: Callable[[str], None],
    *,
    advice: str,
    device: str = "",
    every: float = 1.0,
) -> Generator[None]:
    """While inside, read the thermometer and warn once if it differs by 1 degree or more from the solved air.

    A thermometer that cannot be read any more is reported once; playing continues. `warn` is called from another thread
    with a line that ends in the `advice`; `device` is the array in the play log, "" if the play is not logged; `every`
    is the interval in s. The thermometer is closed at the end.
    """
    if thermometer is None:
        yield
        return
    over = threading.Event()

    def poll() -> None:
        silent = drifted = False
        while not (silent and drifted):
            try:
                now = thermometer.read()
            except DeviceError as wrong:
                if not silent:
                    warn(f"air: the temperature is no longer checked: {wrong}")
                silent = True
            else:
                if not drifted and abs(now - solved.degrees) >= DRIFT:
                    warn(
                        f"air: {thermometer.name} measures {now:.1f} °C, the drive was solved for "
                        f"{solved.degrees:.1f} °C; {advice}"
                    )
                    if device:
                        log_drift(device, thermometer.name, measured=now, solved=solved.degrees)
                    drifted = True
            if over.wait(every):
                return

    thread = threading.Thread(target=poll, name="midair air", daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
        thermometer.close()
