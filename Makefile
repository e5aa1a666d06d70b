# Each target makes the virtual environment that it needs from pyproject.toml and nothing else.

PYTHON ?= $(shell command -v python3.11 || command -v python3)
BIN := .venv/bin
DEMO := demo

# The environment is made anew when the dependencies or the interpreter change, whatever the times of files say.
FINGERPRINT := $(shell { cat pyproject.toml $(wildcard setup.py); $(PYTHON) --version; } 2>&1 | cksum | tr ' ' '-')

# Tests on real meshes run where a checkout has them beside it.
ifneq ($(wildcard ../shared/meshes/index.tsv),)
export WEATHERCOAT_MESHES ?= $(abspath ../shared/meshes)
endif

.PHONY: help demo test test-all test-plain test-bounds golden coverage fuzz lint web docs bench charts venv dev clean

help:
	@echo "make demo      age a sign plate and say where to look"
	@echo "make test      run the tests (make test-all: the long ones too)"
	@echo "make golden    record anew what tests compare results with, after a change of results that is meant"
	@echo "make coverage  run the core's tests without the JIT, and say what they reach"
	@echo "make fuzz      damaged files and configs, runs at the bounds: for FUZZ_SECONDS=1200, from FUZZ_SEED (the date)"
	@echo "make lint      style, types and import contracts"
	@echo "make web       bundle the script of the viewer's pages anew, with Node"
	@echo "make docs      run the commands of the documentation again and refresh its pictures"
	@echo "make bench     time it, and put the figures into the documentation"
	@echo "make charts    measure accuracy and stability, and put the charts into the documentation"
	@echo "make clean     remove the environment, the demo and the caches"

venv: .venv/run-$(FINGERPRINT)
dev: .venv/dev-$(FINGERPRINT)

.venv/run-$(FINGERPRINT):
	$(PYTHON) -m venv --clear .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	@touch $@

.venv/dev-$(FINGERPRINT): | .venv/run-$(FINGERPRINT)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@

.venv/bench-$(FINGERPRINT): | .venv/run-$(FINGERPRINT)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[bench]'
	@touch $@

demo: venv
	@mkdir -p $(DEMO)
	$(BIN)/weathercoat sample sign -o $(DEMO)/sign.obj --overwrite
	$(BIN)/weathercoat run configs/standard.yaml $(DEMO)/sign.obj -o $(DEMO)/sign --overwrite
	@echo "Look at $(DEMO)/sign/preview.png, or open a .glb of $(DEMO)/sign/snapshots in any glTF viewer."

test: dev
	$(BIN)/python -m pytest --numprocesses auto

test-all: dev test-plain test-bounds
	$(BIN)/python -m pytest --numprocesses auto -m "long or not long"

# Kernels as plain Python with checked indices, measured; kernels that are compiled with checks. See docs/testing.md.
CORE_TESTS := tests/film tests/deform tests/stain tests/mesh tests/sim tests/test_checked.py
PLAIN_TESTS := tests/film tests/deform tests/stain $(addprefix tests/mesh/test_,$(addsuffix .py, \
	buckets dihedral frame halfedge order surface weld)) \
	$(addprefix tests/sim/test_,recorders.py small_runs.py) tests/test_checked.py

test-plain: dev
	$(BIN)/coverage erase
	NUMBA_DISABLE_JIT=1 $(BIN)/coverage run -m pytest --numprocesses auto -W error::RuntimeWarning $(PLAIN_TESTS)
	$(BIN)/coverage combine --quiet

test-bounds: dev
	NUMBA_BOUNDSCHECK=1 $(BIN)/python -m pytest --numprocesses auto $(CORE_TESTS)

# What tests/comparison/test_golden.py holds results against.
golden: venv
	@rm -rf build/golden && mkdir -p build/golden
	$(BIN)/weathercoat sample plate -o build/golden/plate.obj
	$(BIN)/weathercoat sample bracket -o build/golden/bracket.obj
	$(BIN)/weathercoat baseline record build/golden/baseline build/golden/plate.obj build/golden/bracket.obj \
		--faces 2000 --steps 200 --set snapshots.count=3
	@mkdir -p tests/golden
	cp build/golden/baseline/baseline.json tests/golden/

coverage: test-plain
	$(BIN)/coverage report --include "weathercoat/mesh/*,weathercoat/sim/*" --fail-under 0
	$(BIN)/coverage report

# Another seed each day, so that nightly runs see other files; a failing case is written out with its seed.
FUZZ_SECONDS ?= 1200
FUZZ_SEED ?= $(shell date -u +%Y%m%d)

fuzz: dev
	$(BIN)/python -m tests.fuzz all --seconds $(FUZZ_SECONDS) --seed $(FUZZ_SEED)

lint: dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# The script that `weathercoat view` puts into its pages; npm needs a network the first time.
web: web/node_modules
	cd web && node build.mjs

web/node_modules: web/package.json
	cd web && npm install --no-package-lock --no-audit --no-fund
	@touch $@

docs: venv
	$(BIN)/python docs/make.py

# Of the meshes of the paper's authors, those that lie beside the checkout.
PAPER_MESHES := $(wildcard $(addprefix $(WEATHERCOAT_MESHES)/,aki_Plane.obj aki_Curve2.obj aki_bunny2.obj))

bench: .venv/bench-$(FINGERPRINT)
	@mkdir -p build
	$(BIN)/weathercoat bench speed $(PAPER_MESHES) -o build/bench --overwrite
	$(BIN)/python docs/make.py speed --results build/bench

# Every benchmark that ends in charts of its own; each keeps its results in docs/ and fills its page.
CHARTS := accuracy convergence stability independence noise fidelity scenes

charts: .venv/bench-$(FINGERPRINT)
	@mkdir -p build
	for name in $(CHARTS); do \
		$(BIN)/weathercoat bench $$name -o build/$$name --overwrite && \
		$(BIN)/python docs/make.py $$name --results build/$$name || exit 1; \
	done

clean:
	rm -rf .venv $(DEMO) build .coverage* .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
