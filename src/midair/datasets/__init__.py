"""Data to try things on: seeded synthetic strokes and stimuli, and real samples."""

from midair.datasets.catalogue import SAMPLES, Sample, sample, sample_path, samples
from midair.datasets.stimuli import Stimulus, am_stimulus
from midair.datasets.strokes import Motion, Object, Texture, stroke

__all__ = [
    "Motion",
    "Object",
    "SAMPLES",
    "Sample",
    "Stimulus",
    "Texture",
    "am_stimulus",
    "sample",
    "sample_path",
    "samples",
    "stroke",
]
