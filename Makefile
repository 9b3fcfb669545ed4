# Everything a clone needs, with nothing but Python 3.11 or newer, git and make.
.DEFAULT_GOAL := help
SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DELETE_ON_ERROR:

BIN := .venv/bin
HOST ?= 127.0.0.1
PORT ?= 8000
NAME ?= reconstruction
export PIP_DISABLE_PIP_VERSION_CHECK := 1
# Tests and jobs start some hundred Pythons: each would compile all our sources anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help install install-dev install-docs demo test test-all serve lint docs bench lock clean

help: ## list the targets
	@echo "Bentray: make TARGET"
	@awk -F ':.*## ' '/^[a-z-]+:.*## /{printf "  %-12s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

install: .venv/.installed ## make .venv and install Bentray into it, once
install-dev: .venv/.installed-dev ## the same with what tests and checks need
install-docs: .venv/.installed-docs ## the same with what builds the pages

demo: install ## simulate a scan, send it to a service, compare straight and bent rays (three minutes the first time)
	@$(BIN)/bentray demo

serve: install ## start the service; HOST=127.0.0.1 PORT=8000
	@$(BIN)/bentray serve --host $(HOST) --port $(PORT)

test: install-dev ## run the tests, up to four files at once; ARGS="tests/kernels -x" narrows them
	@$(BIN)/python -m pytest -n auto --maxprocesses 4 --dist loadfile --no-loadscope-reorder -m "not nightly" $(ARGS)

test-all: install-dev ## run the tests, then the long searches and the soak; ARGS as above
	@HYPOTHESIS_PROFILE=nightly $(BIN)/python -m pytest -n auto --maxprocesses 4 --dist loadfile --no-loadscope-reorder $(ARGS)

lint: install-dev ## check style, types and the import rules
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-logo

docs: install-docs ## build the pages of docs/ into build/docs; a warning is an error
	@$(BIN)/python -m sphinx -W --keep-going -q -b html docs build/docs
	@echo "The documentation: build/docs/index.html"

bench: install ## run the benchmark NAME; NAME=reconstruction ARGS=--quick
	@mkdir -p build/bench
	@$(BIN)/bentray bench $(NAME) $(ARGS) --json build/bench/$(NAME).json

lock: ## compile the lock files anew (needs uv on the PATH)
	@command -v uv >/dev/null || { echo "make lock needs uv: pip install uv" >&2; exit 1; }
	$(call compile,requirements.lock,--extra build --extra postgres --extra s3 pyproject.toml)
	$(call compile,requirements-dev.lock,--extra build --extra postgres --extra s3 --extra test --extra lint -c requirements.lock pyproject.toml)
	$(call compile,requirements-docs.lock,--extra build --extra postgres --extra s3 --extra docs -c requirements-dev.lock pyproject.toml)
	$(call compile,requirements-generator.lock,--group generator)

clean: ## remove what was built or written here, .venv too
	rm -rf .venv build dist demo-output .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	find kernels workers service tests benchmarks -name __pycache__ -prune -exec rm -rf {} +

# The lock holds every platform's wheels (--universal) and no address, so that it works behind any mirror.
define compile
uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-config \
  --no-emit-index-url --no-annotate --no-header $(2) -o $(1)
endef

# The newest Python on the PATH that starts, is 3.11 or newer and can make an environment with pip in it.
.venv/bin/python:
	@for python in python3.14 python3.13 python3.12 python3.11 python3; do \
	  if $$python -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then \
	    echo "Making .venv with $$($$python --version)"; exec $$python -m venv .venv; \
	  fi; \
	done; \
	echo "Bentray needs Python 3.11 or newer with its venv module; none was found on the PATH." >&2; \
	echo "On Debian or Ubuntu: apt-get install python3 python3-venv" >&2; exit 1

.venv/.installed: requirements.lock pyproject.toml | .venv/bin/python
	@echo "Installing what requirements.lock names (about a minute the first time)"
	@$(BIN)/pip install -qq --require-hashes -r requirements.lock
	@$(BIN)/pip install -qq --no-deps --no-build-isolation -e .
	@touch $@

.venv/.installed-dev: requirements-dev.lock .venv/.installed
	@echo "Installing the tools for tests and checks"
	@$(BIN)/pip install -qq --require-hashes -r requirements-dev.lock
	@touch $@

.venv/.installed-docs: requirements-docs.lock .venv/.installed
	@echo "Installing what builds the documentation"
	@$(BIN)/pip install -qq --require-hashes -r requirements-docs.lock
	@touch $@
