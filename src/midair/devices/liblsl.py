"""The library liblsl, shared by sensors and trackers; needs the extra `lsl`."""

import os
from pathlib import Path

from midair.errors import DeviceError

try:
    import pylsl
except (OSError, RuntimeError) as _wrong:
    raise DeviceError(
        f"lsl: expected the library liblsl, which comes with the package pylsl, got: {str(_wrong).splitlines()[0]}"
    ) from _wrong


def quiet_liblsl() -> None:
    """Limit liblsl to error messages, unless the user configured it: its notes would disturb the level meters."""
    files = (Path("lsl_api.cfg"), Path.home() / "lsl_api" / "lsl_api.cfg", Path("/etc/lsl_api/lsl_api.cfg"))
    if "LSLAPICFG" not in os.environ and not any(file.exists() for file in files):
        pylsl.lib.lib.lsl_set_config_content(b"[log]\nlevel = -2\n")
