# Everything runs from .venv, made on first use from constraints.txt.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# Bytecode is made for what is imported, on first use: for all packages it takes half of the installation.
PIP := --quiet --disable-pip-version-check --no-compile --constraint constraints.txt
# One BLAS thread a process: more of them spin on small matrices and slow each other down.
export OPENBLAS_NUM_THREADS ?= 1
export MKL_NUM_THREADS ?= 1
# One worker for each core of the smallest machine: each collects all tests. The last lines name the slowest tests.
PYTEST := $(BIN)/python -m pytest --numprocesses 2 --dist worksteal --durations 20 --durations-min 0.5

.PHONY: demo test test-bare test-all test-fast test-long test-kernels test-browser test-slow test-coverage
.PHONY: check lint bench bench-gpu docs figures links format release clean

$(VENV)/run: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install $(PIP) --editable .
	touch $@

$(VENV)/dev: $(VENV)/run
	$(BIN)/python -m pip install $(PIP) --editable ".[dev]"
	touch $@

demo: $(VENV)/run
	$(BIN)/midair demo --force

test: $(VENV)/dev
	$(PYTEST)

# The tests that need PortAudio, a sound server or Chromium, with these hidden: they are skipped, or pass without them.
BARE := $(BIN)/python -m pytest -p tests.hidden -q
test-bare: $(VENV)/dev
	$(BARE) -m "not slow" tests/devices/sensors/test_audio.py tests/study/test_headphones.py tests/rig/names
	$(BARE) -m browser tests/studio tests/view tests/rig/correction

# What runs before a change is called done: every suite, with a log of each in .suites and a table at the end.
test-all: $(VENV)/dev
	$(BIN)/python -m tests.suites

test-fast test-long test-kernels test-browser test-slow test-coverage: $(VENV)/dev
	$(BIN)/python -m tests.suites $(@:test-%=%)

check: lint docs

lint: $(VENV)/dev
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/pyright
	$(BIN)/lint-imports
	$(BIN)/typos README.md CHANGELOG.md CONTRIBUTING.md docs src examples

docs: $(VENV)/dev
	$(BIN)/sphinx-build --fail-on-warning --keep-going -q -b html docs docs/_build/html

# Addresses outside, which needs a network and the patience of others; `make docs` checks those inside.
links: $(VENV)/dev
	$(BIN)/sphinx-build -q -b linkcheck -D sphinx_gallery_conf.plot_gallery=0 docs docs/_build/links

bench: $(VENV)/dev
	$(BIN)/python -m benchmarks
	$(BIN)/python -m benchmarks.recordings
	$(BIN)/python -m benchmarks.playback
	$(BIN)/python -m benchmarks.air
	$(BIN)/python -m benchmarks.studio

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
	rm -rf $(VENV) .gpu .release dist demo docs/_build docs/gallery docs/reference .coverage* .suites .hypothesis .pytest_cache .ruff_cache
