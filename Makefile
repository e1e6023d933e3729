# Everything runs from .venv, made on first use from constraints.txt.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# One BLAS thread a process: more of them spin on small matrices and slow each other down.
export OPENBLAS_NUM_THREADS ?= 1
export MKL_NUM_THREADS ?= 1
# The last lines name the tests that took longest: CONTRIBUTING.md says what a fast one may take.
# Twice as many processes as the smallest machine has cores: much of a test of a device is waiting.
PARALLEL := --numprocesses 4 --dist worksteal --durations 15 --durations-min 1
# With COVERAGE set, as .ci/run does, the tests measure what they reach, the fast and then the long ones, and fail below the
# floor in pyproject.toml. Without: counting lines takes a quarter to a third more processor time on Python 3.11.
COVER := $(if $(COVERAGE),--cov --cov-report= --cov-fail-under=0)
COVER_ALL := $(if $(COVERAGE),--cov --cov-append --cov-report=term:skip-covered)
LONG := -m "long and not slow"

.PHONY: demo test coverage test-kernels test-long test-slow test-browser test-again test-long-again test-browser-again
.PHONY: check lint bench bench-gpu docs figures links format release clean

$(VENV)/run: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable .
	touch $@

$(VENV)/dev: $(VENV)/run
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable ".[dev]"
	touch $@

demo: $(VENV)/run
	$(BIN)/midair demo --force

test: $(VENV)/dev
	@echo "The fast tests take three minutes on two quiet cores, longer on a busy machine."
	@$(BIN)/python -m pytest $(PARALLEL) $(COVER) || { echo "Some tests failed. Type 'make test-again' to run those alone.\
	 If they fail again, please report it with these lines and the output of $(BIN)/midair doctor."; exit 1; }

coverage:
	$(MAKE) test COVERAGE=1
	$(MAKE) test-long COVERAGE=1

test-long: $(VENV)/dev
	$(BIN)/python -m pytest $(LONG) $(PARALLEL) $(COVER_ALL)

test-slow: $(VENV)/dev
	$(BIN)/python -m pytest -m slow --timeout 3000 $(PARALLEL)

test-browser: $(VENV)/dev
	$(BIN)/python -m pytest -m browser --numprocesses 2 --dist worksteal --durations 10

# Those that failed last, alone and one after the other: what fails again does not fail for want of time. Fails where
# nothing had failed, so that it never hides another reason.
AGAIN := --last-failed --last-failed-no-failures none

# The last bits of a matrix product depend on the processor; the numerical tests pass under each kernel that this one has.
test-kernels: $(VENV)/dev
	$(BIN)/python -m tests.kernels

test-again: $(VENV)/dev
	$(BIN)/python -m pytest $(AGAIN)

test-long-again: $(VENV)/dev
	$(BIN)/python -m pytest $(LONG) $(AGAIN)

test-browser-again: $(VENV)/dev
	$(BIN)/python -m pytest -m browser $(AGAIN)

check: lint docs

lint: $(VENV)/dev
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/pyright
	$(BIN)/lint-imports
	$(BIN)/python -m tests.words
	$(BIN)/typos README.md CHANGELOG.md CONTRIBUTING.md docs src examples

docs: $(VENV)/dev
	$(BIN)/sphinx-build --fail-on-warning --keep-going -q -b html docs docs/_build/html

# Addresses outside, which needs a network and the patience of others; `make docs` checks those inside.
links: $(VENV)/dev
	@$(BIN)/python docs/network.py
	$(BIN)/sphinx-build -q -b linkcheck -D sphinx_gallery_conf.plot_gallery=0 docs docs/_build/links

bench: $(VENV)/dev
	$(BIN)/python -m benchmarks
	$(BIN)/python -m benchmarks.recordings
	$(BIN)/python -m benchmarks.limits
	$(BIN)/python -m benchmarks.terms
	$(BIN)/python -m benchmarks.playback
	$(BIN)/python -m benchmarks.air
	$(BIN)/python -m benchmarks.studio
	$(BIN)/python -m benchmarks.reels --rows "small 30" "small 120" "paper 5" "paper 20"

# On a machine with a GPU and a Python that has PyTorch, NumPy and SciPy, which GPU_PYTHON names. What else it needs lies in
# .gpu, pure Python: made where there is a network, it goes along to a machine without.
GPU_PYTHON ?= python3
GPU ?=

.gpu/array_api_compat:
	$(PYTHON) -m pip install --quiet --disable-pip-version-check --no-deps --target .gpu array-api-compat threadpoolctl

bench-gpu: .gpu/array_api_compat
	PYTHONPATH=src:.gpu $(GPU_PYTHON) -m benchmarks.gpu $(GPU)

# Record every figure that the commands print and write, or compare them with such a record:
# make figures WRITE=../before.json, make figures AGAINST=../before.json
figures: $(VENV)/dev
	$(BIN)/python -m tests.regression $(if $(WRITE),--write $(WRITE)) $(if $(AGAINST),--against $(AGAINST))

# Build and check a release in a clone: make release, or make release VERSION=0.2.0 to commit and tag a new version.
.release/ready: packaging/tools.txt constraints.txt
	$(PYTHON) -m venv .release
	.release/bin/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt \
	  --requirement packaging/tools.txt hatchling jsonschema ruamel.yaml
	.release/bin/python -m pip install --quiet --disable-pip-version-check --no-deps cffconvert==2.0.0
	touch $@

release: .release/ready
	.release/bin/python packaging/release.py --tools .release/bin $(if $(VERSION),--version $(VERSION))

format: $(VENV)/dev
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

clean:
	rm -rf $(VENV) .gpu .release dist demo docs/_build docs/gallery docs/reference .coverage* .hypothesis .pytest_cache .ruff_cache
