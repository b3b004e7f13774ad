# The workshop: every target installs what it needs and says what it does. `make help` lists them.
#
#   make PYTHON=python3.13 test                       another interpreter (3.11 or newer)
#   make VENV_FLAGS=--system-site-packages demo       lets .venv see apt's Python packages (libcamera's bindings)
#   make TORCH_INDEX=https://download.pytorch.org/whl/cpu train      PyTorch without several GB of CUDA, on x86 Linux

SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DELETE_ON_ERROR:
.DEFAULT_GOAL := help

PYTHON ?= python3
VENV_FLAGS ?=
TORCH_INDEX ?=
DEMO_FLAGS ?=
TRAIN_FLAGS ?=
HARDWARE_FLAGS ?=
AARCH64_FLAGS ?=
AARCH64_DEMO_FLAGS ?=
FUZZ_FLAGS ?=
SYSTEM_TESTS ?= tests/system --ignore=tests/system/test_quick_start.py
PYTEST_FLAGS ?=
LAB_TESTS := tests/archive tests/fleet tests/nut tests/vehicle tests/cli/test_cli_nut_drive.py tests/sim/test_world_drive.py
export PYTHON VENV_FLAGS TORCH_INDEX

BIN := .venv/bin
LOCKED := pyproject.toml constraints.txt .ci/install
say = @printf '\n== %s\n' "$(1)"

.PHONY: help demo test lab-check lint format train train-driver hardware hardware-check docs-check install-check docs docs-pages docs-links fuzz screenshots aarch64-check system-test quick-start-test lock clean

help: ## List the targets
	@grep -E '^[a-z0-9-]+:.*## ' $(MAKEFILE_LIST) | awk -F ':.*## ' '{ printf "  make %-14s %s\n", $$1, $$2 }'

demo: .venv/.demo-installed ## A simulated race: live board, recording and report; no camera, no config
	$(call say,dnb-edge demo)
	@$(BIN)/dnb-edge demo $(DEMO_FLAGS)

test: lint ## Lint, then the product's tests on two cores (three at once: some wait for a clock); see the other checks below
	$(call say,pytest)
	@OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/pytest -q -n 3 --ignore=tests/docs --ignore=tests/install $(LAB_TESTS:%=--ignore=%) $(PYTEST_FLAGS)

lab-check: .venv/.test-installed ## Networks under test, the closed loop, vehicles, fleets and archives: tests that start many processes
	$(call say,pytest $(LAB_TESTS))
	@OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/pytest -q -n 2 $(PYTEST_FLAGS) $(LAB_TESTS)

docs-check: .venv/.test-installed ## The documentation: its site, links, pictures, made pages, and its examples run
	$(call say,pytest tests/docs)
	@OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/pytest -q -n 2 $(PYTEST_FLAGS) tests/docs

install-check: .venv/.test-installed ## install.sh in folders that stand for machines: upgrades, faults, the way back
	$(call say,pytest tests/install)
	@$(BIN)/pytest -q -n 2 $(PYTEST_FLAGS) tests/install

lint: .venv/.test-installed ## Style, format, types and the direction of imports
	$(call say,ruff check)
	@$(BIN)/ruff check .
	$(call say,ruff format --check)
	@$(BIN)/ruff format --check .
	$(call say,mypy)
	@$(BIN)/mypy
	$(call say,lint-imports)
	@$(BIN)/lint-imports --no-logo

format: .venv/.test-installed ## Format the code and mend what ruff can mend
	@$(BIN)/ruff check --fix .
	@$(BIN)/ruff format .

train: .venv/.train-installed ## Train the detector anew (installs PyTorch: see TORCH_INDEX above)
	$(call say,python -m dnb_edge.train)
	@$(BIN)/python -m dnb_edge.train $(TRAIN_FLAGS)

train-driver: .venv/.train-installed ## Train the driving network anew into build/driver (a quarter of an hour; PyTorch as above)
	$(call say,python -m dnb_edge.train.driver)
	@$(BIN)/python -m dnb_edge.train.driver --out build/driver $(TRAIN_FLAGS)

