import stat
import sys

import numpy as np
import pytest
from nacl.secret import SecretBox

from midair.errors import InputError, MissingFileError
from midair.rig.live_touch.encryption import (
    FRAME,
    NUMBER,
    FrameCipher,
    ReplayFilter,
    SessionOffer,
    frame_from,
    frame_message,
    make_key,
    read_key,
)

KEY, OTHER = bytes(range(32)), bytes(32)
DRAWN = b"d" * NUMBER
PRESSURE = np.linspace(-30, 30, 16)
GREETING = SessionOffer(rows=4, columns=4, pitch=0.011, name="skin", rate=1000.0, delay=0.006, simulated=True)


def test_a_key_is_for_this_user_only_and_comes_back(tmp_path):
    make_key(tmp_path / "touch.key")
    assert len(read_key(tmp_path / "touch.key")) == 32
    if sys.platform != "win32":
        assert stat.S_IMODE((tmp_path / "touch.key").stat().st_mode) == 0o600
    with pytest.raises(InputError, match="is there already"):
        make_key(tmp_path / "touch.key")
    make_key(tmp_path / "other.key")
    assert read_key(tmp_path / "touch.key") != read_key(tmp_path / "other.key")


def test_an_invalid_key_is_refused_in_one_line(tmp_path):
    with pytest.raises(MissingFileError, match="--new-key"):
        read_key(tmp_path / "touch.key")
    (tmp_path / "touch.key").write_text("secret\n")
    with pytest.raises(InputError, match="64 hexadecimal digits"):
        read_key(tmp_path / "touch.key")


def test_a_message_is_a_secretbox_of_libsodium_and_opens_with_its_key_alone():
    box = FrameCipher(KEY).close(FRAME, b"something")
    assert SecretBox(KEY).decrypt(box) == FRAME + b"something"
    assert FrameCipher(KEY).open(box) == (FRAME, b"something")
    assert b"something" not in box
    assert FrameCipher(OTHER).open(box) is None
    assert FrameCipher(KEY).close(FRAME, b"something") != box, "a nonce of its own"


def test_a_message_that_was_changed_or_cut_or_is_none_does_not_open():
    seal, rng = FrameCipher(KEY), np.random.default_rng(1)
    box = seal.close(FRAME, frame_message(3, 1.5, PRESSURE, DRAWN))
    for place in range(len(box)):
        changed = bytearray(box)
        changed[place] ^= 1
        assert seal.open(bytes(changed)) is None
        assert seal.open(box[:place]) is None
    for _ in range(100):
        assert seal.open(rng.bytes(int(rng.integers(0, 300)))) is None


def test_a_frame_comes_back_in_single_precision():
    sealed = frame_from(frame_message(7, 12.25, PRESSURE, DRAWN), 16, DRAWN)
    assert (sealed.number, sealed.taken) == (7, 12.25)
    assert np.array_equal(sealed.pressure, PRESSURE.astype(np.float32))


def test_invalid_frames_decode_to_none():
    message = frame_message(7, 12.25, PRESSURE, DRAWN)
    assert frame_from(message, 16, b"e" * NUMBER) is None
    assert frame_from(message, 9, DRAWN) is None
    assert frame_from(message[:-1], 16, DRAWN) is None
    assert frame_from(frame_message(7, 12.25, np.full(16, np.nan), DRAWN), 16, DRAWN) is None


def test_a_greeting_comes_back_and_one_that_cannot_be_is_refused():
    assert SessionOffer.of(GREETING.message()) == GREETING
    for wrong in (b"", b"[]", b"{}", GREETING.message().replace(b"1000.0", b"1e9"), b'{"rows": -1}'):
        with pytest.raises(InputError, match="greeting"):
            SessionOffer.of(wrong)


def test_each_number_counts_once_however_they_come():
    once, rng = ReplayFilter(reach=64), np.random.default_rng(2)
    near = np.arange(1000) + rng.integers(0, 20, 1000)
    order = np.argsort(near, kind="stable")
    assert all(once.first(int(number)) for number in order)
    assert not any(once.first(int(number)) for number in order)
    assert not once.first(5), "far behind the newest"
    assert once.first(5000)
    assert not once.first(999)
