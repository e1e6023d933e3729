"""The command `live`: play the signal of a sensor in real time."""

import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter
from rich.live import Live as Screen
from rich.text import Text

from midair.cli.terminal import (
    ExposureOptions,
    Json,
    Length,
    Signals,
    Time,
    banner,
    err,
    may_write,
    print_json,
    print_rows,
    quantity,
    signals_noted,
    verbosity,
)
from midair.errors import InputError
from midair.files import load_placement, load_sensor
from midair.model import BAND, HEIGHT, Acoustics, Medium
from midair.rig import LiveSession, LiveStatistics, make_key, send_touch
from midair.rig import live as begin


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkOptions:
    """Live touch over a network: sensor on one computer, array on another.

    Parameters
    ----------
    listen
        Receive frames on HOST:PORT instead of reading a sensor, such as 0.0.0.0:5005. Needs --key.
    to
        Send the sensor's frames to HOST:PORT; nothing plays on this computer. Needs --key.
    key
        Key file that both computers share; packets that fail authentication are dropped.
    new_key
        Create a key file and exit.
    buffer
        Jitter buffer of the receiver; it adds to the delay.
    """

    listen: str | None = None
    to: str | None = None
    key: Path | None = None
    new_key: Path | None = None
    buffer: Time = 0.01


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class LiveOptions(ExposureOptions):
    """Sensor, array, and the processing between them.

    Parameters
    ----------
    sensor
        Sensor: lsl:NAME, serial:PORT, ni:CHANNELS; or virtual:towel (brush, sponge ...), replay:FILE, which repeat.
    device
        Array: virtual, autd3, autd3:INTERFACE or autd3:emulator.
    calibration
        Calibration of the sensor, a file of midair calibrate.
    sensor_file
        TOML file of the sensor with the order of its channels.
    height
        Height of the palm above the array.
    gain
        Factor on the pressure.
    level
        Highest drive level of any transducer, 0 to 1; the exposure check assumes the worst case at this level.
    hold
        Delay from sampling a frame to emitting it; all computing and sending must fit into it.
    delay
        Delay of the inverse sensor filter, 2 to 10 ms; shorter is less accurate.
    mapping
        How signed pressure is made positive: half-wave; constant-offset (needs --offset); slow-bias (90 ms more delay).
    offset
        Offset of the mapping constant-offset.
    band
        Lowest and highest frequency to reproduce.
    silencer
        How the units smooth phase steps.
    placement
        TOML file with position and rotation of the units. [default: two by two, side by side]
    temperature
        Air temperature, such as 22C. [default: 14C, as in the paper]
    priority
        Real-time priority of the process to request, 1 to 99; 0 requests none.
    seed
        Random seed of a virtual sensor.
    """

    sensor: str = "virtual:towel"
    device: str = "virtual"
    calibration: Path | None = None
    sensor_file: Path | None = None
    height: Length = HEIGHT
    gain: float = 1.0
    level: float = 1.0
    hold: Time = 0.006
    delay: Time = 0.006
    mapping: Literal["half-wave", "constant-offset", "slow-bias"] = "half-wave"
    offset: Annotated[float | None, quantity("Pa")] = None
    band: Annotated[tuple[float, float], quantity("Hz", many=2)] = BAND
    silencer: Literal["off", "quarter", "half", "default"] = "off"
    placement: Path | None = None
    temperature: Annotated[float | None, quantity("C")] = None
    priority: int = 20
    seed: int = 0

    def session(self, duration: float | None, keep: Path | None, network: NetworkOptions) -> LiveSession:
        """The session that these options describe, not yet started."""
        if not 0 <= self.priority <= 99:
            raise InputError(f"--priority: expected 0 to 99, got {self.priority}")
        air = None if self.temperature is None else Acoustics(medium=Medium.at(temperature=self.temperature))
        return begin(
            self.sensor,
            self.device,
            height=self.height,
            gain=self.gain,
            level=self.level,
            hold=self.hold,
            delay=self.delay,
            mapping=self.mapping,
            offset=self.offset,
            band=self.band,
            calibration=self.calibration,
            wiring=None if self.sensor_file is None else load_sensor(self.sensor_file),
            placement=None if self.placement is None else load_placement(self.placement),
            silencer=self.silencer,
            acoustics=air,
            exposure=self.choices(None if air is None else air.medium),
            duration=duration,
            keep=keep,
            listen=network.listen,
            key=network.key,
            buffer=network.buffer,
            priority=self.priority,
            seed=self.seed,
        )


