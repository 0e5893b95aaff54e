# make study   install all packages and run the main study
# make test    install all packages and run the fast tests
# make docs    install all packages and build the site build/site/index.html
#
# The variable PYTHON, such as PYTHON=python3.13, selects another Python version.
# VENV=PATH selects another folder for the virtual environment.

PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
# the environment is created again if the Python version has changed
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

# the installation of the package compiles the C++ code
$(READY): $(EMPTY) $(CPP)
	$(BIN)/python -m pip install --quiet -e ".[all,mkl,dev]"
	@touch $@

clean:
	rm -rf $(VENV) build dist
	rm -f assembly/kernels/*.so stiffness/mesh/*.so
