"""Phases of complex drives and of silent frames."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Complex = NDArray[np.complexfloating[Any, Any]]


def unit(q: Complex) -> Complex:
    """The numbers q / |q|, of magnitude 1; 1 where q is 0."""
    size = np.abs(q)
    return np.where(size > 0, q / np.where(size > 0, size, 1), 1).astype(q.dtype)


def rippled(q: Complex) -> Complex:
    """The phases of q (transducer,) plus a ripple of .3 rad: a drive in phase with one mode would stay so."""
    return (unit(q) * np.exp(0.3j * np.sin(2.4 * np.arange(len(q))))).astype(q.dtype)


def hold(
    phase: NDArray[np.float64], audible: NDArray[np.int64], before: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """Phases in which silent frames repeat the last audible frame; `before`, or zero, before the first."""
    if len(audible) == len(phase):
        return phase
    last = np.full(len(phase), -1)
    last[audible] = audible
    last = np.maximum.accumulate(last)
    return np.where(last[:, None] >= 0, phase[last], 0.0 if before is None else before)
