# stripe workbench: `make demo` runs the whole experiment, `make test` the tests; both set up what they need first.
PYTHON ?= python3
VENV   := .venv
BUNDLE := .bundle-venv
BIN    := $(VENV)/bin
OUT    ?= demo
INPUTS ?= 100000

# small matrices: the threads of the linear algebra would only spin beside our own
export OPENBLAS_NUM_THREADS ?= 1
# the tests start hundreds of interpreters: none may have to compile the sources again
export PYTHONDONTWRITEBYTECODE :=

.PHONY: help setup demo test quick check bench fuzz bundle docs pictures clean

help:
	@echo "make setup     the environment in $(VENV) (a second call is quick)"
	@echo "make demo      the whole experiment on the virtual bench, to a report in $(OUT)/results/report"
	@echo "make test      all tests"
	@echo "make quick     the tests that need no rendered project, in a minute"
	@echo "make check     ruff, formatting and types"
	@echo "make bench     benchmarks against peers, to a table and plots in bench-results"
	@echo "make fuzz      mutated files for all readers, INPUTS of them; what fails is kept in tests/fuzz/corpus"
	@echo "make bundle    a folder that runs without Python, built and tried, in dist/stripe-workbench"
	@echo "make docs      the reference of the library and the gallery of examples, in build/docs"
	@echo "make pictures  the pictures of the help, from the finished project in $(OUT)"
	@echo "make clean     remove the environments and all that was built; $(OUT) and bench-results stay"

setup: $(VENV)/.ready $(VENV)/.kernels
	@:

# an environment, and what it is for: an extra of pyproject.toml
$(VENV)/.ready: EXTRA = dev
$(BUNDLE)/.ready: EXTRA = bundle
$(VENV)/.ready $(BUNDLE)/.ready: pyproject.toml packaging/setup.sh
	@sh packaging/setup.sh $(PYTHON) $(@D) $(EXTRA)
	@touch $@

# beside the checks, where make is told to do two things at once
$(VENV)/.kernels: $(VENV)/.ready
	@echo "Compiling the kernels for this processor, so that no command waits for that: a minute."
	@trial=$$(mktemp -d); $(BIN)/stripe-core demo $$trial/quick --scenario quick >/dev/null || true; rm -r $$trial
	@touch $@

demo: setup
	@echo "Simulating the reference experiment, calibrating both ways, judging the plane-table: about a minute."
	@$(BIN)/stripe-core demo $(OUT)
	@if [ -n "$$DISPLAY$$WAYLAND_DISPLAY" ] && [ -z "$$CI" ]; then $(BIN)/stripe-gui $(OUT); fi

test: setup
	@echo "Running all tests: about ten minutes on two cores."
	@$(BIN)/python -m pytest -n 3 --dist worksteal

# rooms of which few tests need a rendered project, and the rules of the house; without what takes longest there
QUICK := tests/test_architecture.py tests/core/geometry tests/core/patterns tests/core/numerics tests/core/decode \
	tests/core/reconstruct tests/core/evaluate tests/core/project tests/core/test_api.py \
	$(addprefix --ignore=tests/core/decode/test_,beats.py dense_words.py detours.py estimate.py flicker.py response.py) \
	--ignore=tests/core/reconstruct/test_texture.py

quick: setup
	@$(BIN)/python -m pytest -n 2 --dist worksteal -m "not rendered" $(QUICK)

check: $(VENV)/.ready
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: setup
	@echo "Installing the peers into .bench-venv, then all side by side: six to seven minutes if nothing else runs."
	@$(BIN)/python -m tests.benchmarks

fuzz: setup
	@LD_PRELOAD=$(wildcard /usr/lib/*/libc_malloc_debug.so.0) MALLOC_CHECK_=3 $(BIN)/python -m tests.fuzz --inputs $(INPUTS)

bundle: $(BUNDLE)/.ready
	@echo "Putting the bundle together, then trying it: about five minutes."
	@$(BUNDLE)/bin/python packaging/bundle.py

$(VENV)/.docs: $(VENV)/.ready
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e ".[docs]"
	@touch $@

# the copy takes what Sphinx writes beside its sources; a warning is an error
docs: setup $(VENV)/.docs
	@rm -rf build/docs build/docs-source && mkdir -p build && cp -r resources/docs build/docs-source
	@MPLBACKEND=agg $(BIN)/sphinx-build -W --keep-going -q build/docs-source build/docs
	@echo "build/docs/index.html"

pictures: setup
	@$(BIN)/python packaging/pictures.py $(OUT)

clean:
	rm -rf $(VENV) $(BUNDLE) .bench-venv build dist *.egg-info .mypy_cache .ruff_cache .pytest_cache
