"""`midair.live` and `midair.send_touch`: play a sensor's signal on an array, on one computer or over a network."""

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from midair.devices import ExposureChoices, ExposureClearance, SilencerChoice, check_exposure_level
from midair.errors import InputError
from midair.files import load_calibration
from midair.model import BAND, HEIGHT, RATE, Acoustics, Calibration, ControlGrid, Placement, SensorWiring
from midair.rig.live_touch.encryption import read_key
from midair.rig.live_touch.live_loop import Pace
from midair.rig.live_touch.live_settings import LiveSettings, NetworkInput
from midair.rig.live_touch.process import array_for, calibration_for, check_rate, sensor_for
from midair.rig.live_touch.sending import FrameSender
from midair.rig.live_touch.session import LiveSession
from midair.rig.live_touch.touch import TouchSettings
from midair.rig.play_lease import LeaseToken, PlayLease
from midair.rig.playing import default_exposure


def live(
    sensor: str = "virtual:towel",
    device: str = "virtual",
    *,
    height: float = HEIGHT,
    gain: float = 1.0,
    level: float = 1.0,
    hold: float = 0.006,
    delay: float = 0.006,
    mapping: str = "half-wave",
    offset: float | None = None,
    band: tuple[float, float] = BAND,
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
    """Play a sensor's signal on an array, 13 ms later; a context manager that is silent after leaving.

    It runs in a separate process. A script has to start it below ``if __name__ == "__main__":``, since that process
    imports the script as well.

    Parameters
    ----------
    sensor : str
        ``lsl:NAME``, ``serial:PORT``, ``ni:CHANNELS``; ``virtual:towel`` and ``replay:take.h5``, which are repeated.
        Sound cards are refused: their buffers delay by 64 ms.
    device : str
        ``virtual``, ``autd3``, ``autd3:INTERFACE`` or ``autd3:emulator``.
    height : float
        Height of the palm above the array in m.
    gain : float
        Factor that multiplies the pressure.
    level : float
        Largest drive of any transducer, above 0 to 1. The exposure check assumes the worst case at this level.
    hold : float
        Delay from sampling a frame to emitting it, in s; all computing and sending must fit into it.
    delay : float
        Delay of the filter that inverts the sensor's response, 2 to 10 ms, in s; a shorter delay is less accurate.
    mapping : {"half-wave", "constant-offset", "slow-bias"}
        How signed pressure is made positive. The slow bias adds 90 ms of delay.
    offset : float, optional
        Constant offset in Pa, for "constant-offset" only.
    band : tuple of float
        (low, high) of the frequency band in Hz.
    calibration : Calibration or path, optional
        Calibration of the sensor; its own if None.
    wiring : SensorWiring, optional
        Assignment of channels to cells.
    placement : Placement, optional
        Placement of the array's units; two by two if None.
    silencer : {"off", "quarter", "half", "default"}
        How the firmware spreads phase steps.
    acoustics : Acoustics, optional
        Air of the room and directivity; the paper's if None.
    exposure : ExposureChoices, optional
        Exposure limits; the default profile without override if None.
    duration : float, optional
        Duration in s; until the context is left if None.
    keep : str or Path, optional
        File for a take of the sensor's samples and the emitted phases.
    notes : dict of str to str, optional
        Notes of the take.
    listen : str, optional
        Address and port, such as ``0.0.0.0:5005``, at which frames of `send_touch` are received.
    key : str or Path, optional
        Key file that both sides share, see `make_key`.
    buffer : float
        Length of the jitter buffer in s.
    permit : PlayLease, optional
        Lease that another program renews and can stop; a lease of its own if None.
    leave : LeaseToken, optional
        Token of that lease's arming; armed here if None.
    priority : int
        Real-time priority, 1 to 99; 0 for none.
    seed : int
        Seed of a virtual sensor.

    Returns
    -------
    LiveSession
        Enter it with ``with``: ``wait(seconds)``, ``statistics``, ``stop()``.

    Raises
    ------
    InputError
        If a value is out of range, or a sensor is too slow for live touch.

    Examples
    --------
    >>> with midair.live("virtual:towel", duration=2.0) as session:
    ...     session.wait()
    ...     print(session.statistics.late)
    """
    if (mapping == "constant-offset") != (offset is not None):
        raise InputError(
            "offset: expected a value in Pa for constant-offset and none for other mappings, got "
            f"{'none' if offset is None else 'one'} for {mapping}; measure it on an earlier recording"
        )
    known = calibration if isinstance(calibration, Calibration | None) else load_calibration(calibration)
    order = LiveSettings(
        sensor=sensor if listen is None else f"listen:{listen}",
        device=device,
        exposure=exposure or default_exposure(),
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


def live_clearance(order: LiveSettings, *, rate: float = RATE) -> ExposureClearance:
    """Check the exposure of live settings without opening a device; `live` checks again with the device.

    Parameters
    ----------
    rate : float
        Frame rate in Hz.

    Raises
    ------
    ExposureError
        If the worst case at this level exceeds the profile without an override.
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
    band: tuple[float, float] = BAND,
    calibration: Calibration | str | Path | None = None,
    wiring: SensorWiring | None = None,
    patience: float = 30.0,
    seed: int = 0,
) -> Generator[FrameSender]:
    """Send a sensor's pressure to a `live` that listens elsewhere: connects on entering; ``run`` sends.

    Parameters
    ----------
    sensor : str
        Sensor name, as in `live`.
    to : str
        Host and port of the playing side, such as ``lab.example:5005``.
    key : str or Path
        Key file that both sides share.
    delay, band, calibration, wiring, seed
        As in `live`.
    patience : float
        Longest time to wait for an answer in s.

    Raises
    ------
    DeviceError
        If there is no answer from a side with the key.
    InputError
        If an address, a key or a setting is invalid.
    """
    known = calibration if isinstance(calibration, Calibration | None) else load_calibration(calibration)
    here = LiveSettings(
        sensor=sensor,
        device="",
        exposure=default_exposure(),
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
    """Split an address such as ``lab.example:5005`` or ``[::1]:5005``; InputError if it is invalid."""
    host, colon, port = text.rpartition(":")
    if not (colon and host and port.isdecimal() and 0 < int(port) < 65536):
        raise InputError(f"{option}: expected HOST:PORT, such as 192.168.1.20:5005, got {text!r}")
    return host.removeprefix("[").removesuffix("]"), int(port)


def _listening(listen: str, key: str | Path | None, buffer: float) -> NetworkInput:
    if key is None:
        raise InputError(
            "--listen: expected --key with the key file that both sides share, got none; make one with --new-key FILE"
        )
    host, port = host_and_port(listen, "--listen")
    return NetworkInput(host=host, port=port, key=read_key(Path(key)), buffer=buffer)
