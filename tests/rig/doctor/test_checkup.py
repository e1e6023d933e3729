from midair.rig.doctor.checkup import check_up


def test_a_machine_that_runs_the_tests_is_well(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    findings = check_up()
    assert [finding.subject for finding in findings if finding.state == "broken"] == []
    assert {"Python", "numpy", "field model", "solver", "this folder"} <= {finding.subject for finding in findings}
    assert list(tmp_path.iterdir()) == []


def test_what_is_wrong_comes_with_advice(tmp_path, monkeypatch):
    import importlib.metadata

    real = importlib.metadata.version

    def missing(name):
        if name == "scipy":
            raise importlib.metadata.PackageNotFoundError(name)
        return real(name)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(importlib.metadata, "version", missing)
    broken = [finding for finding in check_up() if finding.state == "broken"]
    assert [finding.subject for finding in broken] == ["scipy"]
    assert all(finding.advice for finding in broken)
