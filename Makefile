# Two commands for a newcomer: `make demo` and `make test`.
SHELL := /bin/bash
PYTHON ?= python3
BIN := .venv/bin
DEMO := demo
SOURCES := src tests benchmarks examples
# Another index for PyTorch: on Linux PyPI's wheels bring CUDA along, gigabytes that serve no machine without a GPU.
#   make setup TORCH_INDEX=https://download.pytorch.org/whl/cpu
TORCH_INDEX ?=
INSTALL := $(BIN)/python -m pip install --quiet --constraint constraints.txt \
  $(if $(TORCH_INDEX),--extra-index-url $(TORCH_INDEX))

.PHONY: demo test test-matrix check docs format bench setup clean

setup: .venv/complete

# What the demo needs.
.venv/ready: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(INSTALL) --editable '.[dm-control,tensorboard]'
	bash scripts/opengl.sh $(BIN)/python
	touch .venv/ready

# Also every extra, linters and tests.
.venv/complete: .venv/ready
	$(INSTALL) --editable '.[dev]'
	touch .venv/complete

# Expert videos in, a reward, a policy and a report out: about 15 minutes on 2 cores.
demo: .venv/ready
	$(BIN)/bootifol demos record --task reacher_hard --episodes 700 --out $(DEMO)/videos --workers 2
	@if [ -f $(DEMO)/run/config.json ]; then \
	  $(BIN)/bootifol train --resume $(DEMO)/run; \
	else \
	  $(BIN)/bootifol train --task reacher_hard --preset demo --time-budget 9m \
	    --demos $(DEMO)/videos --out $(DEMO)/run; \
	fi
	@echo "open $(DEMO)/run/report.html in a browser"

# Lint, types, the site's links, all tests; a file to a worker, the slow ones first (tests/conftest.py).
test: check docs
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest --numprocesses 2 --dist loadfile --no-loadscope-reorder

check: .venv/complete
	$(BIN)/ruff check $(SOURCES)
	$(BIN)/ruff format --check $(SOURCES)
	$(BIN)/mypy

# The site, in site/.
docs: .venv/complete
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet --site-dir site

format: .venv/complete
	$(BIN)/ruff check --fix $(SOURCES)
	$(BIN)/ruff format $(SOURCES)

# Every Python at hand, newest and lowest versions, in empty environments (gigabytes: see the script).
test-matrix: .venv/complete
	$(BIN)/python scripts/test_matrix.py

bench: .venv/complete
	$(BIN)/python -m benchmarks.engine
	$(BIN)/python -m benchmarks.states

clean:
	rm -rf .venv demo
