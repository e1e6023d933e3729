"""The command `compare`: a re-recording or a drive against its original."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from midair import rig
from midair.cli.comparisons import comparison_lines, palm_lines, plain, verdict_lines
from midair.cli.console import print_note, progress_bars, verbosity
from midair.cli.options import BandOptions, Force, Json, Reflection, Seed, Spread
from midair.cli.output import may_write, print_table
from midair.errors import InputError
from midair.evaluate import LaboratoryLoss, PalmFidelity, Verdict, compare, metrics_or_none
from midair.files import DRIVE_SUFFIX, OpenedTake, atomic_file, load_palm, load_solution, open_take, write_file
from midair.model import Palm
from midair.settings import Settings
from midair.table import Details, Line
from midair.view import PalmMaps, check_size, ffmpeg, film_of_palm, show_comparison, show_page, write_gif, write_mp4


def compare_command(
    original: Path,
    reproduced: Path,
    /,
    *,
    options: BandOptions | None = None,
    palm: Path | None = None,
    spread: Spread = "default",
    reflection: Reflection = 0.0,
    seed: Seed = 0,
    fixed_place: bool = False,
    report: Path | None = None,
    film: Path | None = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Compare a re-recording or a drive with its original recording.

    Prints what a palm would feel and what to change; of a drive also what a real laboratory would leave.
    The files state which of the two is the original.
    Band, rate, lead and the part of the original are read from the re-recording.
    The band filter is applied to the original once more, since a re-recording passes it twice.

    Parameters
    ----------
    original
        Original recording with a calibration, NAME.h5.
    reproduced
        Re-recording of ORIGINAL; or its drive, which is then played on a virtual rig with a sensor and a whole palm.
    palm
        TOML file with the outline of a palm, for a drive. [default: disc of 85 mm]
    fixed_place
        Count a shift and a turn of the pattern in the plane of the palm as distortion.
    report
        Write an HTML page with all figures and both recordings, to watch and listen to.
    film
        Write a slow-motion film of a drive to palm.gif or palm.mp4 (needs ffmpeg).
        It shows pressure on the palm and motion of soft skin, target beside reproduction.

    Examples
    --------
    $ midair compare take.h5 take.rerecorded.h5
    $ midair compare take.h5 take.drive.h5
    $ midair compare take.h5 take.drive.h5 --film palm.gif
    $ midair compare take.h5 take.rerecorded.h5 --report compared.html
    """
    if report is not None:
        may_write(report, force, ".html")
    if film is not None:
        may_write(film, force, ".gif", ".mp4")
        if film.suffix.lower() == ".mp4":
            ffmpeg()
    original, reproduced = _in_order(original, reproduced)
    told: PalmFidelity | None = None
    laboratory: LaboratoryLoss | None = None
    if reproduced.name.lower().endswith(DRIVE_SUFFIX):
        if options not in (None, BandOptions()):
            raise InputError("--band, --rate: expected a recording as second file, got a drive, which has them")
        virtual = rig.VirtualRig(seed=seed, spread=spread, reflection=reflection)
        settings, take, told, laboratory = _played(original, reproduced, palm, virtual, film, fixed_place)
    else:
        for option, given in (("--palm", palm), ("--film", film)):
            if given is not None:
                raise InputError(f"{option}: expected a drive as second file, got the recording {reproduced.name}")
        if seed or reflection or spread != "default":
            raise InputError(f"--seed, --spread, --reflection: expected a drive, got the recording {reproduced.name}")
        take = rig.calibrated_take(reproduced)
        settings = rig.settings_of_rerecording(take.recording.provenance, (options or BandOptions()).settings())
    pair = rig.aligned_pair(rig.pressure_of(original, settings), take, settings)
    before, after = pair.original, pair.piece
    comparison = compare(before, pair.heard, first=pair.first, noise=pair.noise, fixed_place=fixed_place)
    card = metrics_or_none(before, after)
    option = rig.next_step(comparison.gain, Settings.of(take.recording.provenance))
    verdict = Verdict.of(comparison, after, card, option=option, laboratory=laboratory)
    if report is not None:
        check_size(shown := show_comparison(before, after))
        tables = [("All numbers", comparison_lines(comparison, card))]
        if told is not None:
            figures = told.figures().items()
            rows = [(name.removeprefix("palm: "), f"{value:.3g} {unit}") for name, (value, unit) in figures]
            tables.append((f"Fidelity on a whole palm, {told.palm}", rows))
        page = show_page(shown, verdict=verdict.rows(), tables=tables, commands=(verbosity().line,))
        write_file(report, page)
    answer, others = verdict_lines(verdict)
    table: list[Line] = [
        plain(comparison) | {"perception": card and card.plain()["figures"], "verdict": verdict.plain()},
        {"palm": told and told.plain()},
        *others,
        *([] if told is None else palm_lines(told)),
        ("report", str(report or "")),
        ("film", str(film or "")),
        Details(comparison_lines(comparison, card)),
    ]
    print_table(table, answer=answer, simulated=comparison.simulated, json=json)


