"""The command `exposure`: sound levels of a drive at ears and palm."""

from dataclasses import replace
from pathlib import Path

from midair import devices, files, rig
from midair.cli.console import print_answer, print_grid
from midair.cli.exposure_options import AirOptions, ProfileOptions
from midair.cli.options import Force, Json, Placement
from midair.cli.output import may_write, print_table
from midair.figures import exposure_figure, png_bytes
from midair.model import Drive, Medium, TransducerArray
from midair.physics import MEASURED, UNLIKE, Exposure, ExposureProfile, level_if_unlike
from midair.table import Details, Line, Row
from midair.validation import within


def exposure_command(
    source: Path,
    /,
    *,
    device: str | None = None,
    placement: Placement = None,
    options: ProfileOptions | None = None,
    repeats: int = 1,
    figure: Path | None = None,
    air: AirOptions | None = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Compute the sound levels of a drive at ears and palm, and check them against limits.

    The evidence for the limits is thin; --all prints their source and their evidence.
    Levels are the maximum over 2 degrees around the stated air; if not stated, over 14 to 30 degrees.

    Parameters
    ----------
    source
        Drive to check, NAME.drive.h5.
    device
        Array that would play the drive, as in midair play. The transducer strength stored in the drive is ignored.
        [default: the array that the drive was solved for]
    repeats
        How often the drive would be played, for the dose.
    figure
        Write a figure of the levels, NAME.png.

    Examples
    --------
    $ midair exposure take.drive.h5
    """
    within(repeats, "--repeats", 1)
    chosen, room = (options or ProfileOptions()).chosen(), (air or AirOptions()).medium()
    if figure is not None:
        may_write(figure, force, ".png")
    drive = files.load_solution(source, streamed=True).drive
    array = _array_to_play(drive, device, placement)
    found = devices.measure_exposure(drive, array, chosen, repeats=repeats, room=room)
    if figure is not None:
        files.write_file(figure, png_bytes(exposure_figure(found, simulated=drive.provenance.simulated)))
    unfelt, places = devices.felt_pressure_text(found), found.profile.places
    table: list[Line] = [
        {"profile": found.profile.name, "kept": found.excess <= 0, "excess_db": found.excess},
        ("on the palm", unfelt or f"up to {found.pressure:.3g} Pa"),
        ("computed for", found.measured_in),
        ("not checked", "" if json else _unlike_text(replace(drive, array=array), chosen)),
        Row("nonlinearity", found.nonlinearity, text=_nonlinear_text(found.nonlinearity)),
        ("figure", str(figure or "")),
        Details(
            [
                {"airs": [_air(each.medium) for each in found.airs], "loudest_air": _air(found.loudest_air)},
                ("for", _array_text(drive, array)),
                {"transducer_pa_m": array.pressure, "file_transducer_pa_m": drive.array.pressure},
                ("loudest at", found.where),
                ("resolution", found.resolution),
                {"palm_pressure_pa": found.pressure, "duration_s": found.duration},
                ("heat", found.heat),
                {"palm_warming_k_estimate": found.warming, "palm_warming_limit_k": found.profile.warming},
                {"duty": float(found.duty.max(initial=0.0)), "duty_limit": found.profile.duty},
                {"places": {place.name: _place(found, number) for number, place in enumerate(places)}},
                ("limits", f"{chosen.name}: {chosen.title}"),
                Row("limits from", chosen.source, key="source"),
                Row("evidence", chosen.evidence),
            ]
        ),
    ]
    simulated = drive.provenance.simulated
    if not json:
        print_answer(found.verdict(), simulated=simulated)
        levels = zip(places, found.peak, found.mean, found.daily, strict=True)
        rows = [
            (place.name, f"{peak:.1f}", f"{place.limit:g}" if place.enforced else "none", f"{mean:.1f}", f"{day:.1f}")
            for place, peak, mean, day in levels
        ]
        print_grid(("dB", "loudest", "limit", "mean", "over 8 h"), rows)
    print_table(table, simulated=simulated if json else False, json=json)


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
    return f"real transducers add about {level:.0f} dB at the loudest ear (phases differ by {spread:g} rad)"


def _nonlinear_text(sigma: float) -> str:
    return "" if sigma <= 1 else f"{sigma:.2f}, above 1: the real sound is weaker and more distorted"


def _place(found: Exposure, number: int) -> dict[str, object]:
    place = found.profile.places[number]
    return {
        "limit_db": place.limit,
        "enforced": place.enforced,
        "peak_db": float(found.peak[number]),
        "mean_db": float(found.mean[number]),
        "daily_db": float(found.daily[number]),
        "dose_pa2_s": float(found.dose[number]),
        "position_mm": [round(1e3 * each, 6) for each in place.position],
        "loudest_air": _air(found.airs[found.air[found.level[:, number].argmax(), number]].medium),
    }


def _air(medium: Medium) -> dict[str, float]:
    return {
        "temperature_c": round(medium.degrees, 2),
        "speed_m_s": round(medium.speed, 2),
        "attenuation_np_m": round(float(medium.attenuation), 4),
    }
