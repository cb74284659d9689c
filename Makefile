# geometry/% -> meshes/%.msh -> build/%/basis.h5 -> build/%/report.html (with pipeline/cases/%.toml),
# and pipeline/cases/<case>.toml + the modal files it names -> build/<case>/response.csv.
# Each stage decides by the hashes of its inputs and of all its products whether there is work to do; make only calls it.

BODIES   := $(sort $(patsubst geometry/%/build.py,%,$(wildcard geometry/*/build.py)))
CASES    := $(filter-out $(BODIES),$(sort $(basename $(notdir $(wildcard pipeline/cases/*.toml)))))
PYTHON   := .venv/bin/python
RUN      := $(PYTHON) -m microslip
# A worker that crashes fails the run: one that took its place would wait for ever.
PYTEST   := $(PYTHON) -m pytest -n 2 --dist loadfile --no-loadscope-reorder --max-worker-restart=0
READY    := .venv/.ready

export OMP_NUM_THREADS ?= 1
export MKL_NUM_THREADS ?= $(OMP_NUM_THREADS)
unexport DISPLAY PYTHONPATH PYTHONHOME PYTHONDONTWRITEBYTECODE # without byte code the start takes twice as long

# The environment knows the folder it was made for: a checkout that was moved or copied is set up again.
MOVED := $(shell [ "$$(cat $(READY) 2>/dev/null)" = "$$(pwd -P)" ] || echo moved)

.PHONY: disc-brake spin-pit moved help setup all cases $(CASES) $(BODIES) $(BODIES:%=%-mesh) $(BODIES:%=%-modes) test test-slow test-all peers lint docs bench clean distclean site release-check

help: ## list the verbs
	@grep -hE '^[a-z%-]+:.*## ' $(MAKEFILE_LIST) | sed 's/:.*## /\t/' | expand -t 14
	@echo "bodies:       $(BODIES)   (make blade, blade-mesh, blade-modes)"
	@echo "cases:        $(CASES)   (their bodies as well)"

setup: $(READY) ## virtual environment, locked packages, system libraries

$(READY): requirements.lock pyproject.toml pipeline/setup.sh $(MOVED)
	@sh pipeline/setup.sh

all: $(BODIES) ## every body to its report

cases: $(CASES) ## every case that is not named like its body

# Which bodies a case needs stands in its file: run reads it, and works only where a hash has changed.
$(CASES): %: $(READY)
	@$(RUN) run pipeline/cases/$*.toml

# The three dampers of section 5.4: the largest strain over the mass, of all on one picture.
MASSES := --over bodies.damper.mass --low 0.0165 --high 0.16 --points 9
spin-pit: spin-pit-cottage-roof spin-pit-cylinder spin-pit-asymmetric ## strain over the mass of three dampers
	@$(RUN) optimum spin-pit-cottage-roof $(MASSES)
	@$(RUN) optimum spin-pit-cylinder $(MASSES)
	@$(RUN) optimum spin-pit-asymmetric $(MASSES) --beside spin-pit-cottage-roof --beside spin-pit-cylinder

disc-brake: $(READY) ## does the published disc brake squeal: roots, and how many grow at which speeds
	@$(RUN) stability geometry/disc-brake

tyre: $(READY) slip-jump

$(filter-out tyre,$(BODIES)): %: $(READY)
	@$(RUN) run geometry/$*

pendulum: pendulum-friction-two-modes pendulum-friction-three-modes pendulum-friction

$(BODIES:%=%-mesh): %-mesh: $(READY)
	@$(RUN) mesh geometry/$*

$(BODIES:%=%-modes): %-modes: $(READY)
	@$(RUN) modes geometry/$*

test: $(READY) ## the quick tests: nine minutes the first time on two cores, then seven
	@$(PYTEST)

test-slow: $(READY) ## only the slow ones and the peers (CalculiX, if it is installed)
	@$(PYTEST) -m slow

test-all: $(READY) ## both
	@$(PYTEST) -m "slow or not slow"

peers: $(READY) ## environments of pyHarm, Exudyn, FMPy, pyNastran and tamaas for the slow tests (build/peers)
	@sh tests/peers/setup.sh

lint: $(READY) ## ruff and mypy
	@.venv/bin/ruff check .
	@.venv/bin/mypy

site: $(READY) ## the documentation as a site that can be searched -> build/site/index.html
	@$(PYTHON) -m sphinx -b html -q docs build/site
	@echo build/site/index.html

release-check: $(READY) ## wheel and sdist, installed in clean environments and tried (downloads; minutes)
	@PYTHON=$(abspath $(PYTHON)) sh pipeline/release_check.sh

docs: $(READY) ## the studies and pictures of docs/ (minutes)
	@$(PYTHON) docs/make_pictures.py

figure-%: $(READY) ## a figure of the book by its number, figure-6.7-5 -> build/figures
	@$(PYTHON) docs/figures.py $* --figures svg

bench: $(READY) ## timings against CalculiX, NGSolve and pyHarm, of rings and cyclic sectors (minutes)
	@$(PYTHON) benchmarks/modal.py
	@$(PYTHON) benchmarks/ring.py
	@$(PYTHON) benchmarks/cyclic.py
	@$(PYTHON) benchmarks/contact_points.py
	@$(PYTHON) benchmarks/structures.py
	@$(PYTHON) benchmarks/ring_response.py
	@$(PYTHON) benchmarks/time_domain.py
	@$(PYTHON) benchmarks/bifurcation.py
	@$(PYTHON) benchmarks/two_tone.py
	@$(PYTHON) benchmarks/stability.py
	@$(PYTHON) benchmarks/squeal.py
	@$(PYTHON) benchmarks/rolling.py

clean: ## remove products
	rm -rf build meshes/*.msh meshes/*.json

distclean: clean ## and the environment
	rm -rf .venv