def live_command(
    *,
    options: LiveOptions | None = None,
    network: NetworkOptions | None = None,
    duration: Annotated[float | None, quantity("s")] = None,
    keep: Path | None = None,
    json: Json = False,
) -> int:
    """Play the pressure on a sensor in real time, 13 ms later.

    Suited to strokes; the delay of a tap is noticeable.
    The exposure check covers the worst case at the chosen level. The level rises over the first second.
    Frames that arrive too late are not played; without new frames the array becomes silent.
    Ctrl-C ends it, and so does midair stop in another terminal.

    Parameters
    ----------
    duration
        Time to play. [default: until Ctrl-C]
    keep
        Record the session to this NAME.h5: calibrated pressure and drive. Existing files are not overwritten.
    json
        Print the result as JSON: frames, lost, late, latency in ms, and more.

    Examples
    --------
    $ midair live --duration 2s
    $ midair live --sensor virtual:sponge --duration 2s --keep felt.h5 --json
    $ midair live --new-key touch.key
    $ midair live --listen 0.0.0.0:5005 --key touch.key --device autd3
    $ midair live --to lab.example:5005 --key touch.key --sensor "lsl:Skin?unit=V" --calibration skin.calibration.h5
    $ midair live --sensor "lsl:Skin?unit=V" --calibration skin.calibration.h5 --device autd3 --level 0.3
    """
    options, network = options or LiveOptions(), network or NetworkOptions()
    if network.new_key is not None:
        make_key(network.new_key)
        print_rows([("key", f"{network.new_key}; copy it to the other computer, and keep it secret")])
        return 0
    if network.to is not None:
        _send(options, network, duration, json=json)
        return 0
    if keep is not None:
        if keep.exists():
            raise InputError(f"{keep}: already exists; give another name")
        may_write(keep, True, ".h5")
    with signals_noted() as signals, options.session(duration, keep, network) as session:
        if not json:
            banner(session.opened.simulated)
            print_rows(_session_rows(session))
        _watch(session, signals, quiet=json)
        ended = session
    _print_result(ended, keep, json=json)
    # Without a duration Ctrl-C is the normal end.
    if not signals.came or duration is None:
        return 0
    err().print(f"midair: stopped; {'nothing was written' if keep is None else f'kept {keep}'}")
    return 130


def _print_result(ended: LiveSession, keep: Path | None, *, json: bool) -> None:
    counts = ended.statistics
    if json:
        opened = ended.opened
        beside = {"simulated": opened.simulated, "exposure": opened.exposure, "computer": opened.granted.words()}
        kept = {} if keep is None else {"take": str(keep)}
        return print_json(counts.plain() | {"error_by_band": _by_band(ended), "network": ended.network} | beside | kept)
    print_rows([*_statistics_rows(counts), *_network_rows(ended), *([] if keep is None else [("take", str(keep))])])
    return None


