"""The library liblsl, shared by sensors and trackers; needs the extra `lsl`."""

import os
from pathlib import Path

from midair.errors import DeviceError

try:
    import pylsl
    from pylsl.util import LostError, TimeoutError
except (OSError, RuntimeError) as _wrong:
    raise DeviceError(
        f"lsl: expected the library liblsl, which comes with the package pylsl, got: {str(_wrong).splitlines()[0]}"
    ) from _wrong


def quiet_liblsl() -> None:
    """Limit liblsl to error messages, unless the user configured it: its notes would disturb the level meters."""
    files = (Path("lsl_api.cfg"), Path.home() / "lsl_api" / "lsl_api.cfg", Path("/etc/lsl_api/lsl_api.cfg"))
    if "LSLAPICFG" not in os.environ and not any(file.exists() for file in files):
        pylsl.lib.lib.lsl_set_config_content(b"[log]\nlevel = -2\n")


def inlet_of_numbers(stream: str, name: str, search: float) -> pylsl.StreamInlet:
    """Connect to a stream of numbers, with stamps on the clock of this computer; `name` is for messages.

    DeviceError if it is not found within `search` s, sends text, or is lost.
    """
    quiet_liblsl()
    found = pylsl.resolve_byprop("name", stream, 1, search)
    if not found:
        raise DeviceError(
            f"{name}: expected a stream of this name, found none in {search:g} s; start its sender in the same network"
        )
    if found[0].channel_format() == pylsl.cf_string:
        raise DeviceError(f"{name}: expected numbers, got text; select another stream")
    inlet = pylsl.StreamInlet(found[0], recover=False, processing_flags=pylsl.proc_clocksync)
    try:
        inlet.open_stream(timeout=search)
        inlet.time_correction(timeout=search)
    except (LostError, TimeoutError) as wrong:
        raise DeviceError(f"{name}: lost the sender of the stream; start it again") from wrong
    return inlet
