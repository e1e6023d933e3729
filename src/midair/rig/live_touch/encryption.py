"""Authenticated encryption of pressure frames for the network.

Every message is a secretbox of libsodium (XSalsa20 and Poly1305, through PyNaCl) with a key that both sides share, so
that a message that fails authentication was not made by an owner of the key. The playing side answers a greeting with a
random number, and every frame carries it, so that a recorded run cannot be replayed. Within a run each frame number is
accepted once.
"""

import json
import secrets
import struct
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from midair.array_types import Array
from midair.errors import InputError, MissingExtraError, MissingFileError
from midair.model import SensorGrid

HELLO, WELCOME, FRAME, END = b"H", b"W", b"F", b"E"
"""Message types: greeting of the sensor side, answer of the playing side with its random number, frame, end."""

NUMBER = 16
"""Length of the random number in bytes."""

_HEAD = struct.Struct("<QdH")


def make_key(path: Path) -> None:
    """Write a new key file, readable by this user only; InputError if the file exists. The other side needs a copy."""
    import os

    try:
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except FileExistsError:
        raise InputError(f"{path}: is there already; give another name for a new key") from None
    with os.fdopen(handle, "w", encoding="ascii") as file:
        file.write(secrets.token_hex(32) + "\n")


def read_key(path: Path) -> bytes:
    """Read a key file; MissingFileError or InputError if there is none or it holds no key."""
    try:
        text = path.read_text(encoding="ascii", errors="replace").strip()
    except OSError as wrong:
        raise MissingFileError(
            f"{path}: expected a key, got {wrong.strerror}; make one with midair live --new-key"
        ) from wrong
    if len(text) != 64 or not set(text) <= set("0123456789abcdef"):
        raise InputError(
            f"{path}: expected a key of 64 hexadecimal digits, got other text; make one with midair live --new-key"
        )
    return bytes.fromhex(text)


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionOffer:
    """Description of the sensor side, sent in the greeting."""

    rows: int
    columns: int
    pitch: float
    """Cell pitch in m."""
    name: str
    rate: float
    """Frame rate in Hz."""
    delay: float
    """Delay of the sensor side's filter in s."""
    simulated: bool

    @property
    def grid(self) -> SensorGrid:
        """Cells of the sensor."""
        return SensorGrid(rows=self.rows, columns=self.columns, pitch=self.pitch, name=self.name)

    def message(self) -> bytes:
        """Encode as bytes."""
        return json.dumps(asdict(self)).encode()

    @classmethod
    def of(cls, message: bytes) -> "SessionOffer":
        """Decode a message; InputError if it is from another version or describes an impossible sensor."""
        try:
            said: dict[str, Any] = json.loads(message)
            made = cls(**said)
            possible = 1 <= made.rows * made.columns <= 64 and 1 <= made.rate <= 4000 and 0 < made.pitch < 1
            if not (possible and 0 <= made.delay < 1 and made.grid.count):
                raise ValueError
        except (ValueError, TypeError) as wrong:
            raise InputError(
                "live: expected a greeting of this midair version, got another; use the same version"
            ) from wrong
        return made


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReceivedFrame:
    """A received frame."""

    number: int
    """Frame number, from 0."""
    taken: float
    """Sampling time in s of the sender's clock."""
    pressure: Array
    """Pressure in Pa, shape (channel,)."""


class FrameCipher:
    """Encrypts and decrypts messages with a key of 32 bytes."""

    def __init__(self, key: bytes) -> None:
        try:
            from nacl.exceptions import CryptoError
            from nacl.secret import SecretBox
        except ImportError as wrong:
            raise MissingExtraError(
                'network: expected the package pynacl, which is not installed; pip install "midair[network]"'
            ) from wrong
        self._box, self._broken = SecretBox(key), CryptoError

    def close(self, kind: bytes, message: bytes) -> bytes:
        """Encrypt a message with a new random nonce."""
        return bytes(self._box.encrypt(kind + message))

    def open(self, box: bytes) -> tuple[bytes, bytes] | None:
        """Decrypt a message into type and content; None if authentication fails."""
        try:
            opened = self._box.decrypt(box)
        except (self._broken, ValueError):
            return None
        return opened[:1], opened[1:]


def frame_message(number: int, taken: float, pressure: Array, drawn: bytes) -> bytes:
    """Encode a frame: number, time, channels, the other side's random number, then pressure in single precision."""
    return _HEAD.pack(number, taken, len(pressure)) + drawn + pressure.astype("<f4").tobytes()


def run_of(message: bytes) -> bytes:
    """Random number of the run that an encoded frame states."""
    return message[_HEAD.size : _HEAD.size + NUMBER]


def frame_from(message: bytes, channels: int, drawn: bytes) -> ReceivedFrame | None:
    """Decode a frame; None if it does not belong to this run."""
    if len(message) != _HEAD.size + NUMBER + 4 * channels:
        return None
    number, taken, count = _HEAD.unpack_from(message)
    if count != channels or not secrets.compare_digest(run_of(message), drawn):
        return None
    pressure = np.frombuffer(message, "<f4", offset=_HEAD.size + NUMBER).astype(np.float64)
    if not (np.isfinite(pressure).all() and np.isfinite(taken)):
        return None
    return ReceivedFrame(number=number, taken=taken, pressure=pressure)


class ReplayFilter:
    """Accepts each frame number once, and none more than `reach` behind the newest."""

    def __init__(self, reach: int = 1024) -> None:
        self._reach, self._newest = reach, -1
        self._seen = np.full(reach, -1, np.int64)

    def first(self, number: int) -> bool:
        """Whether a number is new."""
        if number <= self._newest - self._reach or self._seen[number % self._reach] == number:
            return False
        self._seen[number % self._reach] = number
        self._newest = max(self._newest, number)
        return True
