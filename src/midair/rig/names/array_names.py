"""Arrays by name: ``autd3:eth0``, ``pyautd3:audit``; the stored calibrations of real arrays."""

import hashlib
import os
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Literal

from midair.devices import ArrayDevice, SilencerChoice, autd3_array, make_state_folder, pyautd3_array, state_folder
from midair.errors import InputError, UnknownDeviceError, did_you_mean
from midair.files import ARRAY_SUFFIX, load_array_calibration, save_array_calibration, write_file
from midair.model import ArrayCalibration, Medium, Placement, PressureFrames, TransducerArray
from midair.physics import mean_reflection, wavenumber
from midair.registry import Registry
from midair.settings import Settings
from midair.validation import check_type

NAMES = (
    "virtual, autd3, autd3-simulator, autd3-server, pyautd3, or one with a place such as autd3:emulator, "
    "autd3:INTERFACE or pyautd3:remote:ADDRESS:PORT"
)

ARRAYS: Registry[Callable[[str, Placement | None, SilencerChoice], ArrayDevice]] = Registry(
    "midair.arrays",
    {
        "autd3": "midair.rig.names.array_names:open_autd3",
        "autd3-simulator": "midair.rig.names.array_names:open_autd3",
        "autd3-server": "midair.rig.names.array_names:open_autd3",
        "pyautd3": "midair.rig.names.array_names:open_pyautd3",
    },
)
"""Functions that make an array, by the part of its name before the colon: name, placement, silencer to device."""


def transducers_of(device: str, placement: Placement | None = None) -> TransducerArray:
    """Transducers of the array that a name stands for; without loading the driver if they are AUTD3 units."""
    if device.partition(":")[0] in ARRAYS.others:
        return array_named(device, placement).array
    return TransducerArray.autd3() if placement is None else placement.array()


def array_named(name: str, placement: Placement | None = None, *, silencer: SilencerChoice = "off") -> ArrayDevice:
    """Make the array that a name stands for, not yet open.

    ``autd3`` searches all network interfaces; ``autd3:INTERFACE`` uses one, or the address of an emulator;
    ``autd3:emulator`` starts one. ``autd3-simulator`` and ``autd3-server``, with ``:PORT`` if not the default, are the
    makers' programs on this computer. ``pyautd3`` and ``pyautd3:INTERFACE`` are for older firmware over EtherCAT,
    ``pyautd3:twincat`` and ``pyautd3:remote:ADDRESS:PORT`` for a server; ``pyautd3:audit`` and ``pyautd3:nop`` have no
    hardware. ``virtual`` is made by `VirtualRig` instead. Other packages add kinds of their own.

    Without a placement the units are two by two. UnknownDeviceError if the name is unknown.
    """
    check_type(name, "device", str)
    if name == "virtual":
        raise UnknownDeviceError("array: expected a real array or an emulator, got virtual, which needs no driver")
    kind, colon, place = name.partition(":")
    if (colon and not place) or kind not in ARRAYS:
        others = "".join(f"{each}:PLACE, " for each in ARRAYS.others)
        near = did_you_mean(name, ARRAYS)
        raise UnknownDeviceError(
            f"array: no array is called {name!r}{near}" if near else f"array: expected {others}{NAMES}, got {name!r}"
        )
    return ARRAYS[kind](name, placement, silencer)


def open_autd3(name: str, placement: Placement | None, silencer: SilencerChoice) -> ArrayDevice:
    """AUTD3 units by the current SDK; ``autd3-simulator`` and ``autd3-server`` are programs of the makers."""
    place = name.removeprefix("autd3").removeprefix("-").removeprefix(":")
    return autd3_array(place or "auto", placement, silencer=silencer)


def open_pyautd3(name: str, placement: Placement | None, silencer: SilencerChoice) -> ArrayDevice:
    """AUTD3 units by the SDK for older firmware."""
    where = name.partition(":")[2]
    if where not in ("audit", "nop", "twincat") and not where.startswith("remote:"):
        # Any other text is the name of a network interface.
        where = f"ethercrab:{where}" if where else "ethercrab"
    return pyautd3_array(where, placement, silencer=silencer)


_WARMER, _MOVED = 1.0, 20e-3
"""Differences of temperature in K and of height in m that are reported."""


