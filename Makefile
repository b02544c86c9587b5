SHELL := bash
# The Python of a complete .venv stays, unless another one is named: make PYTHON=python3.12 test
PYTHON ?= $(if $(wildcard .venv/.installed-*),.venv/bin/python,python3)
VERSION := $(shell $(PYTHON) -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null)
BIN := .venv/bin
INSTALLED := .venv/.installed-$(VERSION)
WEB := .venv/.web-$(VERSION)
SIMULATORS := .venv-simulators/.installed
RLLIB := .venv-rllib/.installed
TOOLS := .venv-tools/.installed
PYTHONS := 3.10 3.11 3.12 3.13 3.14 3.15
# What continuous integration runs. docs and smoke come first, because tests use the page and the simulators.
CI := docs smoke test slow tools rllib web dist arm pythons
# make ci WITHOUT="web arm": no browser and no qemu are installed.
WITHOUT ?=
CORE := tests/shots/test_result.py tests/engine/test_reference.py tests/shots/test_batch.py tests/envs/test_billiards.py tests/envs/test_tasks.py tests/test_main.py
ARGS ?= --players human,search:20
# make results ADDRESS=auto: a Ray cluster does the work of results and study.
ADDRESS ?=
SPREAD := $(if $(ADDRESS),--address $(ADDRESS))
WORK := $(if $(ADDRESS),.venv-rllib/bin,$(BIN))
WORKS := $(if $(ADDRESS),$(RLLIB),$(INSTALLED))

.PHONY: help train play test fast slow pythons tools page web docs machines arm dist ci smoke stress lint bench errors results study rllib figures format clean

help:  ## show this list
	@grep -E '^[a-z]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 10

train: $(INSTALLED)  ## train the example agent (resumes, if interrupted), compare it with others, and film it
	$(BIN)/python -m agents.train pot
	$(BIN)/python -m agents.train pot_mlp
	$(BIN)/python -m agents.evaluate runs/pot --film runs/pot/film.mp4
	$(BIN)/python -m agents.evaluate runs/pot runs/pot_mlp --episodes 10000 --players search:200 --curve runs/pot/curve.png

play: $(INSTALLED)  ## play against the computer in a window, e.g. make play ARGS="--rules carom --players human,human"
	$(BIN)/python -m billiards_env.play $(ARGS)

test: lint fast  ## lint, type check, then run the fast tests and the doctests

fast: $(INSTALLED)  ## the fast tests and the doctests
	$(BIN)/pytest -n 2 --dist worksteal -q

slow: $(INSTALLED)  ## the slow tests
	$(BIN)/pytest -n 2 --dist worksteal -q -m slow

pythons:  ## test the core (shots, batches, the environment, commands) on each installed Python from 3.10 to 3.15
	@for v in $(PYTHONS); do \
	    if ! python$$v -c '' 2>/dev/null; then ran="$$ran\n$$v is not installed"; continue; fi; \
	    make --no-print-directory .venv-$$v/.installed && .venv-$$v/bin/pytest -n 2 -q $(CORE) \
	        && ran="$$ran\n$$v passed" || { ran="$$ran\n$$v failed"; failed=1; }; \
	done; printf "$(CORE) on$$ran\n"; [ -z "$$failed" ]

tools: $(TOOLS)  ## test TorchRL, Minari, Optuna, JAX, ONNX and pymunk with this package; they are installed in .venv-tools
	.venv-tools/bin/pytest -q -m tools tests/tools tests/examples tests/benchmarks/test_comparison.py

page: $(WEB)  ## build the engines for browsers, and the page that 'billiards web' opens
	$(BIN)/python -m docs.web.build

web: page  ## compare the bits of the engines for browsers with Python's
	$(BIN)/python -m docs.web.check --shots 100 --output build/web/check.json

docs: page  ## build the documentation in site/; runs the tutorials, warnings are errors
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --quiet --strict

machines: $(WEB)  ## compare the bits with emulated processors and other compilers (15 minutes on two cores; can be resumed)
	$(BIN)/python -m benchmarks.machines

