"""Data to try things on: seeded synthetic strokes and stimuli, and real samples."""

from midair.datasets.catalogue import SAMPLES, Sample, sample, sample_path, samples
from midair.datasets.stimuli import Probe, Stimulus, am_stimulus, probe_signal
from midair.datasets.strokes import Motion, Object, Texture, stroke
from midair.datasets.taps import taps

__all__ = [
    "Motion",
    "Object",
    "Probe",
    "SAMPLES",
    "Sample",
    "Stimulus",
    "Texture",
    "am_stimulus",
    "probe_signal",
    "sample",
    "sample_path",
    "samples",
    "stroke",
    "taps",
]
