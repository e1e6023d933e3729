"""Temperatures on the command line that a thermometer measures, and the check of its drift while an array plays."""

from contextlib import AbstractContextManager

from midair.cli.console import print_note
from midair.devices import Thermometer
from midair.model import Medium
from midair.rig import thermometer_named, watch_air


class MeasuredTemperature(float):
    """A temperature in degrees Celsius, with the thermometer that measured it."""

    thermometer: Thermometer

    @classmethod
    def read(cls, name: str) -> "MeasuredTemperature":
        """Read the thermometer of a name, and print the temperature on stderr."""
        thermometer = thermometer_named(name)
        made = cls(round(thermometer.read(), 2))
        made.thermometer = thermometer
        print_note(f"air: {name} measures {made:g} °C")
        return made


def air_watched(
    temperature: float | None, solved: Medium, *, advice: str, device: str = ""
) -> AbstractContextManager[None]:
    """While inside, a warning is printed if the thermometer drifts; nothing happens for a typed temperature."""
    thermometer = temperature.thermometer if isinstance(temperature, MeasuredTemperature) else None
    return watch_air(thermometer, solved, lambda line: print_note(line, warn=True), advice=advice, device=device)