def _in_order(first: Path, second: Path) -> tuple[Path, Path]:
    """The original and its reproduction, whichever was named first."""
    if first.exists() and second.exists() and first.samefile(second):
        print_note(f"{second.name} is the original too: it is compared with itself")

    def made(path: Path) -> bool:
        return path.name.lower().endswith(DRIVE_SUFFIX) or open_take(path).recording.provenance.played

    if made(first) and not made(second):
        print_note(f"{first.name} is a reproduction: compared with {second.name} as the original")
        return second, first
    return first, second


def _played(
    original: Path, drive_file: Path, palm: Path | None, virtual: rig.VirtualRig, film: Path | None, fixed_place: bool
) -> tuple[Settings, OpenedTake, PalmFidelity, LaboratoryLoss]:
    """Settings of a drive, its re-recording by a virtual sensor, and what a whole palm and a laboratory get of it."""
    drive = load_solution(drive_file).drive
    settings = Settings.of(drive.provenance)
    if settings is None:
        raise InputError(
            f"{drive_file.name}: expected a drive with stored settings, got one without; make it with midair solve"
        )
    felt = rig.pressure_of(original, settings)
    piece, asked = rig.original_of_drive(drive.provenance, felt)
    if asked.frames != drive.frames:
        raise InputError(
            f"{drive_file.name}: expected the drive of {original.name}, {asked.frames} frames, got {drive.frames}; "
            "name the recording that it was solved for"
        )
    if not drive.provenance.follows(open_take(original).recording.provenance):
        print_note(f"{drive_file.name} was made of another recording than {original.name}", warn=True)
    band = settings.calibration.band
    virtual = replace(virtual, cells=felt.sensor, height=settings.target.grid.height).hearing(band)
    outline = Palm.disc() if palm is None else load_palm(palm)
    judged = ((asked.frames - piece.frames) // 2 / piece.rate, piece.frames / piece.rate)
    with progress_bars() as stage:
        heard = rig.rerecord_drive(drive, virtual, stage=stage)
        pressed = rig.palm_of_drive(asked, drive, virtual, outline, progress=stage("palm"))
        if film is not None:
            frames = pressed.frames(judged=judged, band=band)
            # Write pressure and displacement, target beside reproduction, as a film.
            progress = stage("film")
            pressure = {"Pressure, wanted": frames.wanted, "played": frames.delivered}
            motion = {f"{frames.skin} skin, wanted": 1e6 * frames.wanted_motion, "played": 1e6 * frames.motion}
            groups = [
                PalmMaps(maps=maps, unit=unit, pitch=frames.pitch, square=frames.square)
                for maps, unit in ((pressure, "Pa"), (motion, "µm"))
            ]
            made = film_of_palm(groups, rate=frames.rate)
            with atomic_file(film) as partial:
                (write_mp4 if film.suffix.lower() == ".mp4" else write_gif)(made, partial, progress=progress)
        how: Any = {"fixed_place": fixed_place, "progress": stage("laboratory")}
        laboratory = rig.laboratory_of_drive(asked, drive, settings, judged[1], **how)
    return settings, heard, pressed.fidelity(judged=judged, band=band), laboratory