hardware: .venv/.hardware-installed ## The kit's printable parts: STL, STEP, drawings and pictures in build/hardware
	$(call say,python -m hardware build)
	@$(BIN)/python -m hardware build $(HARDWARE_FLAGS)

hardware-check: .venv/.hardware-installed ## Whether all parts can be printed and docs/ shows them as they are
	$(call say,python -m hardware check)
	@$(BIN)/python -m hardware check
	$(call say,pytest tests/hardware)
	@$(BIN)/pytest -q -n 2 tests/hardware

docs: .venv/.docs-installed ## The documentation as a site in build/site, to be read without a network; every inside link is checked
	$(call say,sphinx-build)
	@rm -rf build/site
	@$(BIN)/sphinx-build -q -E -W --keep-going -c docs -d build/site-doctrees . build/site
	@$(BIN)/python docs/tools/check_site.py build/site --outside build/site-outside-links.txt

docs-pages: .venv/.docs-installed ## Write the pages that are made from code (config.md, commands.md, troubleshooting.md) and the guides' drawings
	@$(BIN)/python docs/tools/write_pages.py
	@$(BIN)/python docs/tools/guides_pictures.py
	@$(BIN)/python docs/tools/kit_pictures.py
	@$(BIN)/python docs/tools/display_pictures.py

docs-links: .venv/.docs-installed ## Try the documentation's links to other sites (needs a network)
	$(call say,sphinx-build -b linkcheck)
	@$(BIN)/sphinx-build -q -b linkcheck -c docs -d build/site-doctrees . build/site-links

fuzz: .venv/.test-installed ## 100 000 damaged recordings, configurations, calibrations and model cards (a quarter of an hour)
	$(call say,tests/fuzz/fuzz.py)
	@$(BIN)/python tests/fuzz/fuzz.py $(FUZZ_FLAGS)

screenshots: .venv/.test-installed ## Pictures of every page on phone and projector sizes, in build/screenshots (Chromium; five minutes)
	$(call say,tests/web/screenshots.py)
	@PYTHONPATH=tests/web $(BIN)/python tests/web/screenshots.py build/screenshots

aarch64-check: .venv/.test-installed ## The model, the race and the installed demo here and on a Pi's processors, emulated (Linux, root, an hour)
	$(call say,tests/system/aarch64_output.py)
	@$(BIN)/python tests/system/aarch64_output.py $(AARCH64_FLAGS)
	$(call say,tests/system/aarch64_core.py)
	@$(BIN)/python tests/system/aarch64_core.py $(AARCH64_FLAGS)
	$(call say,tests/system/aarch64_demo.py)
	@$(BIN)/python tests/system/aarch64_demo.py $(AARCH64_DEMO_FLAGS)

system-test: .venv/.test-installed ## The appliance in a virtual machine with a played USB webcam: races and faults (Linux, root, qemu; 25 minutes)
	$(call say,pytest tests/system)
	@$(BIN)/pytest -n 0 -v -p no:cacheprovider -o log_cli=true -o log_cli_level=INFO -o log_cli_format='%(asctime)s %(message)s' \
	    -o log_cli_date_format=%H:%M:%S --durations=0 $(PYTEST_FLAGS) $(SYSTEM_TESTS)

quick-start-test: ## The quick start's own commands in a clean Debian 13, as system-test (ten minutes)
	@$(MAKE) --no-print-directory system-test SYSTEM_TESTS=tests/system/test_quick_start.py

lock: ## Resolve all dependencies anew into constraints.txt
	@.ci/lock

clean: ## Remove what these targets made; recordings under runs/ stay
	rm -rf .venv build dist *.egg-info .mypy_cache .ruff_cache .pytest_cache .import_linter_cache .grimp_cache .hypothesis
	find dnb_edge tests -name __pycache__ -type d -prune -exec rm -rf {} +

.venv/.%-installed: $(LOCKED)
	@.ci/install $*
	@touch $@
