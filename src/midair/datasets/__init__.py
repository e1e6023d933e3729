"""Example data: synthetic strokes and stimuli with seeds, and real recordings."""

from .catalogue import SAMPLES as SAMPLES
from .catalogue import Sample as Sample
from .catalogue import sample as sample
from .catalogue import sample_path as sample_path
from .catalogue import samples as samples
from .catalogue import with_credits as with_credits
from .stimuli import Probe as Probe
from .stimuli import Stimulus as Stimulus
from .stimuli import am_stimulus as am_stimulus
from .stimuli import binary_patterns as binary_patterns
from .stimuli import channel_amplitudes as channel_amplitudes
from .stimuli import probe_signal as probe_signal
from .stimuli import taps as taps
from .strokes import Motion as Motion
from .strokes import Object as Object
from .strokes import Texture as Texture
from .strokes import stroke as stroke
