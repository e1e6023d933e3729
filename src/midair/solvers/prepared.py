"""Modes of G and drives by kinds, kept for the next problem with the same G in memory, and in a store if there is one.

A key is a hash of everything that the arrays depend on, so nothing that is kept can be out of date.
"""

import hashlib
from collections import OrderedDict
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
    """Arrays by key, on a disk."""

    def read(self, key: str) -> Arrays | None:
        """The arrays; None if there are none, or they are damaged."""
        ...

    def write(self, key: str, arrays: Arrays) -> None:
        """Keep arrays; a failure is ignored."""
        ...


class _Kept:
    """What this process has made, the last used one at the end, and the store of all processes."""

    def __init__(self) -> None:
        self.arrays: OrderedDict[str, Arrays] = OrderedDict()
        self.lock = Lock()
        self.store: ArrayStore | None = None


_KEPT = _Kept()


def keep_modes_in(store: ArrayStore | None) -> None:
    """Also keep arrays in a store from now on; None keeps them in memory alone."""
    _KEPT.store = store


def prepared(inputs: tuple[Any, ...], make: Callable[[], Arrays]) -> Arrays:
    """What `make` returns, or what it returned for the same inputs: arrays, numbers, booleans or None."""
    key = _key(inputs)
    with _KEPT.lock:
        if key in _KEPT.arrays:
            _KEPT.arrays.move_to_end(key)
            return _KEPT.arrays[key]
    store = _KEPT.store
    found = None if store is None else store.read(key)
    made = make() if found is None else found
    if sum(each.nbytes for each in made.values()) <= _LARGEST:
        with _KEPT.lock:
            _KEPT.arrays[key] = made
            while len(_KEPT.arrays) > _COUNT:
                _KEPT.arrays.popitem(last=False)
        if found is None and store is not None:
            store.write(key, made)
    return made


def _key(inputs: tuple[Any, ...]) -> str:
    digest = hashlib.sha256(f"{_VERSION} {np.__version__}".encode())
    for each in inputs:
        if isinstance(each, np.ndarray):
            digest.update(f"{each.dtype} {each.shape}".encode())
            digest.update(np.ascontiguousarray(each).data)
        else:
            digest.update(repr(each).encode())
    return digest.hexdigest()
