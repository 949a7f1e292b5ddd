# Everything from a clean clone: a virtual environment with the ROS 2 Jazzy wheels, built by colcon.
# Where ROS 2 is installed, none of this is needed: see README.md.

PYTHON ?= python3
SOLVER ?= ilqr
SHELL := /bin/bash
.SHELLFLAGS := -e -o pipefail -c
.DELETE_ON_ERROR:

VENV := .venv
BIN := $(VENV)/bin
WITH_ROS := source $(BIN)/activate && source install/setup.bash
SOURCES := package.xml setup.py setup.cfg resource/dp_swing_ros $(wildcard config/*) \
	$(shell find dp_swing_ros -type f ! -name '*.pyc')
DOWNLOADS := sed -u -n 's/^ *Downloading \([^-]*-[^-]*\)-.* (\(.* MB\))$$/  \1 (\2)/p; /^Install/s/:.*/ .../p'
INSTALL = $(BIN)/python -m pip install --no-input -c constraints.txt $(addprefix --group ,$(1)) | \
	$(DOWNLOADS) || $(call FAIL,pip could not install the groups $(1); what it said stands above)
IN_PARALLEL := pytest -n auto --dist loadfile --no-loadscope-reorder
# so that on a new machine not each test process compiles, while nodes of others want to be in time;
# the longest first, beside which there is time for the others
COMPILE := echo 3 1 2 | xargs -n 1 -P 2 python -c 'import sys, dp_swing_ros as dp; n = int(sys.argv[1]); \
  [dp.controller({"solver": s, "links": n}).warm_up() for s in dp.SOLVERS]; \
  dp.plant({"links": n}).advance(0.05)'
HYDRAX := https://github.com/vincekurtz/hydrax
FAIL = { echo "make: $(1)" >&2; exit 1; }

# A sourced ROS installation, or another checkout's, would shadow the wheels, which have Fast DDS
# alone. What else the environment tells ROS, as ROS_DOMAIN_ID, is respected.
unexport AMENT_PREFIX_PATH CMAKE_PREFIX_PATH COLCON_PREFIX_PATH LD_LIBRARY_PATH PYTHONPATH \
	RMW_IMPLEMENTATION RCL_ASSERT_RMW_ID_MATCHES _ROS_WHEELS_BOOTSTRAP_COMPLETE
# Else each start of a process would compile all modules that it loads.
unexport PYTHONDONTWRITEBYTECODE

help:  ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "make %-10s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

setup: install/.built  ## the virtual environment and the built package

demo: setup $(if $(RIG),$(VENV)/.installed-rig)
demo:  ## swing up and hold in real time for 10 s (SOLVER=ilqr, ddp or mppi; RIG=stepper, voltage, linear_motor or rig: one of config/, moved by MuJoCo)
	@$(WITH_ROS) && ros2 run dp_swing_ros demo --solver $(SOLVER) $(if $(RIG),--params config/$(RIG).yaml)

play: setup  ## plant, mpc and a page in the browser to pull at them (SOLVER=...; LOCKSTEP=1: can be paused, stepped, slowed down)
	@$(WITH_ROS) && ros2 run dp_swing_ros play --solver $(SOLVER) $(if $(LOCKSTEP),--lockstep)

docs: setup  ## the references of parameters, constants, diagnostics and the Python API, the drawings, the table of rooms, which results are older
	@$(WITH_ROS) && ros2 run dp_swing_ros parameters > docs/parameters.md && \
	  python scripts/api_reference.py > docs/api.md && python scripts/house.py --docs && \
	  python scripts/constants.py > docs/constants.md && \
	  python scripts/diagnostics.py > docs/diagnostics.md && \
	  for drawing in sketch architecture theory; do \
	    python scripts/$$drawing.py docs/figures || exit; done && \
	  python benchmarks/published.py --mark

evaluate: setup  ## run a campaign of episodes without ROS (EVALUATE='...' for its arguments)
	@$(WITH_ROS) && ros2 run dp_swing_ros evaluate $(EVALUATE)

results: setup $(if $(filter benchmark closed_loops,$(or $(PAGES),benchmark)),$(VENV)/.peers $(VENV)/.hydrax)
results: $(if $(filter rigs rig intervals drives wrong_models methods ablation,$(PAGES)),$(VENV)/.installed-rig)
results: $(if $(filter bags durability,$(or $(PAGES),bags)),$(VENV)/.installed-test)
results:  ## every published figure anew, in three hours on a fast machine (PAGES='reliability live' for some)
	@$(WITH_ROS) && python benchmarks/published.py $(PAGES) $(RESULTS)

test: setup $(VENV)/.installed-test  ## all tests, linters and type checks (PYTEST='...' for arguments of pytest)
	@$(WITH_ROS) && $(if $(PYTEST),,$(COMPILE) &&) $(IN_PARALLEL) $(or $(PYTEST),-m 'not real_time')

house: setup  ## lines of each room, the largest class, what each node loads
	@$(WITH_ROS) && python scripts/house.py

real-time: setup $(VENV)/.installed-test  ## what control in real time comes to, on a machine that is not busy
	@$(WITH_ROS) && pytest -m real_time

shell: setup  ## a shell in which ros2 run dp_swing_ros ... works
	@exec bash --rcfile <(echo '[ ! -f ~/.bashrc ] || source ~/.bashrc; $(WITH_ROS)') -i

clean:  ## remove what was built; runs/ stays
	rm -rf build install log $(VENV) .pytest_cache .mypy_cache .import_linter_cache

$(VENV)/.installed: pyproject.toml constraints.txt scripts/ros2
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 10) <= sys.version_info < (3, 15))' || \
	  $(call FAIL,$(PYTHON) is not CPython 3.10 to 3.14; name one with PYTHON=...)
	@echo '== Python packages and ROS 2 wheels into $(VENV) (the first time takes minutes)'
	@[ -x $(BIN)/pip ] || $(PYTHON) -m venv $(VENV) || \
	  $(call FAIL,$(PYTHON) cannot make a virtual environment; install python3-venv)
	@$(BIN)/python -m pip install --quiet 'pip>=25.1' && \
	  $(call INSTALL,run ros)
	@rm -f $(BIN)/ros2
	@command -v ros2 >/dev/null || install -m 755 scripts/ros2 $(BIN)/ros2
	@touch $@

