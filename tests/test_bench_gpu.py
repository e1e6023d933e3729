"""The benchmark of `make bench-gpu` without a GPU: small on the CPU, and what it prints of a GPU that is not there."""

import shutil
import sys

import pytest


def bench(monkeypatch, *words):
    from benchmarks.gpu import main

    monkeypatch.setattr(sys, "argv", ["gpu", *words])
    return main()


@pytest.mark.long
@pytest.mark.parametrize(
    "name", ["numpy", *(pytest.param(each, marks=pytest.mark.slow) for each in ("strict", "torch"))]
)
def test_a_small_run_on_the_cpu_agrees_with_numpy(name, monkeypatch, capsys):
    pytest.importorskip({"strict": "array_api_strict"}.get(name, name))
    assert bench(monkeypatch, "--backend", name, "--patterns", "8") == 0
    printed = capsys.readouterr().out
    assert "fast, 8 patterns" in printed
    assert "glide, best mode, 400 frames" in printed
    (difference,) = [line for line in printed.splitlines() if "from NumPy's" in line]
    assert float(difference.split(":")[1].split()[0]) < 2e-3


@pytest.mark.long
@pytest.mark.skipif(shutil.which("nvidia-smi") is not None, reason="there may be a GPU here")
def test_a_gpu_that_is_not_here_is_a_line(monkeypatch, capsys):
    for name in ("torch:cuda", "cupy", "jax"):
        assert bench(monkeypatch, "--backend", name) == 1
        assert "benchmarks.gpu: no GPU here:" in capsys.readouterr().err
