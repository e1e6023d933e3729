"""`make bench-gpu` without a GPU: small on the CPU, and what it says of a GPU that is not there."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def bench(*said):
    if shutil.which("make") is None:
        pytest.skip("there is no make")
    # What .gpu would bring is installed here: -o says that it need not be made.
    make = ["make", "-o", ".gpu/array_api_compat", "bench-gpu", f"GPU_PYTHON={sys.executable}", f"GPU={' '.join(said)}"]
    return subprocess.run(
        make, cwd=ROOT, capture_output=True, text=True, env=os.environ | {"OPENBLAS_NUM_THREADS": "1"}, check=False
    )


@pytest.mark.parametrize(
    ("name", "needed", "patterns"),
    [
        ("numpy", "numpy", 8),
        pytest.param("strict", "array_api_strict", 64, marks=pytest.mark.slow),
        pytest.param("torch", "torch", 64, marks=pytest.mark.slow),
    ],
)
@pytest.mark.long
def test_a_small_run_on_the_cpu(name, needed, patterns):
    pytest.importorskip(needed)
    made = bench("--backend", name, "--patterns", str(patterns))
    assert made.returncode == 0, made.stderr
    assert "no GPU in this run" in made.stdout
    assert f"fast, {patterns} patterns" in made.stdout
    assert "glide, best mode, 400 frames" in made.stdout
    (difference,) = [line for line in made.stdout.splitlines() if "from NumPy's" in line]
    assert float(difference.split(":")[1].split()[0]) < 2e-3


@pytest.mark.long
@pytest.mark.parametrize("name", ["torch:cuda", "cupy", "jax"])
def test_a_gpu_that_is_not_here_is_one_line_and_no_traceback(name):
    torch = pytest.importorskip("torch") if name == "torch:cuda" else None
    if torch is not None and torch.cuda.is_available():
        pytest.skip("there is a GPU here")
    if name == "cupy" and shutil.which("nvidia-smi"):
        pytest.skip("there may be a GPU here")
    made = bench("--backend", name)
    assert made.returncode != 0
    assert "Error 1" in made.stderr
    assert "benchmarks.gpu: no GPU here:" in made.stderr
    assert "Traceback" not in made.stderr


@pytest.mark.long
def test_a_number_of_patterns_that_there_is_not_is_refused():
    made = bench("--backend", "numpy", "--patterns", "65536")
    assert "Error 2" in made.stderr
    assert "--patterns: expected 1 to 65535, got 65536" in made.stderr