def _send(options: LiveOptions, network: NetworkOptions, duration: float | None, *, json: bool) -> None:
    """Send a sensor's frames to the other computer; nothing plays here."""
    if network.key is None or network.listen is not None:
        raise InputError("--to: expected --key with the shared key file, and no --listen")
    with (
        signals_noted() as signals,
        send_touch(
            options.sensor,
            network.to or "",
            network.key,
            delay=options.delay,
            band=options.band,
            calibration=options.calibration,
            wiring=None if options.sensor_file is None else load_sensor(options.sensor_file),
            seed=options.seed,
        ) as speaker,
    ):
        if not json:
            banner(speaker.greeting.simulated)
        until = None if duration is None else time.monotonic() + duration
        speaker.run(lambda: not signals.came and (until is None or time.monotonic() < until))
    spoken = asdict(speaker.spoken)
    if json:
        return print_json(spoken | {"simulated": speaker.greeting.simulated})
    return print_rows([(name, str(count)) for name, count in spoken.items()])


def _watch(session: LiveSession, signals: Signals, *, quiet: bool) -> None:
    """Wait for the end, with a status line if stderr is a terminal."""
    shown = not quiet and not verbosity().quiet and sys.stderr.isatty()
    with Screen(console=err(), refresh_per_second=10, transient=True) if shown else _NoScreen() as screen:
        while session.wait(0.1) and not signals.came:
            screen.update(Text(_status_line(session.statistics)))


class _NoScreen:
    """Replacement for the status line that shows nothing."""

    def __enter__(self) -> "_NoScreen":
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def update(self, _: Text) -> None:
        """Ignore the text."""


def _status_line(counts: LiveStatistics) -> str:
    parts = " + ".join(f"{name} {1e3 * part:.3g}" for name, part in counts.parts.items())
    return (
        f"{counts.frames} frames, {counts.lost} lost, {counts.late} late   {1e3 * counts.latency:.3g} ms = {parts} ms"
    )


def _by_band(session: LiveSession) -> dict[str, float]:
    opened = session.opened
    return {f"{low:g}-{high:g} Hz": round(e, 4) for (low, high), e in zip(opened.parts, opened.error, strict=True)}


def _session_rows(session: LiveSession) -> list[tuple[str, str]]:
    """Rows to print before the array plays."""
    opened, order = session.opened, session.order
    grid = opened.sensor
    errors = ", ".join(f"{100 * error:.0f} % in {band}" for band, error in _by_band(session).items())
    return [
        ("sensor", f"{order.sensor}, {grid.rows} x {grid.columns} cells at {opened.rate:g} Hz"),
        ("array", f"{order.device}, {opened.transducers} transducers, silencer {opened.silencer}"),
        ("exposure", opened.exposure),
        ("level", f"{opened.level:.3g} of full drive, rising over {order.pace.rise:g} s"),
        ("delay", " + ".join(f"{name} {1e3 * part:.3g} ms" for name, part in session.statistics.parts.items())),
        ("error of the filter", errors),
        ("computer", opened.granted.words()),
    ]


def _network_rows(session: LiveSession) -> list[tuple[str, str]]:
    """Counts of the network receiver; no rows without one."""
    counts = session.network
    if not counts:
        return []
    said = f"{counts['frames']} frames, {counts['concealed']} concealed, {counts['tardy']} of them arrived too late"
    return [("network", f"{said}; {counts['repeated']} duplicates and {counts['refused']} other packets dropped")]


def _statistics_rows(counts: LiveStatistics) -> list[tuple[str, str]]:
    def times(shares: tuple[float, ...]) -> str:
        names = ("half", "99 %", "99.9 %", "all")
        return ", ".join(f"{name} within {1e3 * each:.3g}" for name, each in zip(names, shares, strict=True)) + " ms"

    return [
        ("frames", f"{counts.frames}, {counts.played} of them played"),
        ("lost", f"{counts.lost} missing from the sensor, in {counts.gaps} gaps of 20 ms or more"),
        ("late", f"{counts.late}; {counts.hurried} solved in half the time, {counts.unanswered} without a solution"),
        ("latency", f"{1e3 * counts.latency:.3g} ms from skin to skin"),
        ("sent after they were taken", times(counts.left)),
        ("work on a frame", times(counts.work)),
    ]
