"""Example data: synthetic strokes and stimuli with seeds, and real recordings."""

from midair.datasets.catalogue import SAMPLES, Sample, sample, sample_path, samples, with_credits
from midair.datasets.patterns import binary_patterns, channel_amplitudes
from midair.datasets.stimuli import Probe, Stimulus, am_stimulus, probe_signal
from midair.datasets.strokes import Motion, Object, Texture, stroke
from midair.datasets.tap_sequence import taps

__all__ = [
    "Motion",
    "Object",
    "Probe",
    "SAMPLES",
    "Sample",
    "Stimulus",
    "Texture",
    "am_stimulus",
    "binary_patterns",
    "channel_amplitudes",
    "with_credits",
    "probe_signal",
    "sample",
    "sample_path",
    "samples",
    "stroke",
    "taps",
]