arm: $(INSTALLED)  ## compare the bits of two frozen tasks with those of an emulated aarch64
	$(BIN)/python -m benchmarks.machines --parts aarch64 --only Pot1-v0,Carom-v0 --output build/machines.json

dist: page  ## build the source archive and the wheel in dist/, and try the wheel in an empty environment
	$(BIN)/python -m benchmarks.release.dist --output build/dist.json

ci:  ## all checks of continuous integration, each also after the failure of another one (45 minutes on two cores)
	@for target in $(filter-out $(WITHOUT),$(CI)); do \
	    start=$$SECONDS; $(MAKE) -k --no-print-directory $$target PYTHONS="$(filter-out $(VERSION),$(PYTHONS))" \
	        && result=passed || { result=failed; failed=1; }; \
	    ran="$$ran$$target $$result in $$((SECONDS - start)) s\n"; \
	done; printf "\n$$ran"; [ -z "$$failed" ]

smoke: $(INSTALLED) $(SIMULATORS)  ## short runs of the benchmarks that the tests do not run whole
	$(BIN)/python -m benchmarks.speed --repeats 1 --output build/speed.json
	$(BIN)/python -m benchmarks.vector --repeats 1 --output build/vector.json
	$(BIN)/python -m benchmarks.ablation --repeats 1 --output build/ablation.json
	$(BIN)/python -m benchmarks.comparison --shots 1 --passes 1 --output build/comparison.json
	$(BIN)/python -m benchmarks.accuracy --shots 4 --outcomes 8 --passes 1 --output build/accuracy.json --images build
	$(BIN)/python -m benchmarks.error_limit --shots 1 --output build/error_limit.json --images build
	$(BIN)/python -m benchmarks.cushion_error --impacts 1 --output build/cushion_error.json
	$(BIN)/python -m benchmarks.validation --output build/validation.json --images build
	$(BIN)/python -m benchmarks.stress --scale 0.0001 --output build/stress.json

stress: slow  ## the slow tests, and ten million random shots, every event checked (ten minutes on two cores)
	$(BIN)/python -m benchmarks.stress

lint: $(INSTALLED)  ## formatting, lint, types and the layers of the design
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/basedpyright --pythonpath $(BIN)/python
	$(BIN)/lint-imports

bench: page $(SIMULATORS)  ## measure speed and accuracy (JSON in benchmarks/results) and write the tables of the README and the docs (45 minutes)
	$(BIN)/pip install --quiet -c constraints.txt -e '.[bench]'
	$(BIN)/python -m benchmarks.speed
	$(BIN)/python -m benchmarks.ablation
	$(BIN)/python -m benchmarks.vector
	$(BIN)/python -m benchmarks.gradients
	$(BIN)/python -m benchmarks.comparison
	$(BIN)/python -m benchmarks.accuracy
	$(BIN)/python -m benchmarks.validation
	$(BIN)/python -m benchmarks.release.dist
	$(BIN)/python -m studies.readme

errors: $(INSTALLED)  ## compare 1,000 shots of each kind with the 50-digit reference, and make 200 fits of simulated tables (hours)
	$(BIN)/python -m benchmarks.error_limit
	$(BIN)/python -m benchmarks.cushion_error
	$(BIN)/python -m benchmarks.calibration
	$(BIN)/python -m studies.readme

results: $(WORKS)  ## train every row of configs/learning.yaml with its seeds, and measure the players (several hours; what has results is not measured again)
	$(WORK)/python -m studies.learning $(SPREAD)
	$(WORK)/python -m studies.budgets $(SPREAD)
	$(WORK)/python -m studies.self_play
	$(WORK)/python -m studies.frozen_tasks
	$(WORK)/python -m billiards_env bench studies.leaderboard:trained --seed 0 1 --force --name AimPolicy --out docs/leaderboard/aim_policy.json
	$(WORK)/python -m billiards_env bench studies.leaderboard:trained:64 --seed 0 1 --force --name AimPolicy:64 --out docs/leaderboard/aim_policy_64.json
	$(WORK)/python -m studies.leaderboard
	$(WORK)/python -m studies.readme

