# Installation, tests, checks, documentation and benchmarks; requires Python 3.11 or newer, git and make.
.DEFAULT_GOAL := help
SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DELETE_ON_ERROR:

BIN := .venv/bin
HOST ?= 127.0.0.1
PORT ?= 8000
NAME ?= reconstruction
# Tests often wait for other processes, so one more than there are cores.
PROCESSES ?= $(shell n=$$(nproc); echo $$((n < 4 ? n + 1 : 4)))
export PIP_DISABLE_PIP_VERSION_CHECK := 1
# Tests and jobs start hundreds of Python processes, and each would compile all sources again.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help install compiled install-dev install-tests install-docs demo test test-all serve lint tables docs bench bench-device reproduce mutants release lock clean

help: ## list the targets
	@echo "Bentray: make TARGET"
	@awk -F ':.*## ' '/^[a-z-]+:.*## /{printf "  %-12s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

install: .venv/.installed ## create .venv and install Bentray into it, once
install-dev: .venv/.installed-dev ## the same with the tools for tests and checks
install-docs: .venv/.installed-docs ## the same with the tools for the documentation

demo: install ## simulate a scan, reconstruct it on a service by rays and full waveforms (two minutes the first time)
	@echo "Running bentray demo"
	@$(BIN)/bentray demo

serve: install ## start the service; HOST=127.0.0.1 PORT=8000
	@$(BIN)/bentray serve --host $(HOST) --port $(PORT)

# Threads of one matrix product wait for each other spinning, and all cores are taken by tests already.
test test-all: export OPENBLAS_NUM_THREADS = 1
test: install-tests ## run the tests, up to four files at once; ARGS="tests/kernels -x" narrows them
	@$(BIN)/python -m pytest -n $(PROCESSES) --dist loadfile --no-loadscope-reorder -m "not nightly" $(ARGS)

test-all: install-tests ## run the tests, with the long searches and the soak tests; ARGS as above
	@HYPOTHESIS_PROFILE=nightly $(BIN)/python -m pytest -n $(PROCESSES) --dist loadfile --no-loadscope-reorder $(ARGS)

lint: install-dev ## check style, types and the import rules
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-logo

tables: install ## write the tables of docs/ that come from the code: settings, commands, REST, formats
	@cd docs && ../$(BIN)/python -m from_code

docs: install-docs ## build the documentation into build/docs, with the gallery; warnings are errors
	@$(BIN)/python -m sphinx -W --keep-going -q -b html -d build/doctrees docs build/docs
	@echo "Documentation: build/docs/index.html"

bench: install ## run the benchmark NAME; NAME=reconstruction ARGS=--quick
	@mkdir -p build/bench
	@$(BIN)/bentray bench $(NAME) $(ARGS) --json build/bench/$(NAME).json --pictures build/bench

reproduce: install ## measure every table and figure of chapters 3 to 7 of the dissertation into build/reproduce/report.html (about 90 minutes; continues a run that was ended); ARGS="--only chapter4"
	@$(BIN)/bentray bench dissertation -o build/reproduce $(ARGS)

bench-device: install ## measure each engine and whole reconstructions on the OpenCL device of this machine; ARGS=--quick on a processor
	@mkdir -p build/bench
	@$(BIN)/bentray bench devices $(ARGS) --json build/bench/devices.json

mutants: install-tests ## plant faults in the numerics by Cosmic Ray and run the nearest tests (hours); ARGS="--count 20" narrows it, ARGS="--part service" takes the service
	@test -x build/mutants/venv/bin/cosmic-ray || { $(BIN)/python -m venv build/mutants/venv && \
	  build/mutants/venv/bin/pip install -q 'cosmic-ray>=8.7,<9'; }
	@build/mutants/venv/bin/python tests/mutants.py $(ARGS)

release: docs ## build wheel, sdist, bill of materials and checksums into dist/
	@rm -rf dist
	@set -e; export SOURCE_DATE_EPOCH=$$(git log -1 --format=%ct) BENTRAY_DOCUMENTATION=build/docs; \
	  $(BIN)/python -m hatchling build -d dist -t sdist -t wheel; \
	  $(BIN)/python deploy/sbom.py > dist/bentray.cdx.json
	@cd dist && sha256sum -- * > SHA256SUMS && cat SHA256SUMS

