"""`midair.live`: a sensor, an array, and what is felt on one played on the other."""

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from midair.devices import ExposureChoices, ExposureClearance, SilencerChoice, check_exposure_level
from midair.errors import InputError
from midair.files import load_calibration
from midair.model import Acoustics, Calibration, ControlGrid, Placement, SensorWiring
from midair.rig.live_touch.encryption import read_key
from midair.rig.live_touch.live_loop import Pace
from midair.rig.live_touch.live_settings import LiveSettings, NetworkInput
from midair.rig.live_touch.process import array_for, calibration_for, check_rate, sensor_for
from midair.rig.live_touch.sending import FrameSender
from midair.rig.live_touch.session import LiveSession
from midair.rig.live_touch.touch import TouchSettings
from midair.rig.play_lease import LeaseToken, PlayLease
from midair.rig.playing import usual_exposure


def live(
    sensor: str = "virtual:towel",
    device: str = "virtual",
    *,
    height: float = 0.2,
    gain: float = 1.0,
    level: float = 1.0,
    hold: float = 0.006,
    delay: float = 0.006,
    mapping: str = "half-wave",
    offset: float | None = None,
    band: tuple[float, float] = (20.0, 470.0),
    calibration: Calibration | str | Path | None = None,
    wiring: SensorWiring | None = None,
    placement: Placement | None = None,
    silencer: SilencerChoice = "off",
    acoustics: Acoustics | None = None,
    exposure: ExposureChoices | None = None,
    duration: float | None = None,
    keep: str | Path | None = None,
    notes: dict[str, str] | None = None,
    listen: str | None = None,
    key: str | Path | None = None,
    buffer: float = 0.01,
    permit: PlayLease | None = None,
    leave: LeaseToken | None = None,
    priority: int = 20,
    seed: int = 0,
) -> LiveSession:
    """Play what a sensor feels while it feels it, 13 ms later; a context manager, silent once it is left.

    It runs in a process of its own. A script of yours has to begin it below ``if __name__ == "__main__":``, since that
    process reads the script, too.

    Parameters
    ----------
    sensor : str
        By name: ``lsl:NAME``, ``serial:PORT``, ``ni:CHANNELS``; ``virtual:towel`` and ``replay:take.h5``, which are
        repeated. Sound cards are refused: their buffers take 64 ms.
    device : str
        ``virtual``, ``autd3``, ``autd3:INTERFACE`` or ``autd3:emulator``.
    height : float
        Of the palm above the array, in m.
    gain : float
        Multiplies the pressure.
    level : float
        Highest drive of any transducer, above 0 to 1. Exposure is admitted for the worst that it can do.
    hold : float
        From a frame's being taken to its sounding, in s: what all computing and sending has to fit into.
    delay : float
        Of the filter that undoes the sensor, 2 to 10 ms, in s: the less, the further from what it felt.
    mapping : {"half-wave", "constant-offset", "slow-bias"}
        From pressure of both signs to pressure that pushes. The slow bias waits for 90 ms more, which is felt as delay.
    offset : float, optional
        Of the constant offset, in Pa.
    band : tuple of float
        (low, high) of what is felt, in Hz.
    calibration : Calibration or path, optional
        Of the sensor; its own if None.
    wiring : SensorWiring, optional
        Which channel is which cell.
    placement : Placement, optional
        Of the array's units; two by two if None.
    silencer : {"off", "quarter", "half", "default"}
        Over how long the firmware spreads steps.
    acoustics : Acoustics, optional
        Of the room's air; the paper's if None.
    exposure : ExposureChoices, optional
        What the level has to keep; the usual profile, with nobody answering for more, if None.
    duration : float, optional
        In s; until it is left if None.
    keep : str or Path, optional
        A take of what was felt and what was played.
    notes : dict of str to str, optional
        For the take.
    listen : str, optional
        Address and port, such as ``0.0.0.0:5005``, where frames of `send_touch` arrive over a network.
    key : str or Path, optional
        Of a file that both sides share, see `make_key`.
    buffer : float
        Length of the jitter buffer, in s.
    permit : Permit, optional
        That another renews, and that can silence it.
    leave : Leave, optional
        By which the other armed that permit; armed here if None.
    priority : int
        Real-time priority that is asked for, 1 to 99; 0 asks for none.
    seed : int
        Of a virtual sensor.

    Returns
    -------
    LiveSession
        To be entered by ``with``: ``wait(seconds)``, ``statistics``, ``stop()``.

    Raises
    ------
    InputError
        If a value is out of range, or what it asks for takes too long to be called live.

    Examples
    --------
    >>> with midair.live("virtual:towel", duration=2.0) as session:
    ...     session.wait()
    ...     print(session.statistics.late)
    """
    if (mapping == "constant-offset") != (offset is not None):
        raise InputError(
            "offset: expected one in Pa for constant-offset and none for the others, got "
            f"{'none' if offset is None else 'one'} for {mapping}; measure it on an earlier recording"
        )
    known = calibration if isinstance(calibration, Calibration | None) else load_calibration(calibration)
    order = LiveSettings(
        sensor=sensor if listen is None else f"listen:{listen}",
        device=device,
        exposure=exposure or usual_exposure(),
        touch=TouchSettings(
            band=band,
            delay=delay,
            mapping=mapping,
            offset=offset,
            gain=gain,
            grid=ControlGrid(height=height),
            acoustics=acoustics or Acoustics(),
        ),
        pace=Pace(hold=hold),
        level=level,
        calibration=known,
        wiring=wiring,
        placement=placement,
        silencer=silencer,
        duration=duration,
        listen=None if listen is None else _listening(listen, key, buffer),
        priority=priority,
        seed=seed,
    )
    return LiveSession(order, keep=None if keep is None else Path(keep), notes=notes, permit=permit, leave=leave)


