"""The command `exposure`: what a drive would expose ears and hands to."""

from pathlib import Path

from midair.cli.terminal import Force, Json, may_write, print_figures, print_json, print_rows
from midair.figures import exposure_figure, png
from midair.files import DEFAULT_PROFILE, load_solution, profile_named, whole_file
from midair.physics import Exposure, exposure


def exposure_command(
    source: Path,
    /,
    *,
    profile: str = DEFAULT_PROFILE,
    profiles: Path | None = None,
    repeats: int = 1,
    figure: Path | None = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Work out the sound level of every frame of a drive at ears and palm, and hold it against a profile.

    The limits of all profiles rest on thin evidence; the command says so, and where they are from.

    Parameters
    ----------
    source
        NAME.drive.h5.
    profile
        Name of the exposure profile.
    profiles
        TOML file of profiles; those that come with midair if not given.
    repeats
        How often the drive would be played, for the dose.
    figure
        Where to draw the levels, NAME.png; NAME.exposure.png if not given.
    json
        Print JSON for a program, and draw only if a figure is named.
    """
    target = figure or Path(source.name.removesuffix(".h5").removesuffix(".drive") + ".exposure.png")
    chosen = profile_named(profile, profiles)
    drawn = figure is not None or not json
    if drawn:
        may_write(target, force)
    drive = load_solution(source).drive
    found = exposure(drive, chosen, repeats=repeats)
    if drawn:
        with whole_file(target) as partial:
            partial.write_bytes(png(exposure_figure(found, simulated=drive.provenance.simulated)))
    if json:
        print_json(_plain(found))
        return
    print_figures(chosen.title, _columns(found))
    print_rows(
        [
            ("verdict", found.verdict()),
            ("nonlinearity", f"sigma {found.nonlinearity:.2f}; above 1 the real sound is weaker and harsher than this"),
            ("limits from", chosen.source),
            ("evidence", chosen.evidence),
            ("figure", str(target)),
        ]
    )


def _columns(found: Exposure) -> dict[str, dict[str, tuple[float, str]]]:
    return {
        place.name + ("" if place.enforced else " (advice)"): _figures(found, number, place.limit)
        for number, place in enumerate(found.profile.places)
    }


def _figures(found: Exposure, number: int, limit: float) -> dict[str, tuple[float, str]]:
    return {
        "limit": (limit, "dB"),
        "loudest frame": (float(found.peak[number]), "dB"),
        "mean energy": (float(found.mean[number]), "dB"),
        "same dose over 8 h": (float(found.daily[number]), "dB"),
        "dose": (float(found.dose[number]), "Pa2 s"),
    }


def _plain(found: Exposure) -> dict[str, object]:
    places = {
        place.name: {
            "limit_db": place.limit,
            "enforced": place.enforced,
            "peak_db": float(found.peak[number]),
            "mean_db": float(found.mean[number]),
            "daily_db": float(found.daily[number]),
            "dose_pa2_s": float(found.dose[number]),
            "position_mm": [1e3 * each for each in place.position],
        }
        for number, place in enumerate(found.profile.places)
    }
    return {
        "profile": found.profile.name,
        "kept": found.excess <= 0,
        "excess_db": found.excess,
        "nonlinearity": found.nonlinearity,
        "duration_s": found.duration,
        "places": places,
        "evidence": found.profile.evidence,
        "source": found.profile.source,
    }
