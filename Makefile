# make dock    install, check the machine, fly the default scenario
# make test    install, then lint, types, import rules and all tests
# make check   the same with the fast tests only
# make bench   how fast the closed loop runs here
# make clean   remove .venv and caches; flights in out/ stay
#
# Another Python: make PYTHON=python3.12 dock.   Another flight: make dock FLIGHT='still_air --seed 3'.

PYTHON ?= python3
FLIGHT ?= default
JOBS ?= 2
BIN := .venv/bin
INSTALLED := .venv/.installed

export MUJOCO_GL ?= egl

.PHONY: dock test check static bench install clean

dock: install
	@$(BIN)/dockair doctor
	@$(BIN)/dockair fly $(FLIGHT)

test: static
	$(BIN)/pytest -n $(JOBS) --benchmark-disable

check: static
	$(BIN)/pytest -n $(JOBS) --benchmark-disable -m "not slow"

static: install
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache

bench: install
	@$(BIN)/dockair bench

install: $(INSTALLED)

$(INSTALLED): pyproject.toml constraints.txt .ci/machine .ci/install
	@PYTHON="$(PYTHON)" .ci/machine
	@PYTHON="$(PYTHON)" .ci/install
	@touch $@

clean:
	rm -rf .venv build dist .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis .benchmarks .coverage MUJOCO_LOG.TXT
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
