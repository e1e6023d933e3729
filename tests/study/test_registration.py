import re
from dataclasses import replace
from hashlib import sha256

import pytest

from midair.cli import run as midair
from midair.study.design.plan import draw_plan
from midair.study.design.study_design import Analysis, Exclusions
from midair.study.folder import read_design, template_text
from midair.study.registration import plan_page
from midair.study.statistics import power_paired_t


def words(page):
    return re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", page.partition("<main")[2]))


def part(plan, title, **changes):
    """Paragraphs of a part of the page, after changes of the design."""
    page = plan_page(replace(plan, design=replace(plan.design, **changes)), runs=2)
    return re.findall("<p>(.*?)</p>", page.partition(f"<h2>{title}</h2>")[2].partition("</section>")[0])


@pytest.fixture(scope="module")
def plan():
    return draw_plan(read_design(template_text("paper")), drives={"towel-plain.drive.h5": "ab" * 32})


def test_the_page_contains_the_plan(plan):
    said = words(plan_page(plan, runs=2))
    assert f"Plan {plan.digest} " in said
    assert "seed 2020 for 10 participants" in said
    assert all(" ".join(line.split()) in said for line in plan.design.hypotheses)
    assert "Answers faster than 0.2 s" in said
    assert "equivalence within 0.1" in said
    assert "excluded from the analysis of variance. Answers that name an object that was never" in said
    assert "towel-plain.drive.h5 " + "ab" * 32 in said
    assert f"d_z = 1: power {power_paired_t(10, d_z=1.0):.2f}" in said
    assert "plain_scored 1 12 shuffle, at most 3 equal in a row" in said


@pytest.mark.long
def test_the_same_plan_gives_the_same_page_and_another_another(plan):
    other = draw_plan(read_design(template_text("paper"), seed=1))
    assert plan_page(plan, runs=2) == plan_page(plan, runs=2)
    assert other.digest not in plan_page(plan, runs=2)
    assert other.digest != plan.digest


def test_every_exclusion_rule_has_a_sentence(plan):
    rules = Exclusions(
        fastest_s=0.2,
        slowest_s=9,
        attention=0.8,
        catch=0.6,
        timeouts=0.1,
        training=True,
        failed_plays=True,
        unfinished=True,
    )
    said = part(plan, "Exclusions", exclusions=rules)
    assert len(said) == 8
    assert said[2] == "Participants with correct answers in fewer than 80 % of the attention checks."
    assert part(plan, "Exclusions", exclusions=Exclusions()) == ["No participants; only answers after the time limit."]


def test_unplanned_analyses_are_not_listed(plan):
    assert part(plan, "Planned analyses", analysis=Analysis()) == ["No analyses are planned."]
    (said,) = part(plan, "Planned analyses", analysis=Analysis(strength="object"))
    assert said.split(" over ")[1][:7] == "object,"


@pytest.mark.long
def test_the_command_writes_it_with_its_digest(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "d.toml").write_text(template_text("detection"))
    assert midair(["study", "new", "d", "--source", "d.toml", "--drives", "none"]) == 0
    assert midair(["study", "plan", "d", "--runs", "5"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert sha256((tmp_path / "d" / "plan.html").read_bytes()).hexdigest() in said.replace(" ", "")
    assert midair(["study", "plan", "d", "--runs", "5"]) == 1
    assert "--force" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize(("width", "media"), [(1200, "screen"), (390, "screen"), (718, "print")])
@pytest.mark.parametrize("template", ["paper", "intervals"])
def test_the_page_does_not_overflow(overflowing, width, media, template):
    page = plan_page(draw_plan(read_design(template_text(template)), drives={"a.h5": "ab" * 32}), runs=2)
    assert overflowing(page, width, media=media) == []
