# Only git, make and Python 3.11 or newer are needed. `make demo` and `make test` share .venv.

VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check
PINNED := --quiet --constraint constraints.txt
NPM := tests/browser/node_modules
# No package runs a script of its own when it is installed.
NPM_CI := npm ci --prefix tests/browser --ignore-scripts --no-audit --no-fund

.DEFAULT_GOAL := help
.PHONY: help demo test statistics soak mutants browser-tools lighthouse docs check format clean

help:
	@echo "make demo     run the quick-start protocol on the simulated bench and report it"
	@echo "make test     run the tests; ROOM=archive: of that room and those that import it; SLOW=1: all"
	@echo "make statistics  how often intervals hold, in thousands of draws (long; MINUTES=4 ends it)"
	@echo "make soak     wear: hundreds of kills, thousands of damaged files, a million frames (long)"
	@echo "make mutants  put small bugs into what keeps the bench safe: do the tests notice? (long)"
	@echo "make browser-tools  what tests of the page in a browser need from npm; they skip without"
	@echo "make lighthouse REPORT=FOLDER  scores of a report's page, served compressed"
	@echo "make docs     README and docs/ as a site, in build/site"
	@echo "make check    lint, formatting, types, import contracts"
	@echo "make format   put the code into the project's format"
	@echo "make clean    remove the environment and everything built (results/ stays)"

demo: $(VENV)/installed
	@echo "running protocols/quickstart.toml on the simulated bench"
	@run=$$($(BIN)/campaign run protocols/quickstart.toml --report) && report=$${run%.nxs}-report \
		&& echo "archive  $$run" && echo "report   $$report/report.html"

# Files stay whole, for what their tests share, in the order that tests/conftest.py gives them.
# A worker that died is not replaced: pytest-xdist would wait for ever for the rest of its file.
# A test that hangs tells where after 20 minutes, and ends its worker.
# A process of each core with as many threads of its own would wait for each other. Byte code is kept:
# half of what a worker needs until its first test is compiling.
PYTEST = PYTHONDONTWRITEBYTECODE= OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n auto --max-worker-restart 0
WHOLE_FILES = --dist loadfile --no-loadscope-reorder
HANGING = -o faulthandler_timeout=1200 -o faulthandler_exit_on_timeout=true

# Fast ones are what one runs before each commit; `.ci/run` has SLOW=1.
FAST = $(if $(SLOW),,-m "not slow and not soak and not statistics")

test: $(VENV)/installed-test
	tests=$(if $(ROOM),$$($(BIN)/python tests/rooms.py $(ROOM))) && $(PYTEST) $(WHOLE_FILES) $(HANGING) \
		$(FAST) $$tests $(PYTEST_OPTIONS)

# MINUTES=... ends it then, with a sample that is another one for each commit.
statistics: $(VENV)/installed-test
	$(PYTEST) -m statistics $(PYTEST_OPTIONS) \
		$(if $(MINUTES),--minutes $(MINUTES) --draw "$$(git rev-parse HEAD)")

soak: $(VENV)/installed-test
	$(PYTEST) -m soak $(PYTEST_OPTIONS)

mutants: $(VENV)/installed-mutants
	$(BIN)/python tests/mutants/run.py $(MUTANTS_OPTIONS)

browser-tools: $(NPM)/.package-lock.json

lighthouse: $(VENV)/installed-test
	$(NPM_CI) --silent
	$(BIN)/python benchmarks/lighthouse.py $(REPORT)

# -n, -W: a link without a target fails.
docs: $(VENV)/installed-docs
	$(BIN)/sphinx-build -q -n -W --keep-going -c docs . build/site
	@cp build/site/README.html build/site/index.html && echo "build/site/index.html"

check: $(VENV)/installed-test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

format: $(VENV)/installed-test
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

clean:
	rm -rf $(VENV) $(NPM) build dist .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# Build tools are pinned as well, hence no isolated (unpinned) build environment.
$(VENV)/installed: $(VENV)/made pyproject.toml constraints.txt
	@echo "installing what builds the package: hatchling, editables"
	@$(PIP) install $(PINNED) hatchling editables
	@echo "installing campaign and what it needs (numpy, scipy, numba, h5py, matplotlib and others)"
	@$(PIP) install $(PINNED) --no-build-isolation --editable .
	@echo "installed in $(VENV)"
	@touch $@

$(VENV)/installed-test: $(VENV)/installed
	$(PIP) install $(PINNED) --no-build-isolation --editable ".[test]"
	@touch $@

$(VENV)/installed-docs: $(VENV)/installed
	$(PIP) install $(PINNED) --no-build-isolation --editable ".[docs]"
	@touch $@

# npm writes this file last; Lighthouse (dev) is large, and no test needs it.
$(NPM)/.package-lock.json: tests/browser/package.json tests/browser/package-lock.json
	$(NPM_CI) --omit=dev --silent
	@touch $@

$(VENV)/installed-mutants: $(VENV)/installed-test
	$(PIP) install $(PINNED) wheel  # what an old setuptools needs to build one of them
	$(PIP) install $(PINNED) --no-build-isolation --editable ".[mutants]"
	@touch $@

# PYTHON=... overrides the search. A candidate must run: a bare shim on the PATH is not enough.
$(VENV)/made:
	@for python in $(PYTHON) python3.13 python3.12 python3.11 python3 python; do \
		if $$python -c 'import ensurepip, sys, venv; sys.exit(sys.version_info < (3, 11))' \
			>/dev/null 2>&1; then \
			echo "making $(VENV) with $$($$python --version)"; \
			$$python -m venv --clear $(VENV) && touch $@ && exit 0; \
			exit 1; \
		fi; \
	done; \
	echo "No Python 3.11 or newer with venv was found on the PATH." >&2; \
	echo "Install one (on Debian: python3 and python3-venv) or say: make PYTHON=/path/to/python3" >&2; \
	exit 1
