# make study   set everything up and run the main job
# make test    set everything up and run the tests
# make docs    set everything up and build the site, build/site/index.html

PYTHON ?= python3
BIN := .venv/bin

.PHONY: study test test-slow check docs clean

study: .venv/ready
	$(BIN)/forcefit study examples/irsbot2.toml

test: .venv/ready
	$(BIN)/python -m pytest -n auto -m "not slow"

test-slow: .venv/ready
	$(BIN)/python -m pytest -n auto -m slow

check: .venv/ready
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

docs: .venv/docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --strict

.venv/docs: .venv/ready
	$(BIN)/python -m pip install --quiet -e ".[docs]"
	@touch $@

.venv/ready: pyproject.toml
	@sh .ci/system_packages
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet -e ".[dev]"
	@touch $@

clean:
	rm -rf .venv build dist
