# make study   install everything and run the main study
# make test    install everything and run the fast tests
# make docs    install everything and build the site, build/site/index.html
#
# Variables: PYTHON=python3.13 selects another Python; VENV=PATH selects another folder
# for the environment.

PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
# an environment of another Python version is created again
VERSION := $(shell $(PYTHON) -c 'import sys; print("%d.%d" % sys.version_info[:2])')
EMPTY := $(VENV)/empty-$(VERSION)
READY := $(VENV)/ready-$(VERSION)
CPP := CMakeLists.txt $(wildcard assembly/kernels/*.cpp assembly/kernels/*.h \
    assembly/kernels/*/*.cpp assembly/kernels/*/*.h stiffness/mesh/*.cpp)

.PHONY: study test test-slow check docs clean

study: $(READY)
	$(BIN)/forcefit study examples/irsbot2.toml

test: $(READY)
	$(BIN)/python -m pytest -n auto -m "not slow"

test-slow: $(READY)
	$(BIN)/python -m pytest -n auto -m slow

check: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports --no-cache --no-logo
	$(BIN)/mypy
	$(BIN)/python .ci/plain_words.py

docs: $(READY)-docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --strict

$(READY)-docs: $(READY)
	$(BIN)/python -m pip install --quiet -e ".[docs]"
	@touch $@

$(EMPTY): pyproject.toml
	@sh .ci/system_packages
	$(PYTHON) -m venv --clear $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	@touch $@

# installing the package compiles the C++ code
$(READY): $(EMPTY) $(CPP)
	$(BIN)/python -m pip install --quiet -e ".[all,mkl,dev]"
	@touch $@

clean:
	rm -rf $(VENV) build dist
	rm -f assembly/kernels/*.so stiffness/mesh/*.so