lock: ## update the lock files (needs uv on the PATH)
	@command -v uv >/dev/null || { echo "make lock needs uv: pip install uv" >&2; exit 1; }
	$(call compile,requirements.lock,--extra build --extra export --extra postgres pyproject.toml)
	$(call compile,requirements-image.lock,--extra build --extra export --extra postgres --extra slurm --extra kubernetes --extra otel $(foreach name,$(OF_CONTROLLER),--no-emit-package $(name)) -c requirements.lock pyproject.toml)
	$(call compile,requirements-dev.lock,--extra build --extra export --extra postgres --extra test --extra lint -c requirements.lock pyproject.toml)
	$(call compile,requirements-docs.lock,--extra build --extra export --extra postgres --extra docs -c requirements-dev.lock pyproject.toml)
	$(call compile,requirements-generator.lock,--group generator)

clean: ## remove build outputs, caches and .venv
	rm -rf .venv build dist demo-output .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	find kernels workers service tests benchmarks -name __pycache__ -prune -exec rm -rf {} +

# Requirements of the Dask operator itself, 0.1 GB, that its clients do not import; the image has the client alone.
OF_CONTROLLER = kubernetes kubernetes-asyncio kopf pykube-ng durationpy oauthlib python-json-logger requests-oauthlib \
  websocket-client

# The lock files contain the wheels of every platform (--universal) and no index address, so they work with any mirror.
define compile
uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-config \
  --no-emit-index-url --no-annotate --no-header $(2) -o $(1)
endef

# The newest usable Python on the PATH: 3.11 or newer, with venv and ensurepip.
.venv/bin/python:
	@for python in python3.14 python3.13 python3.12 python3.11 python3; do \
	  if $$python -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then \
	    echo "Creating .venv with $$($$python --version), a few seconds"; \
	    $$python -m venv .venv & venv=$$!; \
	    while sleep 2; kill -0 $$venv 2> /dev/null; do echo "  $$SECONDS s"; done; wait $$venv; exit; \
	  fi; \
	done; \
	echo "Bentray requires Python 3.11 or newer with the venv module; none was found on the PATH." >&2; \
	echo "On Debian or Ubuntu: apt-get install python3 python3-venv" >&2; exit 1

# Kernels are compiled while the tools are downloaded: both need the packages of Bentray only.
install-tests: install
	@$(MAKE) --no-print-directory -j2 install-dev compiled

# Once, in two processes: test processes that start together would each compile the same kernels.
compiled: install
	@$(BIN)/python -m bentray_workers.compilation.precompile

# A lock file is complete, so pip resolves nothing; Python compiles the modules that it imports, not all.
PINNED = $(BIN)/pip install -q --no-deps --no-compile --require-hashes

# Install a lock file, with a line every two seconds: pip itself is silent for a minute.
define installed
@$(PINNED) -r $(1) & pip=$$!; \
  while sleep 2; kill -0 $$pip 2> /dev/null; do \
    echo "  $$(find .venv/lib -maxdepth 3 -name '*.dist-info' | wc -l) of $$(grep -c == $(1)) packages, $$SECONDS s"; \
  done; wait $$pip
endef

.venv/.installed: requirements.lock pyproject.toml | .venv/bin/python
	@echo "Installing the packages of requirements.lock (about a minute the first time)"
	$(call installed,requirements.lock)
	@echo "Installing Bentray itself"; $(BIN)/pip install -qq --no-deps --no-build-isolation -e .
	@touch $@

.venv/.installed-dev: requirements-dev.lock .venv/.installed
	@echo "Installing the tools for tests and checks"
	$(call installed,requirements-dev.lock)
	@touch $@

.venv/.installed-docs: requirements-docs.lock .venv/.installed
	@echo "Installing the tools for the documentation"
	$(call installed,requirements-docs.lock)
	@touch $@
