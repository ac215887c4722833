# stripe workbench: `make demo` runs the whole experiment, `make test` the tests; both set up what they need first.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
STAMP  := $(VENV)/.ready
OUT    ?= demo

# small matrices: the threads of the linear algebra would only spin beside our own
export OPENBLAS_NUM_THREADS ?= 1

.PHONY: help setup demo test check bench bundle pictures clean

help:
	@echo "make setup   the environment in $(VENV) (a second call is quick)"
	@echo "make demo    the whole experiment on the virtual bench, to a report in $(OUT)/results/report"
	@echo "make test    all tests"
	@echo "make check   ruff, formatting and types"
	@echo "make bench   benchmarks against peers, to a table and plots in bench-results"
	@echo "make bundle  a folder that runs without Python, built and tried, in dist/stripe-workbench"
	@echo "make pictures  the pictures of the help, from the finished project in $(OUT)"

setup: $(STAMP)

$(STAMP): pyproject.toml packaging/setup.sh
	@sh packaging/setup.sh $(PYTHON) $(VENV)
	@touch $@

demo: setup
	@echo "Simulating the reference experiment, calibrating both ways, judging the plane-table: about two minutes."
	@$(BIN)/stripe-core demo $(OUT)
	@if [ -n "$$DISPLAY$$WAYLAND_DISPLAY" ] && [ -z "$$CI" ]; then $(BIN)/stripe-gui $(OUT); fi

test: setup
	@echo "Running all tests: about eight minutes on two cores."
	@$(BIN)/python -m pytest -n 2

check: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: setup
	@echo "Installing the peers into .bench-venv, then all side by side: six to seven minutes if nothing else runs."
	@$(BIN)/python -m tests.benchmarks

bundle: setup
	@echo "Building the bundle in .bundle-venv, then trying it: about ten minutes."
	@$(BIN)/python packaging/bundle.py

pictures: setup
	@$(BIN)/python packaging/pictures.py $(OUT)

clean:
	rm -rf $(VENV) build dist *.egg-info .mypy_cache .ruff_cache .pytest_cache
