"""Frames of pressure as messages that nobody else can read, make, change or repeat.

Every message is a box of libsodium's secretbox (XSalsa20 and Poly1305, through PyNaCl) with a key that both sides
share: what does not open was not made by one who has it. Whoever plays answers a greeting with a number that it has
just drawn, and every frame carries it: a run that somebody recorded is none of this one. Within a run each frame has
a number of its own, which counts once.
"""

import json
import secrets
import struct
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError, MissingExtraError, MissingFileError
from midair.model import SensorGrid

Array = NDArray[np.float64]

HELLO, WELCOME, FRAME, END = b"H", b"W", b"F", b"E"
"""Kinds of messages: who begins says what it is; who plays answers with its number; then frames; and the end."""

NUMBER = 16
"""Bytes of the number that one side draws."""

_HEAD = struct.Struct("<QdH")


def make_key(path: Path) -> None:
    """Write a new key, for this user only; the other side needs the same file.

    Raises
    ------
    InputError
        If the file is there already.
    """
    import os

    try:
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except FileExistsError:
        raise InputError(f"{path}: is there already; give another name for a new key") from None
    with os.fdopen(handle, "w", encoding="ascii") as file:
        file.write(secrets.token_hex(32) + "\n")


def read_key(path: Path) -> bytes:
    """The key of a file.

    Raises
    ------
    MissingFileError, InputError
        If there is none.
    """
    try:
        text = path.read_text(encoding="ascii", errors="replace").strip()
    except OSError as wrong:
        raise MissingFileError(
            f"{path}: expected a key, got {wrong.strerror}; midair live --new-key makes one"
        ) from wrong
    if len(text) != 64 or not set(text) <= set("0123456789abcdef"):
        raise InputError(f"{path}: expected a key of 64 hexadecimal digits, got other text; --new-key makes one")
    return bytes.fromhex(text)


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionOffer:
    """What the side that feels says of itself.

    Attributes
    ----------
    rows, columns : int
        Of the cells.
    pitch : float
        Between them, in m.
    name : str
        Of the sensor.
    rate : float
        Frames per second, in Hz.
    delay : float
        Of its filter, in s.
    simulated : bool
        Whether it is not real.
    """

    rows: int
    columns: int
    pitch: float
    name: str
    rate: float
    delay: float
    simulated: bool

    @property
    def grid(self) -> SensorGrid:
        """Its cells."""
        return SensorGrid(rows=self.rows, columns=self.columns, pitch=self.pitch, name=self.name)

    def message(self) -> bytes:
        """As bytes."""
        return json.dumps(asdict(self)).encode()

    @classmethod
    def of(cls, message: bytes) -> "SessionOffer":
        """From bytes of one who has the key, but perhaps another version.

        Raises
        ------
        InputError
            If they are none, or of a sensor that cannot be.
        """
        try:
            said: dict[str, Any] = json.loads(message)
            made = cls(**said)
            possible = 1 <= made.rows * made.columns <= 64 and 1 <= made.rate <= 4000 and 0 < made.pitch < 1
            if not (possible and 0 <= made.delay < 1 and made.grid.count):
                raise ValueError
        except (ValueError, TypeError) as wrong:
            raise InputError("live: expected a greeting of this midair, got another; use the same version") from wrong
        return made


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReceivedFrame:
    """A frame as it came.

    Attributes
    ----------
    number : int
        Counted from 0.
    taken : float
        When it was taken, in s of the sender's clock.
    pressure : ndarray, shape (channel,)
        In Pa.
    """

    number: int
    taken: float
    pressure: Array


class FrameCipher:
    """Closes and opens messages with a key.

    Parameters
    ----------
    key : bytes
        32 of them.
    """

    def __init__(self, key: bytes) -> None:
        try:
            from nacl.exceptions import CryptoError
            from nacl.secret import SecretBox
        except ImportError as wrong:
            raise MissingExtraError('network: expected the package pynacl; pip install "midair[network]"') from wrong
        self._box, self._broken = SecretBox(key), CryptoError

    def close(self, kind: bytes, message: bytes) -> bytes:
        """A message as it travels; the nonce is drawn anew each time."""
        return bytes(self._box.encrypt(kind + message))

    def open(self, box: bytes) -> tuple[bytes, bytes] | None:
        """Kind and message; None of what was not closed with this key, or was changed on the way."""
        try:
            opened = self._box.decrypt(box)
        except (self._broken, ValueError):
            return None
        return opened[:1], opened[1:]


def frame_message(number: int, taken: float, pressure: Array, drawn: bytes) -> bytes:
    """A frame as bytes: number, time, channels, the other side's number, then pressure in single precision."""
    return _HEAD.pack(number, taken, len(pressure)) + drawn + pressure.astype("<f4").tobytes()


def frame_from(message: bytes, channels: int, drawn: bytes) -> ReceivedFrame | None:
    """A frame of this run, or None."""
    if len(message) != _HEAD.size + NUMBER + 4 * channels:
        return None
    number, taken, count = _HEAD.unpack_from(message)
    if count != channels or not secrets.compare_digest(message[_HEAD.size : _HEAD.size + NUMBER], drawn):
        return None
    pressure = np.frombuffer(message, "<f4", offset=_HEAD.size + NUMBER).astype(np.float64)
    if not (np.isfinite(pressure).all() and np.isfinite(taken)):
        return None
    return ReceivedFrame(number=number, taken=taken, pressure=pressure)


class ReplayFilter:
    """Which numbers came already: each counts once, and one far behind the newest not at all.

    Parameters
    ----------
    reach : int
        How far behind one may be.
    """

    def __init__(self, reach: int = 1024) -> None:
        self._reach, self._newest = reach, -1
        self._seen = np.full(reach, -1, np.int64)

    def first(self, number: int) -> bool:
        """Whether it comes for the first time."""
        if number <= self._newest - self._reach or self._seen[number % self._reach] == number:
            return False
        self._seen[number % self._reach] = number
        self._newest = max(self._newest, number)
        return True
