# mirrorfold: `make demo` sets everything up and runs the demonstration; `make help` lists the rest.
# Needs python3 (3.11 or newer) with pip, make and a network.

VENV := .venv
PYTHON := $(VENV)/bin/python
READY := $(VENV)/.ready
DOCS_READY := $(VENV)/.ready-docs

# The uv on the PATH where there is one, else one of our own in .uv.
UV := $(shell command -v uv 2>/dev/null)
ifeq ($(UV),)
UV := .uv/bin/uv
UV_FILE := .uv/bin/uv
endif

# Tests run in as many processes, each file in one of them: `make test JOBS=4`.
JOBS := 2
SHARED = --numprocesses $(JOBS) --dist loadfile

# Linear algebra on one thread in each of them: threads of several processes spin while they wait for a core.
PYTEST = OPENBLAS_NUM_THREADS=1 $(PYTHON) -m pytest $(SHARED)

# How long to fuzz: `make fuzz MINUTES=60`.
MINUTES := 10

BENCHMARKS := focus cost_model fullwave raster looking touchstone from_file_to_report
LONG_BENCHMARKS := calibration synthetic_aperture diagnosis sensitivity

# Folders whose branches are counted, and the tests that count for them.
COVERED := detection tree folding scoring focusing io sweep
COVERING := $(foreach folder,$(filter-out sweep,$(COVERED)),tests/$(folder)) tests/corpus \
	tests/test_sweep.py tests/test_polarization.py

# Installs into a folder, for a version of Python, by a way to choose among versions; constraints.txt does not count.
define INSTALLED
$(UV) venv --quiet --clear --python '$(2)' $(1)
$(UV) pip install --quiet --python $(1)/bin/python --resolution $(3) --upgrade --editable '.[test]'
endef

.PHONY: help demo test test-replays test-quick test-timing test-nightly test-lowest test-newest test-nojit lint bench bench-long
.PHONY: coverage reproduced soak fuzz api docs clean
.DEFAULT_GOAL := help

help: ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## /  make \1\t/p' $(firstword $(MAKEFILE_LIST)) | expand -t 20

demo: $(READY) ## simulate the hidden corner, reconstruct it, score it; files in demo/
	$(VENV)/bin/mirrorfold demo --out demo

test: $(READY) ## run all tests but replays and those of measured times and memory
	$(PYTEST) -m "not replay and not timing"

test-replays: $(READY) ## replay the published experiments at small size, the examples, and the guides
	$(PYTEST) -m "replay and not timing"

test-timing: $(READY) ## compare measured times and memory, on an otherwise idle machine
	$(PYTHON) -m pytest -m timing

test-quick: $(READY) ## run the tests that take no more than a third of a second each
	$(PYTEST) -m "not slow and not timing"

test-nightly: $(READY) ## run all tests, property tests with new examples and ten times as many
	$(PYTEST) -m "not timing" --hypothesis-profile=nightly

# Old versions use what the newest ones of their own dependencies have deprecated.
test-lowest: | $(UV_FILE) ## run the quick tests with the oldest versions that pyproject.toml allows, in .venv-lowest
	$(call INSTALLED,.venv-lowest,3.11,lowest-direct)
	OPENBLAS_NUM_THREADS=1 .venv-lowest/bin/python -m pytest $(SHARED) -m "not slow and not timing" -W ignore::DeprecationWarning

test-newest: | $(UV_FILE) ## run the quick tests with the newest versions there are, in .venv-newest
	$(call INSTALLED,.venv-newest,>=3.11,highest)
	OPENBLAS_NUM_THREADS=1 .venv-newest/bin/python -m pytest $(SHARED) -m "not slow and not timing"

test-nojit: $(READY) ## run the tests of the kernels as plain Python: indices are checked, coverage sees the lines
	NUMBA_DISABLE_JIT=1 $(PYTHON) -m pytest -m nojit

coverage: $(READY) ## branches that the tests of the algorithm and of files take, 95 % or more of each folder; half an hour
	@rm -rf build/coverage && mkdir -p build/coverage
	$(PYTHON) -m coverage run -m pytest -q -m "not timing" $(COVERING)
	NUMBA_DISABLE_JIT=1 $(PYTHON) -m coverage run -m pytest -q -m nojit $(COVERING)
	$(PYTHON) -m coverage combine -q
	@set -e; for folder in $(COVERED); do echo "== $$folder"; \
	$(PYTHON) -m coverage report --include="src/mirrorfold/$$folder/*" --show-missing --skip-covered --fail-under=95; done

lint: $(READY) ## style, types and the direction of imports
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check .
	$(PYTHON) -m mypy
	$(VENV)/bin/lint-imports

bench: $(READY) ## time, memory and error of everything that should be fast
	@set -e; for name in $(BENCHMARKS); do echo "== benchmarks/$$name.py"; $(PYTHON) benchmarks/$$name.py; done

bench-long: $(READY) ## full-wave growth, and accuracy on families of random scenes; an hour or two
	$(PYTHON) benchmarks/fullwave.py --long
	$(PYTHON) -m mirrorfold benchmark --seeds 0:10 --method ours --method published -o build/benchmark
	@set -e; for name in $(LONG_BENCHMARKS); do echo "== benchmarks/$$name.py"; $(PYTHON) benchmarks/$$name.py; done

reproduced: $(READY) ## the published experiments at full size, and their section of the documentation; an hour or two
	@mkdir -p build
	$(VENV)/bin/mirrorfold reproduce all -o build/reproduced
	$(PYTHON) docs/reproduced.py build/reproduced

soak: $(READY) ## two hours of hard use: kills, full disks, damage, lost workers; ten minutes with QUICK=--quick
	$(PYTHON) benchmarks/soak.py $(QUICK)

fuzz: $(READY) ## damaged input of every kind for MINUTES=10; goes on where the last run has ended
	nice -n 10 $(PYTHON) benchmarks/fuzz.py --minutes $(MINUTES)

api: $(READY) ## compare the public face with that of the last release
	$(PYTHON) docs/public_face.py

docs: $(DOCS_READY) ## the documentation, in docs/_build/html; the examples run for its gallery
	MPLBACKEND=Agg $(PYTHON) -m sphinx -W --keep-going -q -d docs/_build/doctrees docs docs/_build/html
	@echo "open docs/_build/html/index.html"

clean: ## remove what make has made
	rm -rf build docs/_build docs/gallery docs/reference/generated
	rm -f docs/reference/commands.md docs/reference/json.md docs/reference/python.rst docs/development/dependencies.svg
	rm -f docs/explanation/index.md
	rm -rf $(VENV) .venv-lowest .venv-newest .uv demo dist .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
	find src tests benchmarks -name __pycache__ -type d -prune -exec rm -rf {} +

.uv/bin/uv:
	python3 -m pip install --quiet --disable-pip-version-check --target .uv uv
	@test -x $@ || { echo "uv was not installed to $@: check 'python3 -m pip --version'" >&2; exit 1; }

$(READY): pyproject.toml constraints.txt | $(UV_FILE)
	test -x $(PYTHON) || $(UV) venv --quiet --python '>=3.11' $(VENV)
	$(UV) pip install --quiet --compile-bytecode --python $(PYTHON) --constraint constraints.txt --editable '.[test]'
	$(PYTHON) -m compileall -q src/mirrorfold
	@touch $@

$(DOCS_READY): $(READY)
	$(UV) pip install --quiet --compile-bytecode --python $(PYTHON) --constraint constraints.txt --editable '.[docs]'
	@touch $@
