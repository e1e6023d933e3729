"""In which precision samples are stored: the least that holds every one of them."""

import numpy as np

from midair.reel import Reel


def single(samples: "np.ndarray | Reel") -> "np.ndarray | Reel":
    """Samples as float32 where that holds every one of them; as they are otherwise, and reels always."""
    if isinstance(samples, Reel):
        return samples
    with np.errstate(over="ignore"):
        small = samples.astype(np.float32)
    return small if np.array_equal(small, samples) else samples