@dataclass(frozen=True, slots=True, kw_only=True)
class KeptCalibration:
    """A calibration of an array for which drives are solved."""

    known: ArrayCalibration
    path: Path | None = None
    """Its file, if it has one."""
    checked: str = ""
    """Date and result of the last check; empty if there was none."""
    device: str = ""
    """Array for which it is stored; empty if it is not."""

    def described(self, settings: Settings) -> str:
        """Name, age, what differs from the conditions of the measurement, and the last check, as one line."""
        medium, height, today = settings.acoustics.medium, settings.target.grid.height, datetime.now(UTC).date()
        age = calibration_age(self.known, today=today, medium=medium, height=height)
        name = "" if self.path is None else f"{self.path.name} "
        parts = [f"{name}({self.known.identifier}), {age}", *([f"checked on {self.checked}"] if self.checked else [])]
        if self.device and not self.checked.startswith(today.isoformat()):
            parts.append(f"not checked today: midair calibrate array SENSOR --device {self.device} --check")
        return "; ".join(parts)

    def applied(
        self, array: TransducerArray, settings: Settings, pressure: PressureFrames
    ) -> tuple[TransducerArray, Settings, PressureFrames]:
        """Array, settings and pressure for a solve; the provenance names the calibration.

        Raises MismatchError if it was measured on another array.
        """
        known = self.known
        told = {"id": known.identifier, "date": known.date, "age": self.described(settings)}
        life = pressure.provenance.then("array calibration", told, simulated=known.provenance.simulated)
        k = wavenumber(array, settings.acoustics.medium)
        reflection = mean_reflection(known.reflection, settings.target.height_uncertainty, k)
        solved = replace(known.applied(array), reflection=reflection)
        return solved, settings.measured(known), replace(pressure, provenance=life)


def array_calibration_named(name: str | os.PathLike[str]) -> ArrayCalibration | Literal["none"]:
    """The array calibration in a file; ``none`` stands for itself, the model's transducers."""
    return "none" if str(name) == "none" else load_array_calibration(name)


def array_calibration_for(
    device: str, given: ArrayCalibration | str | os.PathLike[str] | None = None
) -> KeptCalibration | None:
    """The calibration for which drives of an array are solved: by default the stored one of a real array.

    `given` is another one, its file, or ``none``.
    """
    if given is None:
        return kept_array_calibration(device)
    known = given if isinstance(given, ArrayCalibration) else array_calibration_named(given)
    if known == "none":
        return None
    return KeptCalibration(known=known, path=None if isinstance(given, ArrayCalibration) else Path(given))


def measured_transducers(
    device: str, placement: Placement | None = None, given: ArrayCalibration | str | os.PathLike[str] | None = None
) -> TransducerArray:
    """`transducers_of` as they were measured, if there is a calibration; `given` as in `array_calibration_for`."""
    known, array = array_calibration_for(device, given), transducers_of(device, placement)
    return array if known is None else known.known.applied(array)


def keep_array_calibration(device: str, known: ArrayCalibration) -> Path:
    """Use a calibration by default for a real array; InputError if it was simulated."""
    if known.provenance.simulated or device.partition(":")[0] == "virtual":
        raise InputError(f"{device}: expected a calibration of a real array, got a simulated one")
    path = _path(device)
    make_state_folder()
    path.parent.mkdir(mode=0o700, exist_ok=True)
    save_array_calibration(known, path)
    _checked(path).unlink(missing_ok=True)
    return path


def keep_array_check(device: str, result: str) -> None:
    """Store the result of a check, one line, beside the calibration of the array, if it has one."""
    if (path := _path(device)).exists():
        write_file(_checked(path), f"{datetime.now(UTC).date().isoformat()}: {result}\n")


def kept_array_calibration(device: str) -> KeptCalibration | None:
    """The calibration that is used by default for an array; None if there is none, always for the virtual one."""
    path = _path(device)
    if device.partition(":")[0] == "virtual" or not path.exists():
        return None
    said = _checked(path)
    checked = said.read_text(encoding="utf-8").strip() if said.exists() else ""
    return KeptCalibration(known=load_array_calibration(path), path=path, checked=checked, device=device)


def calibration_age(known: ArrayCalibration, *, today: date, medium: Medium, height: float) -> str:
    """Age of a calibration, and what differs from the conditions under which it was measured, as one line."""
    try:
        days = (today - date.fromisoformat(known.date[:10])).days
        parts = [f"{days} days old" if days != 1 else "1 day old"]
    except ValueError:
        parts = ["of unknown age"]
    told = known.provenance.last("measure array")
    then, where = told.get("temperature_c"), told.get("height_m")
    if isinstance(then, int | float) and abs(then - medium.degrees) >= _WARMER:
        parts.append(f"measured at {then:.3g} °C, this air has {medium.degrees:.3g} °C")
    if isinstance(where, int | float) and abs(where - height) >= _MOVED:
        parts.append(f"measured at a height of {1e3 * where:.0f} mm, the palm is at {1e3 * height:.0f} mm")
    return ", ".join(parts)


def _path(device: str) -> Path:
    name = device.partition("?")[0]
    # Different addresses never share a file, whatever their characters.
    digest = hashlib.sha256(name.encode()).hexdigest()[:6]
    return state_folder() / "arrays" / f"{re.sub(r'[^A-Za-z0-9.-]+', '-', name)}-{digest}{ARRAY_SUFFIX}"


def _checked(path: Path) -> Path:
    return path.with_name(path.name.removesuffix(ARRAY_SUFFIX) + ".check.txt")
