"""Data to try things on: seeded synthetic strokes and stimuli."""

from midair.datasets.strokes import Motion, Object, Stimulus, Texture, am_stimulus, stroke

__all__ = ["Motion", "Object", "Stimulus", "Texture", "am_stimulus", "stroke"]
