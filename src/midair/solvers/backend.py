"""The array library and device of the batch solvers: NumPy, or another library of the array API standard.

The standard (data-apis.org/array-api) defines functions that NumPy, PyTorch, CuPy and others share. NumPy supports it
directly, the others through array-api-compat, so that the solver is written once.
"""

import ctypes
from collections.abc import Generator, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cache
from importlib import import_module
from importlib.machinery import EXTENSION_SUFFIXES
from typing import Any, Literal, TypeVar

import numpy as np
import scipy
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import InputError, MissingExtraError

Rows = Any
"""Array of the backend, shape (row, unknown), real or complex, single or double precision."""
Numbers = Any
"""Real array of the backend, shape (row,)."""

LIBRARIES = {
    "numpy": "numpy",
    "torch": "array_api_compat.torch",
    "cupy": "array_api_compat.cupy",
    "strict": "array_api_strict",
}
"""Module that implements the standard for each backend. "strict" is the standard's own checker."""

EXTRAS = {"torch": "gpu-torch", "cupy": "gpu-cupy", "strict": "test"}
"""Extra of midair that installs each library."""


def squares(xp: Any, a: Rows) -> Numbers:
    """The sum of the squares of each row of a real array, shape (row,)."""
    # Libraries other than NumPy compute vecdot as a batched product of single rows, slow on a GPU; a norm is one pass.
    return xp.vecdot(a, a) if xp is np else xp.linalg.vector_norm(a, axis=1) ** 2


T = TypeVar("T")


