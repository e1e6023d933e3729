"""The command `live`: what a sensor feels now is played now."""

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
from midair.model import Acoustics, Medium
from midair.rig import LiveSession, LiveStatistics, make_key, send_touch
from midair.rig import live as begin


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkOptions:
    """Two people: the sensor here, the array there.

    Parameters
    ----------
    listen
        HOST:PORT here, where the other side's frames come in place of a sensor's: 0.0.0.0:5005.
    to
        HOST:PORT of the other side: what the sensor feels goes there, and nothing is played here.
    key
        File that both sides share; what it does not open is refused.
    new_key
        Makes such a file, and does nothing else.
    buffer
        Of jitter on the way; it is added to the delay.
    """

    listen: str | None = None
    to: str | None = None
    key: Path | None = None
    new_key: Path | None = None
    buffer: Time = 0.01


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class LiveOptions(ExposureOptions):
    """How touch is felt and played.

    Parameters
    ----------
    sensor
        lsl:NAME, serial:PORT or ni:CHANNELS; virtual:towel (brush, sponge ...) or replay:FILE, which are repeated.
    device
        virtual, autd3, autd3:INTERFACE or autd3:emulator.
    calibration
        Of the sensor: a file of midair calibrate.
    sensor_file
        TOML file of the sensor, with the order of its channels.
    height
        Of the palm above the array.
    gain
        Multiplies the pressure.
    level
        Highest drive of any transducer, 0 to 1; exposure is admitted for the worst that it can do.
    hold
        From a frame's being taken to its sounding: all computing and sending has to fit into it.
    delay
        Of the filter that undoes the sensor, 2 to 10 ms: the less, the further from what it felt.
    mapping
        half-wave; constant-offset, with --offset; slow-bias, which waits 90 ms more and is felt as delay.
    offset
        Of the constant offset.
    band
        Lowest and highest frequency that is felt.
    silencer
        How the units spread phase steps.
    placement
        TOML file with position and rotation of the units; two by two side by side if not given.
    temperature
        Of the room's air, in degrees Celsius; the paper's 14 if not given.
    priority
        Real-time priority that is asked for, 1 to 99; 0 asks for none.
    seed
        Of a virtual sensor.
    """

    sensor: str = "virtual:towel"
    device: str = "virtual"
    calibration: Path | None = None
    sensor_file: Path | None = None
    height: Length = 0.2
    gain: float = 1.0
    level: float = 1.0
    hold: Time = 0.006
    delay: Time = 0.006
    mapping: Literal["half-wave", "constant-offset", "slow-bias"] = "half-wave"
    offset: Annotated[float | None, quantity("Pa")] = None
    band: Annotated[tuple[float, float], quantity("Hz", many=2)] = (20.0, 470.0)
    silencer: Literal["off", "quarter", "half", "default"] = "off"
    placement: Path | None = None
    temperature: float | None = None
    priority: int = 20
    seed: int = 0

    def session(self, duration: float | None, keep: Path | None, network: NetworkOptions) -> LiveSession:
        """What these options mean, not yet begun."""
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

    For stroking; a tap is noticed late. Exposure is checked before anything sounds, for the worst that the level can
    do, and the level rises over the first second. Ctrl-C ends it, and so does midair stop in another terminal. What
    does not come in time is not played; what does not come at all ends in silence.

    Parameters
    ----------
    options
        Sensor, array, and the way between them.
    network
        Over a network.
    duration
        Until Ctrl-C if not given.
    keep
        NAME.h5 of a take: what was felt, and what was played. Nothing is written over.
    json
        Print JSON for a program: frames, lost, late, and latency in ms, with more beside them.

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
        print_rows([("key", f"{network.new_key}; give the other side a copy, and nobody else")])
        return 0
    if network.to is not None:
        _speak(options, network, duration, json=json)
        return 0
    if keep is not None:
        if keep.exists():
            raise InputError(f"{keep}: is there already; give another name")
        may_write(keep, True, ".h5")
    with signals_noted() as signals, options.session(duration, keep, network) as session:
        if not json:
            banner(session.opened.simulated)
            print_rows(_found(session))
        _watch(session, signals, quiet=json)
        ended = session
    _tell(ended, keep, json=json)
    # Without a duration Ctrl-C is the way to end it.
    if not signals.came or duration is None:
        return 0
    err().print(f"midair: stopped; {'nothing was written' if keep is None else f'kept {keep}'}")
    return 130


def _tell(ended: LiveSession, keep: Path | None, *, json: bool) -> None:
    told = ended.statistics
    if json:
        opened = ended.opened
        beside = {"simulated": opened.simulated, "exposure": opened.exposure, "computer": opened.granted.words()}
        kept = {} if keep is None else {"take": str(keep)}
        return print_json(told.plain() | {"error_by_band": _by_band(ended), "network": ended.network} | beside | kept)
    print_rows([*_went(told), *_heard(ended), *([] if keep is None else [("take", str(keep))])])
    return None


def _speak(options: LiveOptions, network: NetworkOptions, duration: float | None, *, json: bool) -> None:
    """The side that feels: nothing is played here."""
    if network.key is None or network.listen is not None:
        raise InputError("--to: expected --key with the file that both sides share, and no --listen")
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
    """Until it ends, with a line that moves where somebody can see it."""
    shown = not quiet and not verbosity().quiet and sys.stderr.isatty()
    with Screen(console=err(), refresh_per_second=10, transient=True) if shown else _Nothing() as screen:
        while session.wait(0.1) and not signals.came:
            screen.update(Text(_line(session.statistics)))


class _Nothing:
    """A screen that nobody sees."""

    def __enter__(self) -> "_Nothing":
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def update(self, _: Text) -> None:
        """Show nothing."""


def _line(told: LiveStatistics) -> str:
    parts = " + ".join(f"{name} {1e3 * part:.3g}" for name, part in told.parts.items())
    return f"{told.frames} frames, {told.lost} lost, {told.late} late   {1e3 * told.latency:.3g} ms = {parts} ms"


def _by_band(session: LiveSession) -> dict[str, float]:
    opened = session.opened
    return {f"{low:g}-{high:g} Hz": round(e, 4) for (low, high), e in zip(opened.parts, opened.error, strict=True)}


def _found(session: LiveSession) -> list[tuple[str, str]]:
    """What is said before anything sounds."""
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


def _heard(session: LiveSession) -> list[tuple[str, str]]:
    """What came over a network, where anything did."""
    told = session.network
    if not told:
        return []
    said = f"{told['frames']} frames, {told['concealed']} concealed, {told['tardy']} of them came too late"
    return [("network", f"{said}; {told['repeated']} repeated and {told['refused']} others refused")]


def _went(told: LiveStatistics) -> list[tuple[str, str]]:
    def times(shares: tuple[float, ...]) -> str:
        names = ("half", "99 %", "99.9 %", "all")
        return ", ".join(f"{name} within {1e3 * each:.3g}" for name, each in zip(names, shares, strict=True)) + " ms"

    return [
        ("frames", f"{told.frames}, {told.played} of them sounded"),
        ("lost", f"{told.lost} that the sensor never gave, in {told.gaps} gaps of 20 ms or more"),
        ("late", f"{told.late}; {told.hurried} were solved in half the time, {told.unanswered} had no answer"),
        ("latency", f"{1e3 * told.latency:.3g} ms from skin to skin"),
        ("sent after they were taken", times(told.left)),
        ("work on a frame", times(told.work)),
    ]