def live_clearance(order: LiveSettings, *, rate: float = 1000.0) -> ExposureClearance:
    """What an order would expose people to, told without opening a device, for whoever has to decide first.

    What plays asks once more, of the device itself.

    Parameters
    ----------
    order : LiveOrder
        What and how.
    rate : float
        Frames per second, in Hz.

    Raises
    ------
    ExposureError
        If the worst that its level can do exceeds the profile, and nobody answers for it.
    """
    array = array_for(order, rate)
    return check_exposure_level(order.level, array, order.exposure, rate=rate)


@contextmanager
def send_touch(
    sensor: str,
    to: str,
    key: str | Path,
    *,
    delay: float = 0.006,
    band: tuple[float, float] = (20.0, 470.0),
    calibration: Calibration | str | Path | None = None,
    wiring: SensorWiring | None = None,
    patience: float = 30.0,
    seed: int = 0,
) -> Generator[FrameSender]:
    """What a sensor feels here, for a `live` that listens elsewhere: greeted when entered, sent by its ``run``.

    Parameters
    ----------
    sensor : str
        By name, as in `live`.
    to : str
        Host and port of the side that plays, such as ``lab.example:5005``.
    key : str or Path
        Of the file that both sides share.
    delay, band, calibration, wiring, seed
        As in `live`.
    patience : float
        How long to wait for an answer, in s.

    Raises
    ------
    DeviceError
        If nobody answers who has the key.
    InputError
        If an address, a key or a setting cannot be used.
    """
    known = calibration if isinstance(calibration, Calibration | None) else load_calibration(calibration)
    here = LiveSettings(
        sensor=sensor,
        device="",
        exposure=usual_exposure(),
        touch=TouchSettings(band=band, delay=delay),
        calibration=known,
        wiring=wiring,
        seed=seed,
    )
    opened, _ = sensor_for(here)
    with opened:
        check_rate(opened)
        undone = calibration_for(here, opened) or Calibration.flat(opened.grid, unit="Pa")
        address, secret = host_and_port(to, "--to"), read_key(Path(key))
        speaker = FrameSender(opened, undone, address, secret, band=band, delay=delay, patience=patience)
        try:
            speaker.greet()
            yield speaker
        finally:
            speaker.close()


def host_and_port(text: str, option: str) -> tuple[str, int]:
    """Both parts of an address such as ``lab.example:5005`` or ``[::1]:5005``.

    Raises
    ------
    InputError
        If it is none.
    """
    host, colon, port = text.rpartition(":")
    if not (colon and host and port.isdecimal() and 0 < int(port) < 65536):
        raise InputError(f"{option}: expected HOST:PORT, such as 192.168.1.20:5005, got {text!r}")
    return host.removeprefix("[").removesuffix("]"), int(port)


def _listening(listen: str, key: str | Path | None, buffer: float) -> NetworkInput:
    if key is None:
        raise InputError("--listen: expected --key with the file that both sides share; --new-key FILE makes one")
    host, port = host_and_port(listen, "--listen")
    return NetworkInput(host=host, port=port, key=read_key(Path(key)), buffer=buffer)
