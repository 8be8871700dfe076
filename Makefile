# make demo        a simulated arm and the node as two ROS 2 processes, estimate against truth
# make test        the tests
# make test-slow   the tests that take long, which make test leaves out
# make test-long   more of the same kinds, for a release (half an hour)
# make lint        ruff and mypy
# make bench       the benchmarks
# make docs        the documentation site, in site/
# make exam        the diagnosis on 200 robots that hide something; LEVEL=single, hard, pairs, healthy, outside or real
# make calibration how many of the causes told with a probability are true, over all levels of the exam
# Each builds .venv first if it is not there. PYTHON=/path/to/python3.12 chooses the interpreter.

VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
ROBOT ?=
# Processes that share the tests, a file each at a time.
JOBS ?= 2

# The matrices are small: more threads of BLAS would only wait for each other.
export OMP_NUM_THREADS ?= 1
export MPLBACKEND ?= Agg
export PYTHON

# Without bytecode pytest rewrites the assertions of every module anew: collection then takes three times as long.
unexport PYTHONDONTWRITEBYTECODE

# A sourced ROS installation brings libraries and packages of its own, which do not fit the wheels in .venv.
unexport AMENT_PREFIX_PATH LD_LIBRARY_PATH PYTHONPATH RMW_IMPLEMENTATION VIRTUAL_ENV _ROS_WHEELS_BOOTSTRAP_COMPLETE

.DEFAULT_GOAL := help
.PHONY: help venv demo test test-slow test-long lint docs bench exam calibration clean

help:
	@sed -n '1,10s/^# //p' Makefile

venv: $(READY)

$(READY): pyproject.toml setup.py setup.cfg .ci/environment
	@.ci/environment $(VENV)
	@touch $@

demo: $(READY)
	@$(BIN)/python -m sysid_ros.cli.demo $(if $(ROBOT),--robot $(ROBOT))

test: $(READY)
	@$(BIN)/python -m pytest -n $(JOBS) --dist loadfile

# pytest's exit code 5 says that no test carries the mark.
test-slow: $(READY)
	@$(BIN)/python -m pytest -m "slow and not long" -n $(JOBS) --dist loadfile || [ $$? -eq 5 ]

test-long: $(READY)
	@$(BIN)/python -m pytest -m "slow and long" -n $(JOBS) --dist worksteal

lint: $(READY)
	@failed=0; for tool in "ruff check ." "ruff format --check ." mypy; do echo "-- $$tool"; $(BIN)/$$tool || failed=1; done; exit $$failed

# NO_MKDOCS_2_WARNING: a notice about the future of its theme's makers, which is no warning about the pages.
docs: $(READY)
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet && echo "site/index.html"

# Short settings; benchmarks/README.md says how long the full ones take. Every one runs, whatever the ones before it say.
BENCHMARKS := "step_time.py --rounds 3" "replay_speed.py --repeat 2" "accuracy_arm.py --seeds 8 --long 2" "other_arms.py --seeds 2" \
	"rest_then_motion.py --seeds 1" "excitation.py --arm xarm6 --starts 1" "tracking.py --seeds 1" "frequency.py --seeds 2" "node_latency.py --seconds 20" "identify_speed.py --seconds 60" "identify_peers.py --seeds 4" \
	"subspace.py --seeds 5" "koopman.py --seeds 1" "ceiling.py --hidden 12 --healthy 6" "deepc.py --seeds 2" "notch.py --seeds 3"

bench: $(READY)
	@failed=0; for run in $(BENCHMARKS); do echo "== benchmarks/$$run"; $(BIN)/python benchmarks/$$run || failed=1; done; exit $$failed

LEVEL ?= single
exam: $(READY)
	@cd test && ../$(BIN)/python -m exam --level $(LEVEL)

# ROWS="a.json b.json": what the exam wrote with --json; without, 620 robots are examined, which takes hours.
ROWS ?=
calibration: $(READY)
	@cd test && ../$(BIN)/python -m exam.calibration $(if $(ROWS),--json $(abspath $(ROWS)))

clean:
	rm -rf $(VENV) build install log site *.egg-info .pytest_cache .mypy_cache .ruff_cache
