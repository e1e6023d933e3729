from midair.rig.doctor.checkup import run_checks


def test_the_test_machine_passes_all_checks(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    findings = run_checks()
    assert [finding.subject for finding in findings if finding.state == "broken"] == []
    assert {"Python", "numpy", "field model", "solver", "this folder"} <= {finding.subject for finding in findings}
    assert list(tmp_path.iterdir()) == []


def test_each_problem_gives_advice(tmp_path, monkeypatch):
    import importlib.metadata

    real = importlib.metadata.version

    def missing(name):
        if name == "scipy":
            raise importlib.metadata.PackageNotFoundError(name)
        return real(name)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(importlib.metadata, "version", missing)
    broken = [finding for finding in run_checks() if finding.state == "broken"]
    assert [finding.subject for finding in broken] == ["scipy"]
    assert all(finding.advice for finding in broken)
