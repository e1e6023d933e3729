"""Commands for a study before its first participant, and for one who goes: new, plan, withdraw."""

import shlex
import sys
from hashlib import sha256
from pathlib import Path

from midair.cli.terminal import Force, banner, err, progress_bars, say
from midair.errors import InputError
from midair.files import read_text, whole_file
from midair.settings import Mode
from midair.study import (
    Design,
    StudyDrive,
    StudyFolder,
    Template,
    block_order,
    plan_page,
    prepare_drives,
    read_design,
    template_text,
    withdraw,
)


def new_command(
    name: str,
    /,
    *,
    template: Template = "paper",
    source: Path | None = None,
    participants: int | None = None,
    seed: int | None = None,
    drives: str = "",
    mode: Mode = "quick",
) -> None:
    """Draw the plan of a new study into the folder NAME, and put its drives there.

    Parameters
    ----------
    name
        Of the folder; its last part, letters and digits only, is the name of the study.
    template
        paper: section 5.3, three objects on two surfaces. detection: threshold of a vibration. intervals: which of two
        is stronger, first or second. paired: which of two is rougher, all pairs.
    source
        TOML that describes another study; its drives are looked for beside it.
    participants
        For how many people trials are drawn; what the TOML says if not given.
    seed
        Of all shuffles; what the TOML says if not given.
    drives
        Folder of the drives, or of recordings with their names, which are then solved. "none" for a plan to be
        simulated only. If not given, those of a template are made of virtual strokes.
    mode
        With which settings recordings are solved; virtual strokes at 1 kHz.

    Examples
    --------
    $ midair study new touch --participants 3
    $ midair study new dry --drives none
    """
    if participants is not None and participants < 1:
        raise InputError(f"--participants: expected 1 or more, got {participants}")
    text = template_text(template) if source is None else read_text(source, "the TOML of a study")
    path = Path(name)
    kept = "".join(letter for letter in path.name if letter.isascii() and letter.isalnum())
    if not kept:
        raise InputError(f"NAME: expected letters or digits in the last part of it, got {name!r}")
    design = read_design(text, name=kept, participants=participants or 0, seed=seed)
    gathered: list[StudyDrive] = []

    def fill(into: Path) -> dict[str, str]:
        folder = Path(drives) if drives else None if source is None else source.parent
        with progress_bars() as stage:
            gathered.extend(prepare_drives(design, into, found_in=folder, mode=mode, seed=design.seed, stage=stage))
        return {one.source: one.digest for one in gathered}

    plan = StudyFolder.create(path, text, design, drives=None if drives == "none" else fill).plan()
    say(f"{path}: {len(plan.of(1))} trials for each of {design.participants} participants, plan {plan.digest}.")
    for number in range(1, design.participants + 1):
        order = dict.fromkeys(block.group for block in block_order(plan.design, number))
        say(f"  participant {number}: {', '.join(order)}")
    _say_drives(gathered)
    _say_next(path, design, gathered)


def plan_command(study: Path, output: Path | None = None, /, *, runs: int = 500, force: Force = False) -> None:
    """Write the plan of a study as a page to be registered: hypotheses, exclusions, analyses, power, digests.

    Parameters
    ----------
    study
        Folder of the study.
    output
        The HTML file; plan.html in the folder if not given.
    runs
        Simulated studies for each statement of power.
    force
        Write over it.

    Examples
    --------
    $ midair study plan touch
    """
    plan, target = StudyFolder(study).plan(), output or study / "plan.html"
    if target.exists() and not force:
        raise InputError(f"{target}: expected a new file, got one that is there; give another name, or --force")
    page = plan_page(plan, runs=runs)
    with whole_file(target) as partial:
        partial.write_text(page, encoding="utf-8")
    say(f"{target}: plan {plan.digest}, the page's SHA-256 {sha256(page.encode()).hexdigest()}")


def withdraw_command(study: Path, participant: int, /, *, force: Force = False) -> None:
    """Delete one participant everywhere: the log, and whatever was exported or reported from here.

    Files are deleted, not wiped; copies and backups are yours to delete. The number stays empty.

    Parameters
    ----------
    study
        Folder of the study.
    participant
        Number, from 1 on.
    force
        Do not ask.

    Examples
    --------
    $ midair study withdraw touch 2 --force
    """
    folder = StudyFolder(study)
    folder.plan()
    if not force:
        _ask_to_delete(study, participant)
    for line in withdraw(folder, participant):
        say(line)
    say(f"participant {participant} has withdrawn.")


def _ask_to_delete(study: Path, participant: int) -> None:
    """Let a person decide; nobody to ask means no."""
    if sys.stdin.isatty():
        err().print(f"Delete participant {participant} of {study} for good? [y/N] ", end="")
        if sys.stdin.readline().strip().lower() in ("y", "yes"):
            return
    raise InputError(f"{study}: nothing was deleted; --force does not ask")


def _say_drives(gathered: list[StudyDrive]) -> None:
    words = {"found": "as it was found", "solved": "solved from its recording", "virtual": "of a virtual stroke"}
    for one in gathered:
        say(f"  {one.source}: {one.duration:.2f} s, {words[one.how]}, SHA-256 {one.digest[:12]}")
    if any(one.how == "virtual" for one in gathered):
        banner(True)


def _say_next(path: Path, design: Design, gathered: list[StudyDrive]) -> None:
    """Commands that run as they are printed."""
    there = shlex.quote(str(path))
    drives = any(one.kind == "drive" for one in design.stimuli)
    if drives and not gathered:
        say(f"Next: midair study run {there} --simulate")
        return
    noise = " --noise none" if design.noise else ""
    array = f" --array virtual{noise}" if drives else ""
    say(f"Next: midair study run {there} --participant 1{array}")
    say(f"To register it before: midair study plan {there}")
    say(f"Or with nobody: midair study run {there} --simulate")
