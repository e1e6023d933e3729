"""A thermometer that sends a stream of the Lab Streaming Layer; needs the extra `lsl`."""

import pylsl
from pylsl.util import LostError

from midair.devices.liblsl import inlet_of_numbers
from midair.devices.sensors.thermometer import Thermometer
from midair.errors import DeviceError


class LslThermometer(Thermometer):
    """Kind ``lsl:NAME``: the first channel is the temperature in degrees Celsius, at a regular rate or not."""

    kind = "lsl"
    search = 5.0
    """Longest time to find the stream and to connect to it, in s."""

    def __init__(self, place: str) -> None:
        super().__init__(place)
        self._inlet: pylsl.StreamInlet | None = None
        self._value: float | None = None
        self._stamp = 0.0

    def latest(self) -> tuple[float, float]:
        """The last value that was sent, and its age by the stamp of the sender."""
        inlet = self._inlet = self._inlet or inlet_of_numbers(self.place, self.name, self.search)
        try:
            sample, stamp = inlet.pull_sample(timeout=self.stale if self._value is None else 0.0)
            while sample and stamp is not None:
                self._value, self._stamp = float(sample[0]), stamp
                sample, stamp = inlet.pull_sample(timeout=0.0)
        except LostError as wrong:
            self.close()
            raise DeviceError(f"{self.name}: lost the sender of the stream; start it again") from wrong
        if self._value is None:
            raise DeviceError(f"{self.name}: expected a value within {self.stale:g} s, got none; check the thermometer")
        return self._value, pylsl.local_clock() - self._stamp

    def close(self) -> None:
        """Disconnect from the sender."""
        self._inlet = self._value = None
