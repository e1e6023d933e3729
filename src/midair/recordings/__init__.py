"""Edit recordings, fill gaps, check channels, and turn one channel into a pressure field on the sensor."""

from .edit import Fill as Fill
from .edit import GapFill as GapFill
from .edit import Mended as Mended
from .edit import Mending as Mending
from .edit import cut as cut
from .edit import fade as fade
from .edit import gain as gain
from .edit import join as join
from .edit import mask as mask
from .edit import mend as mend
from .edit import resample as resample
from .edit import select as select
from .edit import trim as trim
from .footprint import Footprint as Footprint
from .footprint import Path as Path
from .footprint import Shape as Shape
from .footprint import Turn as Turn
from .footprint import footprint_field as footprint_field
from .quality import at_limit as at_limit
from .quality import dead_channels as dead_channels
from .quality import suspicious as suspicious
from .quality import unreproduced as unreproduced
