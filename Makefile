# `make demo` and `make test` each set everything up first; what is there already is not done again.
SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help
.PHONY: help demo test test-all mutants lint docs install engines wheel check-wheel clean
.DELETE_ON_ERROR:

VENV := .venv
PYTHON ?= $(shell for p in python3.11 python3.12 python3; do \
	$$p -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] < (3, 13))' 2>/dev/null && echo $$p && break; \
	done)
EXTRAS := dev,simulate

# Debian package:shared library. Open3D needs X11, GL, EGL, USB; OpenCV needs GLib; Pinocchio OpenMP; MuJoCo a GL driver.
LIBRARIES := libx11-6:libX11.so.6 libxcb1:libxcb.so.1 libgl1:libGL.so.1 libegl1:libEGL.so.1 libgl1-mesa-dri:- \
	libusb-1.0-0:libusb-1.0.so.0 libglib2.0-0:libglib-2.0.so.0 libgomp1:libgomp.so.1

help: ## show this list
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

demo: install ## reconstruct the shipped recording, export it, let a robot open it; leaves out/demo/report.html
	$(VENV)/bin/twin demo

PYTEST := OMP_NUM_THREADS=1 $(VENV)/bin/pytest -n 2 --dist loadfile --no-loadscope-reorder

test: install ## run the tests that take less than a second each
	$(PYTEST) --durations=50 --durations-min=1

test-all: install ## run these and the longer ones, as .ci/run does
	$(PYTEST) -m 'not slow' --durations=50 --durations-min=1

mutants: install ## plant faults one at a time and write which of them the tests notice (hours; stop it and go on at will)
	$(VENV)/bin/python -m benchmarks.mutants run

lint: install ## style, types, the order of the folders, sizes and repetition
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/mypy
	$(VENV)/bin/lint-imports
	$(VENV)/bin/python .ci/sizes.py

docs: $(VENV)/.docs ## the docs site with a reference from the docstrings: out/docs/index.html
	$(VENV)/bin/python docs/build.py

install: $(VENV)/.installed ## set up system libraries, .venv and packages

engines: install ## set up the programs that `twin check --engines all` asks, each in an environment of its own (about 3 GB)
	$(VENV)/bin/twin engines --install all

wheel: $(VENV)/.created ## build dist/funtwin-*.whl, which installs anywhere: pip install ./dist/funtwin-*.whl
	rm -rf build dist/funtwin-*.whl
	$(VENV)/bin/python -m pip install -q --progress-bar off -c constraints.txt setuptools
	$(VENV)/bin/python -m pip wheel -q --progress-bar off --no-deps --no-build-isolation -w dist .
	@rm -rf build
	@ls dist/funtwin-*.whl

check-wheel: wheel ## install the wheel in fresh environments and use it in another folder (3.11, 3.12)
	.ci/wheel dist/funtwin-*.whl

clean: ## remove what make and twin wrote here (not .venv)
	rm -rf out build dist .mypy_cache .ruff_cache .pytest_cache .import_linter_cache

$(VENV)/.installed: $(VENV)/.created pyproject.toml setup.py constraints.txt
	@echo "Installing the Python packages into $(VENV) (a few minutes, about 3 GB) ..."
	$(VENV)/bin/python -m pip install -q --progress-bar off -c constraints.txt setuptools
	$(VENV)/bin/python -m pip install -q --progress-bar off -c constraints.txt --no-build-isolation -e '.[$(EXTRAS)]'
	@touch $@

$(VENV)/.docs: $(VENV)/.installed
	$(VENV)/bin/python -m pip install -q --progress-bar off -c constraints.txt --no-build-isolation -e '.[docs]'
	@touch $@

$(VENV)/.created:
	@[ -n "$(PYTHON)" ] || { echo "No Python 3.11 or 3.12 found; install one, or name it: make PYTHON=/path/to/python"; exit 1; }
	@missing=""; \
	for entry in $(LIBRARIES); do \
		dpkg -s "$${entry%%:*}" >/dev/null 2>&1 || \
			/sbin/ldconfig -p 2>/dev/null | grep -F " $${entry##*:} " >/dev/null || \
			missing="$$missing $${entry%%:*}"; \
	done; \
	$(PYTHON) -c 'import ensurepip' 2>/dev/null || \
		missing="$$missing $$($(PYTHON) -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')"; \
	if [ -z "$$missing" ]; then \
		:; \
	elif ! command -v apt-get >/dev/null; then \
		echo "No apt-get here: please see that these Debian packages' libraries are installed:$$missing"; \
	elif [ "$$(id -u)" = 0 ]; then \
		echo "Installing system packages:$$missing"; \
		apt-get update -qq </dev/null; \
		DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $$missing </dev/null >/dev/null; \
	else \
		echo "System packages are missing. Run this, then make again:"; \
		echo "    sudo apt-get install -y$$missing"; \
		exit 1; \
	fi
	$(PYTHON) -m venv $(VENV)
	@touch $@