study: $(WORKS)  ## train policies with several timesteps and compare them (two hours on two cores; runs with results are not trained again)
	$(WORK)/python -m studies.timestep $(SPREAD)
	$(WORK)/python -m studies.timestep_shots
	$(WORK)/python -m studies.readme

rllib: $(RLLIB)  ## install RLlib in .venv-rllib, test it on a cluster of two nodes on this machine, and train a little
	.venv-rllib/bin/pytest -q -m cluster tests/cluster
	.venv-rllib/bin/python -m agents.rllib pot --timesteps 200_000 --run-dir runs/rllib/first --fresh
	.venv-rllib/bin/python -m agents.evaluate runs/rllib/first

figures: $(INSTALLED)  ## draw the pictures in docs/images
	$(BIN)/python -m studies.figures

format: $(INSTALLED)  ## format the code in place
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

clean:  ## remove the virtual environment, builds and caches; trained runs stay
	rm -rf .venv .venv-3.* .venv-simulators .venv-rllib .venv-tools build dist site billiards_env/play/play.html *.egg-info .pytest_cache .ruff_cache .import_linter_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# Runs if .venv is missing or incomplete, or if its Python or the list of packages changes. It starts from an empty .venv.
$(INSTALLED): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' || \
	    { echo "PYTHON = $(PYTHON): expected Python 3.10 or later, such as: make PYTHON=python3.12 $(MAKECMDGOALS)"; exit 1; }
	@echo "Installing the packages of constraints.txt for Python $(VERSION) in .venv"
	@if [ -L .venv ]; then rm .venv; fi  # the target of a link stays as it is
	@$(PYTHON) -m venv --clear .venv
	@set -o pipefail; $(BIN)/pip install -c constraints.txt -e '.[train,masks,render,plot,multi,dev,docs]' | $(PROGRESS)
	@touch $@

$(WEB): $(INSTALLED)
	@echo "Installing the packages of the extra web, about 100 MB, in .venv"
	@$(BIN)/pip install --quiet -c constraints.txt -e '.[web]'
	@touch $@

# Prints the name of each package that pip collects, and the size of a large download.
PROGRESS := while read -r verb name rest; do case "$$verb $$rest" in \
	Collecting*) printf '%s ' "$${name%%[<>=!~;[]*}" ;; \
	Processing*) name="$${name\#\#*/}"; printf '%s ' "$${name%%-*}" ;; \
	Downloading*MB\)) printf '%s ' "$$rest" ;; \
	Installing*packages:*) printf '\nInstalling these packages\n' ;; esac; done

.venv-3.%/.installed: pyproject.toml constraints.txt
	python3.$* -m venv --clear .venv-3.$*
	.venv-3.$*/bin/pip install --quiet -c constraints.txt -e '.[render,plot,multi,dev]'
	touch $@

# RLlib needs another version of gymnasium than constraints.txt has.
$(RLLIB): pyproject.toml constraints.txt constraints-rllib.txt
	$(PYTHON) -m venv --clear .venv-rllib
	grep -v '^gymnasium==' constraints.txt | cat - constraints-rllib.txt > .venv-rllib/constraints.txt
	.venv-rllib/bin/pip install --quiet -c .venv-rllib/constraints.txt -e '.[train,render,plot,multi,dev,rllib]'
	touch $@

$(TOOLS): pyproject.toml constraints.txt benchmarks/simulators.txt
	$(PYTHON) -m venv --clear .venv-tools
	.venv-tools/bin/pip install --quiet -c constraints.txt -e '.[train,render,multi,dev,tools,jax,onnx]'
	.venv-tools/bin/pip install --quiet --no-deps $$(grep -E '^(cffi|pycparser|pymunk)' benchmarks/simulators.txt)
	touch $@

# pooltool needs other versions of numba and llvmlite than this package.
$(SIMULATORS): benchmarks/simulators.txt
	$(PYTHON) -m venv .venv-simulators
	.venv-simulators/bin/pip install --quiet --no-deps -r benchmarks/simulators.txt
	touch $@
