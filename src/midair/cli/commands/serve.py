"""The command `serve`: other programs play drives and patterns through messages."""

import gc
import os
import re
import secrets
import sys
from contextlib import suppress
from pathlib import Path
from typing import Annotated

from cyclopts import App

from midair import devices, files, rig
from midair.cli.console import banner, print_note
from midair.cli.exposure_options import RoomOptions
from midair.cli.help_text import add_command, epilogue, examples_of
from midair.cli.options import StopInput, options_from, quantity, settings_from
from midair.errors import InputError


@options_from(
    rig.PlaySettings, "device", "placement", "silencer", "participant", device="virtual, autd3, autd3:INTERFACE."
)
class ServeOptions:
    """Array and playback."""


@options_from(
    rig.PlaySettings,
    *("device", "placement", "silencer", "participant", "follow", "tracker_latency"),
    device="virtual, autd3, autd3:INTERFACE.",
    follow="Tracker of the palm that the pattern moves with when the Designer asks for tracking.",
)
class DesignerOptions:
    """Array, playback and tracker."""


def serve_command(
    folder: Path = Path(),
    /,
    *,
    options: ServeOptions | None = None,
    host: str = "127.0.0.1",
    ports: tuple[int, int] = (8700, 8701),
    key: Path | None = None,
    room: RoomOptions | None = None,
    stop_input: StopInput = None,
) -> None:
    """Let other programs play: Unity, Max, TouchDesigner, scripts, over WebSocket or OSC.

    Prints both addresses with the key, and one line for each refused message. Ctrl-C ends it in silence.

    Parameters
    ----------
    folder
        Folder of the drives and patterns that clients can load.
    host
        Address to listen on; messages and key are not encrypted, so keep to this computer where you can.
    ports
        TCP port for WebSocket and UDP port for OSC; 0 selects a free one.
    key
        File with the key; a new file gets a new key. [default: a new key at each start]

    Examples
    --------
    $ midair serve
    $ midair serve effects --device autd3 --attenuate
    """
    secret = secrets.token_urlsafe(16) if key is None else _kept_key(key)

    def ready(tcp: int, udp: int) -> None:
        # A table would fold the address.
        sys.stdout.write(f"WebSocket ws://{host}:{tcp}/?key={secret}\nOSC {host}:{udp} key {secret}\n")
        sys.stdout.flush()

    settings = _ready_settings(options or ServeOptions(), room)
    with devices.stop_on_input(stop_input):
        rig.serve(folder, key=secret, settings=settings, host=host, ports=ports, report=print_note, ready=ready)


def _kept_key(path: Path) -> str:
    """Return the key of a file; a file that does not exist is made, readable by this user only."""
    with suppress(FileExistsError), os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
        file.write(secrets.token_urlsafe(16) + "\n")
    text = files.read_text(path, "a file with a key").strip()
    if not re.fullmatch(r"[\w-]{16,128}", text):
        raise InputError(f"{path}: expected a key of 16 to 128 letters and digits; name a new file")
    return text


def adaptics_command(
    *,
    pressure: Annotated[float, quantity("Pa")] = 50.0,
    port: int = 8037,
    options: DesignerOptions | None = None,
    room: RoomOptions | None = None,
    stop_input: StopInput = None,
) -> None:
    """Let the AdapTics Designer on this computer play its pattern on the array.

    Press Connect in the Designer, then Play. Ctrl-C ends it in silence.

    Parameters
    ----------
    pressure
        Pressure of intensity 1.
    port
        TCP port of this computer; 0 selects a free one.

    Examples
    --------
    $ midair serve adaptics
    $ midair serve adaptics --device autd3 --attenuate --pressure 80Pa
    """

    def ready(tcp: int) -> None:
        sys.stdout.write(f"AdapTics Designer: connect to ws://127.0.0.1:{tcp}/\n")
        sys.stdout.flush()

    settings = _ready_settings(options or DesignerOptions(), room)
    with devices.stop_on_input(stop_input):
        rig.serve_adaptics(settings=settings, pressure=pressure, port=port, report=print_note, ready=ready)


def _ready_settings(options: object, room: RoomOptions | None) -> rig.PlaySettings:
    """The settings of a server, after real-time priority was asked for."""
    settings = settings_from(rig.PlaySettings, options, exposure=(room or RoomOptions()).limits())
    banner(settings.device == "virtual")
    # Before an SDK starts its threads, which inherit the priority.
    print_note(rig.request_realtime())
    gc.enable()
    return settings


serve_app = App(name="serve", help_epilogue=epilogue(examples_of(serve_command)))
serve_app.default(serve_command)
add_command(serve_app, adaptics_command, "adaptics")
