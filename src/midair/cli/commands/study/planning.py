"""The commands `study new`, `study withdraw` and `study power`."""

import shlex
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from midair import files
from midair.cli.console import banner, confirmed, out, print_note, progress_bars
from midair.cli.options import Force, Study
from midair.errors import InputError
from midair.settings import Mode
from midair.study import (
    Design,
    PowerTest,
    StudyDrive,
    StudyFolder,
    Template,
    balanced_latin_square,
    block_order,
    participants_for,
    prepare_drives,
    prepare_media,
    read_design,
    template_text,
    threshold_cautions,
    withdraw,
)
from midair.validation import within


def new_command(
    name: str,
    /,
    *,
    template: Template = "paper",
    take: Path | None = None,
    source: Path | None = None,
    participants: int | None = None,
    seed: int | None = None,
    drives: str = "",
    mode: Mode = "quick",
) -> None:
    """Create a study folder with a randomised plan and its drives.

    Parameters
    ----------
    name
        Folder to create; letters and digits of its last part are the name of the study.
    template
        paper: section 5.3, three objects on two surfaces.
        detection: threshold of a vibration.
        intervals: which of two intervals is stronger.
        paired: which of two stimuli is closer to a real object.
    take
        Recording, NAME.h5, whose threshold --template detection measures; its drive is beside it, or solved with
        --mode.
    source
        TOML file that describes another study, instead of --template; its drives are searched in the same folder.
    participants
        Number of participants to draw trials for. [default: from the TOML]
    seed
        Random seed of all shuffles. [default: from the TOML]
    drives
        Folder of the drives, or of recordings of the same names to solve; "none" for a plan that is only simulated.
        [default: virtual strokes for a template]
    mode
        Mode to solve recordings with; virtual strokes are solved at 1 kHz.

    Examples
    --------
    $ midair study new touch --participants 3
    $ midair study new dry --drives none
    $ midair study new faint --template detection --take stroke.h5
    """
    if take is not None and (source is not None or drives):
        raise InputError("--take: expected it with --template alone, got --source or --drives")
    if participants is not None:
        within(participants, "--participants", 1)
    text = (
        template_text(template, take=take and take.name)
        if source is None
        else files.read_text(source, "a study in TOML")
    )
    beside = take or source
    path = Path(name)
    kept = "".join(letter for letter in path.name if letter.isascii() and letter.isalnum())
    if not kept:
        raise InputError(f"NAME: expected letters or digits in the last part, got {name!r}")
    design = read_design(text, name=kept, participants=participants or 0, seed=seed)
    gathered: list[StudyDrive] = []

    def fill(into: Path) -> dict[str, str]:
        folder = Path(drives) if drives else None if beside is None else beside.parent
        with progress_bars() as stage:
            gathered.extend(prepare_drives(design, into, found_in=folder, mode=mode, seed=design.seed, stage=stage))
        return {one.source: one.digest for one in gathered} | prepare_media(design, into, found_in=folder)

    plan = StudyFolder.create(path, text, design, drives=None if drives == "none" else fill).plan()
    out().print(f"{path}: {len(plan.of(1))} trials for each of {design.participants} participants, plan {plan.digest}.")
    for number in range(1, design.participants + 1):
        order = dict.fromkeys(block.group for block in block_order(plan.design, number))
        out().print(f"  participant {number}: {', '.join(order)}")
    orders = len(balanced_latin_square(max(1, len(set(design.counterbalanced)))))
    if design.participants % orders:
        print_note(
            f"uneven counterbalancing: expected a multiple of {orders} participants, because {orders} orders of "
            f"{', '.join(design.counterbalanced)} take turns, got {design.participants}",
            warn=True,
        )
    for caution in threshold_cautions(plan.design):
        print_note(caution, warn=True)
    _print_drives(gathered)
    _print_next(path, design, gathered)


def withdraw_command(study: Study, participant: int, /, *, force: Force = False) -> None:
    """Delete all data of one participant, and make every export and report of this folder again without it.

    Files are deleted, not overwritten; delete copies and backups yourself. The number is not used again.

    Parameters
    ----------
    participant
        Number of the participant, from 1.
    force
        Delete without asking.

    Examples
    --------
    $ midair study withdraw touch 2 --force
    """
    folder = StudyFolder(study)
    folder.plan()
    if not (force or confirmed(f"Delete all data of participant {participant} of {study}?")):
        raise InputError(f"{study}: nothing was deleted; use --force to delete without asking")
    for line in withdraw(folder, participant):
        out().print(line)
    out().print(f"participant {participant} is withdrawn.")


def _print_drives(gathered: list[StudyDrive]) -> None:
    words = {
        "found": "copied",
        "drawn": "drawn",
        "solved": "solved from its recording",
        "virtual": "from a virtual stroke",
    }
    for one in gathered:
        out().print(f"  {one.source}: {one.duration:.2f} s, {words[one.how]}, SHA-256 {one.digest[:12]}")
    if any(one.how == "virtual" for one in gathered):
        banner(True)


def _print_next(path: Path, design: Design, gathered: list[StudyDrive]) -> None:
    there = shlex.quote(str(path))
    drives = any(one.kind == "drive" for one in design.stimuli)
    if drives and not gathered:
        out().print(f"Next: midair study run {there} --simulate", soft_wrap=True)
        return
    if any(one.kind in ("picture", "sound") for one in design.stimuli):
        out().print(f"Next: midair studio {shlex.quote(str(path.parent))}", soft_wrap=True)
        return
    noise = " --noise none" if design.noise else ""
    array = f" --array virtual{noise}" if drives else ""
    out().print(f"Next: midair study run {there} --participant 1{array}", soft_wrap=True)
    out().print(f"To simulate participants: midair study run {there} --simulate", soft_wrap=True)


def power_command(
    test: PowerTest,
    /,
    *,
    effect: float,
    objects: int = 3,
    trials: int = 12,
    others: Annotated[tuple[int, ...], Parameter(consume_multiple=True)] = (3, 3),
    power: float = 0.8,
) -> None:
    """Compute how many participants a planned test needs.

    Parameters
    ----------
    test
        Test of the report.
        paired: paired t-test.
        identification: share of correct answers above chance, by a binomial test.
        rating: a factor of two levels in the analysis of variance, corrected for all its effects.
        equivalence: two equal conditions are shown to differ by less than a margin.
        threshold: the confidence interval of the median threshold excludes a bound.
    effect
        Effect size, which depends on the test.
        paired: d_z. identification: mean d'.
        rating: difference over the standard deviation of a person's mean rating at one level.
        equivalence: margin over the standard deviation of the participants' differences.
        threshold: distance of the bound over the standard deviation of the participants' log thresholds.
    objects
        Alternatives of the choice (identification).
    trials
        Trials per participant (identification).
    others
        Levels of each further factor of the ratings (rating); the default is the paper's.
    power
        Power to reach.

    Examples
    --------
    $ midair study power paired --effect 0.8
    """
    if not 0 < power < 1:
        raise InputError(f"--power: expected between 0 and 1, got {power:g}")
    further: dict[PowerTest, dict[str, Any]] = {
        "identification": {"objects": objects, "trials": trials},
        "rating": {"others": others},
    }
    many = participants_for(test, power=power, effect=effect, **further.get(test, {}))
    out().print(f"{many} participants for power {power:g} of the test {test} at an effect of {effect:g}.")
