"""The command `exposure`: sound levels of a drive at ears and palm."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from midair import devices, files, rig
from midair.cli.console import print_figures
from midair.cli.exposure_options import AirOptions
from midair.cli.options import Force, Json, Placement, quantity
from midair.cli.output import may_write, print_table
from midair.figures import exposure_figure, png_bytes
from midair.model import Drive, Medium, TransducerArray
from midair.physics import MEASURED, UNLIKE, Exposure, ExposureProfile, level_if_unlike
from midair.table import Line, Row
from midair.validation import within


def exposure_command(
    source: Path,
    /,
    *,
    device: str | None = None,
    placement: Placement = None,
    profile: str = files.DEFAULT_PROFILE,
    profiles: Path | None = None,
    ear_protection: Annotated[float, quantity("dB")] = 0.0,
    repeats: int = 1,
    figure: Path | None = None,
    air: AirOptions | None = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Compute the sound levels of a drive at ears and palm, and check them against limits.

    The evidence for the limits is thin; the command prints their source and their evidence.

    Parameters
    ----------
    source
        Drive to check, NAME.drive.h5.
    device
        Array that would play the drive, as in midair play. The transducer strength stored in the drive is ignored.
        [default: the array that the drive was solved for]
    profile
        Name of the exposure profile.
    profiles
        TOML file of exposure profiles. [default: the profiles of midair]
    ear_protection
        Attenuation at 40 kHz of ear protection that everyone in the room wears, as you state it.
    repeats
        How often the drive would be played, for the dose.
    figure
        Write a PNG figure of the levels. [default: NAME.exposure.png]
    air
        Air of the room: levels are the maximum over 2 degrees around it; if not stated, over 14 to 30 degrees. The air
        that the drive was solved for is ignored.
    json
        Print the result as JSON, and draw only if --figure is given.

    Examples
    --------
    $ midair exposure take.drive.h5
    """
    within(repeats, "--repeats", 1)
    target = figure or Path(source.name.removesuffix(".h5").removesuffix(".drive") + ".exposure.png")
    chosen, room = files.profile_named(profile, profiles).behind(ear_protection), (air or AirOptions()).medium()
    drawn = figure is not None or not json
    if drawn:
        may_write(target, force)
    drive = files.load_solution(source, streamed=True).drive
    array = _array_to_play(drive, device, placement)
    found = devices.measure_exposure(drive, array, chosen, repeats=repeats, room=room)
    if drawn:
        files.write_file(target, png_bytes(exposure_figure(found, simulated=drive.provenance.simulated)))
    unlike = "" if json else _unlike_text(replace(drive, array=array), chosen)
    felt = devices.felt_pressure_text(found)
    table: list[Line] = [
        {"profile": found.profile.name, "kept": found.excess <= 0, "excess_db": found.excess},
        ("verdict", found.verdict()),
        ("measured in", found.measured_in),
        {"airs": [_air(each.medium) for each in found.airs], "loudest_air": _air(found.loudest_air)},
        ("for", _array_text(drive, array)),
        {"transducer_pa_m": array.pressure, "file_transducer_pa_m": drive.array.pressure},
        ("resolution", found.resolution),
        Row("felt", not felt, text=felt or f"up to {found.pressure:.3g} Pa on the palm"),
        {"palm_pressure_pa": found.pressure, "duration_s": found.duration},
        ("unlike", unlike),
        ("heat", found.heat),
        {"palm_warming_k_estimate": found.warming, "palm_warming_limit_k": found.profile.warming},
        {"duty": float(found.duty.max(initial=0.0)), "duty_limit": found.profile.duty},
        Row(
            "nonlinearity",
            found.nonlinearity,
            text=f"sigma {found.nonlinearity:.2f}; above 1 the real sound is weaker and more distorted",
        ),
        {"places": {place.name: _place(found, number) for number, place in enumerate(found.profile.places)}},
        Row("limits from", chosen.source, key="source"),
        Row("evidence", chosen.evidence),
        *([] if json else [("figure", str(target))]),
    ]
    if not json:
        print_figures(chosen.title, _columns(found))
    print_table(table, json=json)


def _columns(found: Exposure) -> dict[str, dict[str, tuple[float, str]]]:
    return {
        place.name + ("" if place.enforced else " (advice)"): {
            "limit": (place.limit, "dB"),
            "loudest frame": (float(found.peak[number]), "dB"),
            "mean energy": (float(found.mean[number]), "dB"),
            "same dose over 8 h": (float(found.daily[number]), "dB"),
            "dose": (float(found.dose[number]), "Pa2 s"),
        }
        for number, place in enumerate(found.profile.places)
    }


def _array_to_play(drive: Drive, device: str | None, placement: Path | None) -> TransducerArray:
    """The array that would play: that of the device, or the drive's with the known strength of its transducers."""
    if device is not None:
        return rig.array_named(device, None if placement is None else files.load_placement(placement)).array
    return replace(drive.array, pressure=TransducerArray.autd3().pressure)


def _array_text(drive: Drive, array: TransducerArray) -> str:
    said = f"{array.name}, {array.pressure:.3g} Pa m each"
    if abs(drive.array.pressure / array.pressure - 1) < 1e-6:
        return said
    return f"{said}; the file states {drive.array.pressure:.3g} Pa m, which is ignored"


def _unlike_text(drive: Drive, profile: ExposureProfile) -> str:
    """The sound that adds to the levels if transducers differ, which the exposure check does not contain."""
    spread = UNLIKE if drive.array.alike else MEASURED
    level = max(
        level
        for level, place in zip(level_if_unlike(drive, profile, spread), profile.places, strict=True)
        if place.enforced
    )
    return f"{level:.1f} dB of further sound at the loudest place if transducers differ by {spread:g} rad; not checked"


def _place(found: Exposure, number: int) -> dict[str, object]:
    place = found.profile.places[number]
    return {
        "limit_db": place.limit,
        "enforced": place.enforced,
        "peak_db": float(found.peak[number]),
        "mean_db": float(found.mean[number]),
        "daily_db": float(found.daily[number]),
        "dose_pa2_s": float(found.dose[number]),
        "position_mm": [1e3 * each for each in place.position],
        "loudest_air": _air(found.airs[found.air[found.level[:, number].argmax(), number]].medium),
    }


def _air(medium: Medium) -> dict[str, float]:
    return {
        "temperature_c": round(medium.degrees, 2),
        "speed_m_s": round(medium.speed, 2),
        "attenuation_np_m": round(float(medium.attenuation), 4),
    }
