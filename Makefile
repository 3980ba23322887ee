PYTHON ?= python3.11
BIN := .venv/bin
READY := .venv/.ready
# One process for each core: tests of buses answer in real time, and fail where they wait for others.
PROCESSES = $(shell $(BIN)/python -c "import os; print(os.cpu_count())")
SIDE_BY_SIDE = --numprocesses $(PROCESSES) --dist loadfile --no-loadscope-reorder --durations 30

.PHONY: setup demo test test-all installed lint bench faults fuzz loop sweep pages model clean

help:           ## Say what can be made
	@grep -E '^[a-z-]+: .*##|^[a-z-]+:  .*##' $(MAKEFILE_LIST) | sed 's/:.*##/ —/'

setup: $(READY)  ## Make .venv with the pinned dependencies

$(READY): requirements.lock pyproject.toml
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --progress-bar on --requirement requirements.lock
	$(BIN)/python -m pip install --quiet --no-deps --editable .
	touch $@

demo: setup  ## Find what is wrong with a robot from its logs, look at the arm: some four minutes, results in demo/
	$(BIN)/python -m experiments.demo --out demo

test: setup lint  ## What CI runs: lint, types, the tests without the slow ones
	$(BIN)/python -m pytest -m "not slow" $(SIDE_BY_SIDE)

test-all: setup lint  ## The slow tests, too, before a release: whole traces, the demo; some fifty minutes
	$(BIN)/python -m pytest $(SIDE_BY_SIDE)

installed: setup  ## Build the wheel, install it without extras elsewhere, run the main job: a minute
	PYTHON=$(PYTHON) .ci/installed

lint: setup  ## ruff, the layers of imports, pyright
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	$(BIN)/pyright --pythonpath $(BIN)/python

bench: setup  ## Speed and memory, as ratios against bare MuJoCo
	$(BIN)/python -m benchmarks --out bench

faults: setup  ## Every fault of the bus through the collect loop: some five minutes
	$(BIN)/python -m experiments.fault_matrix --out fault_matrix

fuzz: setup  ## Damaged packets and files, 10,000 of each source: some ten minutes
	$(BIN)/python -m experiments.fuzz --out out/fuzz

loop: setup  ## Find what the twin lacks of the arm in data/: some four minutes
	$(BIN)/python -m experiments.close_the_loop --logs data --out close_the_loop

sweep: setup  ## What stiffness does, in a few short points: some two minutes
	$(BIN)/python -m experiments.stiffness_sweep --quick --logs data --out out/stiffness_sweep

pages: setup  ## Write docs/results/ again from the results beside them, and the pages of keys from their schemas
	$(BIN)/python -m experiments.result_page
	$(BIN)/python -m experiments.reference_pages

model: setup  ## Write model/ anew after a change of numbers or shapes
	$(BIN)/python -m serpent_twin.mjcf

clean:  ## Remove the environment and the demo
	rm -rf .venv demo
