"""The virtual rig: a simulated array, a simulated sensor and the simulated skin between them."""

from .virtual_array import VirtualArray as VirtualArray
from .virtual_array import VirtualSensor as VirtualSensor
from .virtual_array import VirtualSkin as VirtualSkin
from .virtual_array import VirtualUnits as VirtualUnits
from .virtual_array import virtual_immediate as virtual_immediate
