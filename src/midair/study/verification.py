"""Check of the files of a study: the plan, its drives, and the chain hashes of each log."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path

from midair.errors import InputError, MidairError
from midair.files import read_text
from midair.study.design import Plan, answers_table, consent_notes, excluded_participants, thresholds_of
from midair.study.drives import digest_of_file
from midair.study.findings import StudyData, data_of_answers
from midair.study.folder import StudyFolder, withdrawn
from midair.study.session import chain_hashes

_NOTED = re.compile(r"(sub-\d+\.jsonl): seal\s+([0-9a-f]{32})")


@dataclass(frozen=True, slots=True, kw_only=True)
class Verification:
    """Result of the check of a study's files."""

    sessions: tuple[str, ...]
    """One line for each log; a fault states what to do."""
    faults: int
    """Number of drives and logs that differ from the plan or a noted seal."""
    unfinished: Mapping[str, str]
    """State of each unfinished session by participant."""
    summary: str
    """One line on all files without names of participants, for reports and exports."""

    @property
    def unfinished_words(self) -> str:
        """Sentence on the unfinished sessions; empty if there are none."""
        named = ", ".join(f"{who} ({state})" for who, state in self.unfinished.items())
        return f"Sessions that are not finished: {named}." if named else ""


def noted_seals(file: Path) -> dict[str, list[str]]:
    """Seals (last chain hashes) in a text by the name of the log, as `midair study run` and `verify` print them.

    Raises InputError if the text contains none.
    """
    found: dict[str, list[str]] = {}
    for name, seal in _NOTED.findall(read_text(file, "noted seals")):
        found.setdefault(name, []).append(seal)
    if not found:
        raise InputError(
            f"{file.name}: expected lines such as 'sub-01.jsonl: seal ' and 32 hexadecimal digits, got none"
        )
    return found


def verify_study(folder: StudyFolder, *, noted: Mapping[str, Sequence[str]] | None = None) -> Verification:
    """Check the plan, its drives, the chain of each log, and seals that were noted elsewhere.

    `noted` gives seals by the name of the log (`noted_seals`); a log that has grown still contains its earlier seals.
    Raises BrokenFileError if the plan was changed after it was drawn.
    """
    plan, gone = folder.plan(), {folder.log(number).name for number in withdrawn(folder)}
    known = {name: seals for name, seals in (noted or {}).items() if name not in gone}
    logs = {folder.log(number).name: number for number in range(1, plan.design.participants + 1)}
    there = {path.name for path in (folder.path / "sessions").glob("*.jsonl")}
    lines: list[str] = []
    sealed: list[str] = []
    unfinished: dict[str, str] = {}
    as_noted = finished = 0
    for name in sorted(there | set(known)):
        try:
            seal, state, seals = _checked_log(folder, plan, logs.get(name, 0), name, known.get(name, ()))
        except MidairError as wrong:
            lines.append(f"FAULT {wrong}")
            continue
        sealed.append(f"{name} {seal}")
        finished += state == "finished"
        if state != "finished":
            unfinished[name.removesuffix(".jsonl")] = state.removeprefix("not finished, ")
        as_noted += bool(seals)
        chain = "the plan requires no chain" + ("" if seal else ": changes cannot be detected")
        parts = (f"{name}: seal {seal or 'none'}", state, "" if plan.chain else chain, seals)
        lines.append("; ".join(part for part in parts if part))
    broken = len(lines) - len(sealed)
    drives, changed = _check_drives(folder, plan)
    parts = [
        f"plan {plan.digest}",
        drives,
        f"{len(sealed)} of {len(lines)} logs intact" + ("" if plan.chain else " (the plan is older than chained logs)"),
        f"{finished} of {plan.design.participants} participants finished",
        f"{as_noted} of {len(known)} seals as noted" if known else "no noted seals to compare with",
        f"all seals {sha256(chr(10).join(sealed).encode()).hexdigest()[:16]}",
    ]
    faults = broken + changed
    summary = f"Files of the study: {'; '.join(parts)}; {faults or 'no'} {'fault' if faults == 1 else 'faults'}."
    return Verification(sessions=tuple(lines), faults=faults, unfinished=unfinished, summary=summary)


def data_of_study(folder: StudyFolder) -> StudyData:
    """Read, check and sort the answers of a study for `analyse`.

    Raises BrokenFileError if the plan or a log was changed after it was written, MismatchError if a log belongs to
    another participant or another study, and InputError if no answer is scored.
    """
    plan, sessions = folder.plan(), folder.sessions()
    verified = verify_study(folder)
    data = data_of_answers(
        answers_table(plan, sessions),
        plan.design.analysis,
        thresholds=thresholds_of(plan, sessions),
        excluded=excluded_participants(plan, sessions),
        files=" ".join(part for part in (verified.summary, verified.unfinished_words) if part),
        design=plan.design,
    )
    return replace(data, notes=consent_notes(plan, sessions))


def _checked_log(folder: StudyFolder, plan: Plan, number: int, name: str, noted: Sequence[str]) -> tuple[str, str, str]:
    """Seal, state and comparison with noted seals of a log; raises MidairError for a fault."""
    if not number:
        raise InputError(
            f"{name}: expected logs of participants 1 to {plan.design.participants} only; move it elsewhere"
        )
    if not folder.log(number).exists():
        raise InputError(f"{name}: expected a log because its seal was noted, the file does not exist; restore a copy")
    state = folder.session(plan, number).state
    links = chain_hashes(folder.log(number))
    seal = links[-1] if links else ""
    for one in noted:
        if one not in links:
            raise InputError(
                f"{name}: expected the noted seal {one}, got {seal or 'none'}; the log was rewritten or its end was"
                f" removed ({state}): restore a copy"
            )
    if not noted:
        return seal, state, ""
    grown = len(links) - 1 - max(links.index(one) for one in noted)
    return seal, state, f"as noted, {grown} lines since" if grown else "as noted"


def _check_drives(folder: StudyFolder, plan: Plan) -> tuple[str, int]:
    """Comparison of the drives with the plan as text, and the number of changed or missing drives."""
    if not plan.drives:
        return "drawn without drives", 0
    wrong = [
        source
        for source, digest in plan.drives.items()
        if not (folder.path / source).is_file() or digest_of_file(folder.path / source) != digest
    ]
    words = f"{len(plan.drives) - len(wrong)} of {len(plan.drives)} drives as in the plan"
    return words + (f" (changed or missing: {', '.join(wrong)})" if wrong else ""), len(wrong)
