"""Arrays that are kept for the next problem with the same G: in memory, and in a store if there is one.

A key is a hash of everything that the arrays depend on, so nothing that is kept can be out of date.
"""

import hashlib
from collections.abc import Callable
from threading import Lock
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Arrays = dict[str, NDArray[Any]]

_VERSION = 1
"""Raise it with every change of the arrays that are made from the same matrix."""

_LARGEST, _COUNT = 64e6, 3
"""Bytes above which arrays are not kept, and how many of the others stay in memory."""


class ArrayStore(Protocol):
    """Arrays by key, on a disk; a failure to write is ignored, and damaged arrays are none."""

    def read(self, key: str) -> Arrays | None: ...  # noqa: D102
    def write(self, key: str, arrays: Arrays) -> None: ...  # noqa: D102


_kept: dict[str, Arrays] = {}  # The last used one at the end
_stores: list[ArrayStore] = []
_lock = Lock()


def keep_modes_in(store: ArrayStore) -> None:
    """Also keep arrays in a store from now on."""
    _stores[:] = [store]


def prepared(inputs: tuple[Any, ...], make: Callable[[], Arrays]) -> Arrays:
    """What `make` returns, or what it returned for the same inputs: arrays, numbers or None."""
    digest = hashlib.sha256(f"{_VERSION} {np.__version__}".encode())
    for each in inputs:
        array = isinstance(each, np.ndarray)
        digest.update(f"{each.dtype} {each.shape}".encode() if array else repr(each).encode())
        digest.update(np.ascontiguousarray(each).data if array else b"")
    key = digest.hexdigest()
    with _lock:
        found = _kept.pop(key, None)
    stored = found or next((each for store in _stores if (each := store.read(key))), None)
    made = stored or make()
    if sum(each.nbytes for each in made.values()) <= _LARGEST:
        for store in _stores if stored is None else []:
            store.write(key, made)
        with _lock:
            _kept[key] = made
            while len(_kept) > _COUNT:
                del _kept[next(iter(_kept))]
    return made