$(VENV)/.installed-rig: $(VENV)/.installed
	@$(call INSTALL,rig)
	@touch $@

$(VENV)/.installed-test: $(VENV)/.installed
	@echo '== what the tests need, and torch, into $(VENV)'
	@$(call INSTALL,test)
	@touch $@

# acados's wheel has a CasADi of its own, which must come after the real one
$(VENV)/.peers: $(VENV)/.installed
	@$(call INSTALL,peers)
	@$(BIN)/python -m pip install --quiet --no-input --no-deps -c constraints.txt --upgrade \
	  --target $(VENV)/acados comma-deps-acados || $(call FAIL,pip could not install acados)
	@echo $(CURDIR)/$(VENV)/acados > $(VENV)/acados.pth && mv $(VENV)/acados.pth \
	  $$($(BIN)/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')
	@touch $@

# pip has another package of that name, and its own has but its top folder unless it is editable; it
# asks for Python 3.12, and does with 3.11. The benchmark goes without where it does not come.
$(VENV)/.hydrax: $(VENV)/.installed benchmarks/peers_hydrax.py
	@$(call INSTALL,hydrax)
	@$(BIN)/python -m pip install --quiet --no-input --no-deps --ignore-requires-python \
	  --src $(VENV)/src --editable \
	  "git+$(HYDRAX)@$$(sed -n "s/^COMMIT = '\(.*\)'.*/\1/p" benchmarks/peers_hydrax.py)#egg=hydrax" && touch $@ || \
	  echo 'make: hydrax did not come from $(HYDRAX); the benchmark goes without it' >&2

# A module that is gone from the sources must not live on in what was built from them.
install/.built: $(VENV)/.installed $(SOURCES)
	@echo '== colcon build'
	@source $(BIN)/activate && mkdir -p log && \
	  { colcon build >log/build.txt 2>&1 || { cat log/build.txt >&2; exit 1; }; }
	@for tree in build/dp_swing_ros/build/lib install/dp_swing_ros/lib/python*/site-packages; do \
	  (cd $$tree && find dp_swing_ros -name '*.py' ! -exec test -e '$(CURDIR)/{}' \; -delete); done
	@touch $@

.PHONY: help setup demo play docs evaluate results test house real-time shell clean
.DEFAULT_GOAL := help
