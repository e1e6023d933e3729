"""Example data: synthetic strokes and stimuli with seeds, real recordings, and a gallery of touches."""

from typing import TYPE_CHECKING

from midair.lazy import lazy_names

if TYPE_CHECKING:
    from .gallery import PICTURES as PICTURES
    from .gallery import TOUCHES as TOUCHES
    from .stimuli import am_stimulus as am_stimulus
    from .stimuli import binary_patterns as binary_patterns
    from .stimuli import channel_amplitudes as channel_amplitudes
    from .stimuli import probe_signal as probe_signal
    from .stimuli import taps as taps
    from .strokes import SAMPLES as SAMPLES
    from .strokes import STORED as STORED
    from .strokes import Motion as Motion
    from .strokes import Object as Object
    from .strokes import Sample as Sample
    from .strokes import sample as sample
    from .strokes import sample_path as sample_path
    from .strokes import stroke as stroke
    from .strokes import with_credits as with_credits

__getattr__, __dir__ = lazy_names(__name__)