def taken(xp: Any, rows: T, index: Numbers) -> T:
    """The rows with these indices of an array, or of each array of a dataclass."""
    whole: Any = rows
    if not is_dataclass(rows):
        return xp.take(whole, index, axis=0)
    parts = {one.name: getattr(rows, one.name) for one in fields(rows)}
    return replace(
        whole, **{name: xp.take(each, index, axis=0) for name, each in parts.items() if hasattr(each, "dtype")}
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Backend:
    """An array library, a device, and a precision."""

    xp: Any  # Module with the functions of the standard
    device: Any = None  # Device as `xp` names it; None for its default
    single: bool = True  # float32 and complex64 instead of float64 and complex128

    @property
    def on_gpu(self) -> bool:
        """Whether the arrays are on a GPU."""
        return "cuda" in str(self.device) or "cupy" in self.xp.__name__

    @property
    def rows(self) -> int:
        """Suitable batch size: limited by the cache of a CPU; on a GPU large enough that launch times do not matter."""
        return 32768 if self.on_gpu else 128

    def batches(self, rows: NDArray[np.int64], size: int | None = None) -> Iterator[NDArray[np.int64]]:
        """The rows in batches of this size, or of a suitable one."""
        size = size or self.rows
        for first in range(0, len(rows), size):
            yield rows[first : first + size]

    def put(self, array: NDArray[Any]) -> Rows:
        """Copy a NumPy array to the device in this precision; integers keep their type."""
        kinds = {"f": np.float32, "c": np.complex64} if self.single else {"f": np.float64, "c": np.complex128}
        copy = np.array(array, kinds.get(array.dtype.kind), order="C")
        return copy if self.xp is np else self.xp.asarray(copy, device=self.device)

    def get(self, array: Rows) -> Array:
        """Copy an array to NumPy in double precision."""
        return np.asarray(self.host(array), np.float64)

    def host(self, array: Rows) -> NDArray[Any]:
        """Copy an array to NumPy in its own precision."""
        # PyTorch copies to the host with `cpu`, CuPy with `get`; the standard has no function for it.
        return np.asarray(array.cpu() if hasattr(array, "cpu") else array.get() if hasattr(array, "get") else array)

    def complex(self, real: Rows, imaginary: Rows) -> Rows:
        """The complex numbers real + j imaginary."""
        if self.xp is np:
            made = np.empty(real.shape, np.result_type(real, np.complex64))
            made.real, made.imag = real, imaginary
            return made
        if hasattr(self.xp, "complex"):
            return self.xp.complex(real, imaginary)
        kind = self.xp.complex64 if self.single else self.xp.complex128
        return self.xp.astype(real, kind) + 1j * self.xp.astype(imaginary, kind)

    def phasor(self, theta: Rows) -> Rows:
        """The numbers exp(j theta)."""
        if self.xp is np:
            # Real and imaginary part separately: a complex exponential is ten times as slow.
            q: Any = np.empty(theta.shape, np.result_type(theta, np.complex64))
            np.cos(theta, out=q.real)
            np.sin(theta, out=q.imag)
            return q
        if hasattr(self.xp, "polar"):
            return self.xp.polar(self.xp.ones((), dtype=theta.dtype, device=theta.device), theta)
        return self.complex(self.xp.cos(theta), self.xp.sin(theta))

    def angle(self, q: Rows) -> Rows:
        """The angles of q in rad."""
        return self.xp.atan2(self.xp.imag(q), self.xp.real(q))

    def unit(self, q: Rows) -> Rows:
        """The numbers q / |q|; 1 where q is 0."""
        if hasattr(self.xp, "sgn"):
            # One pass in PyTorch; the added number only matters where q is 0.
            return self.xp.sgn(q + self.xp.finfo(q.dtype).smallest_normal)
        size = self.xp.abs(q)
        nonzero = size > 0
        one = self.xp.ones_like(q)
        return self.xp.where(nonzero, q / self.xp.where(nonzero, size, self.xp.ones_like(size)), one)

    def as_real(self, z: Rows) -> Rows:
        """Complex rows as real rows of twice the length; `as_complex` is the inverse."""
        if self.xp is np:
            return z.view(np.float32 if self.single else np.float64)
        if hasattr(self.xp, "view_as_real"):
            return self.xp.reshape(self.xp.view_as_real(z), (z.shape[0], -1))
        return self.xp.concat([self.xp.real(z), self.xp.imag(z)], axis=1)

    def as_complex(self, x: Rows) -> Rows:
        """Complex rows from the result of `as_real`."""
        if self.xp is np:
            return x.view(np.complex64 if self.single else np.complex128)
        if hasattr(self.xp, "view_as_complex"):
            return self.xp.view_as_complex(self.xp.reshape(x, (x.shape[0], -1, 2)))
        half = x.shape[1] // 2
        return self.complex(x[:, :half], x[:, half:])

    def adjoint(self, matrix: Rows) -> Rows:
        """The conjugate transpose, contiguous in memory."""
        turned = self.xp.conj(matrix.T)
        return np.ascontiguousarray(turned) if self.xp is np else turned

    @contextmanager
    def at_work(self) -> Generator[None]:
        """Limit PyTorch to one CPU thread, as `one_blas_thread` does for BLAS, and silence NumPy's overflow warnings.

        A step that overflows is rejected by the solver.
        """
        before = self.xp.get_num_threads() if hasattr(self.xp, "get_num_threads") else None
        try:
            if before is not None:
                self.xp.set_num_threads(1)
            with np.errstate(over="ignore", invalid="ignore"):
                yield
        finally:
            if before is not None:
                self.xp.set_num_threads(before)


@contextmanager
def one_blas_thread() -> Generator[None]:
    """Limit matrix products of this process to one thread within the context.

    The matrices have a few hundred rows. With two BLAS threads the method of the paper takes three to ten times as
    long, because the threads wait for each other. Several processes use more cores better.
    """
    from threadpoolctl import threadpool_limits

    # Only a loaded BLAS can be limited, and Numba loads SciPy's later.
    _load_scipy_blas()
    with threadpool_limits(limits=1, user_api="blas"):
        yield


@cache
def _load_scipy_blas() -> None:
    """Load the library without importing scipy.linalg, which takes .1 s."""
    for suffix in EXTENSION_SUFFIXES:
        with suppress(OSError):
            ctypes.CDLL(f"{scipy.__path__[0]}/linalg/cython_blas{suffix}")
            return
    # Installed in another way, such as in place from its sources.
    import_module("scipy.linalg.cython_blas")


def backend(name: str, *, precision: Literal["single", "double"] = "single") -> Backend:
    """The backend of this name.

    `name` is a key of `LIBRARIES`, for PyTorch optionally with a device: "numpy", "torch", "torch:cuda",
    "torch:cuda:1", "cupy". Raises InputError for an unknown backend or device, MissingExtraError if the library is not
    installed.
    """
    library, _, device = name.partition(":")
    if library not in LIBRARIES:
        raise InputError(f"backend: expected one of {', '.join(LIBRARIES)}, or torch:DEVICE, got {name!r}")
    if device and library != "torch":
        raise InputError(f"backend: expected a device with torch only, such as torch:cuda, got {name!r}")
    xp = _module(library)
    if device:
        _try(xp, name, device)
    return Backend(xp=xp, device=device or None, single=precision == "single")


@cache
def _module(library: str) -> Any:
    try:
        return import_module(LIBRARIES[library])
    except ImportError as missing:
        advice = f"pip install 'midair[{EXTRAS[library]}]'"
        raise MissingExtraError(f"the {library} backend needs {missing.name or library}: {advice}") from missing


def _try(xp: Any, name: str, device: str) -> None:
    """Raise InputError if PyTorch cannot create an array on the device."""
    try:
        xp.zeros(1, device=device)
    # PyTorch without CUDA raises AssertionError, PyTorch with CUDA but without this device RuntimeError.
    except (RuntimeError, AssertionError) as missing:
        reason = str(missing).partition("\n")[0]
        raise InputError(f"backend: expected an available device, got {name!r} ({reason}); try torch") from missing
