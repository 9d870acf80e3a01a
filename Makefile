# "make" shows the targets. VENV holds Python packages only and can be deleted at any time.

VENV := .venv
BIN := $(VENV)/bin
ARGS ?=

# Whose wheels are installed without ROS: jazzy or kilted.
DISTRO ?= jazzy

# What is installed without ROS, pinned and hashed; "make LOCK=" takes the ranges of setup.py instead.
LOCK ?= requirements$(if $(filter-out jazzy,$(DISTRO)),-$(DISTRO)).lock
TEST_LOCK = $(if $(LOCK),$(if $(ROS),,requirements-test.lock))
DOCS_LOCK = $(if $(LOCK),$(if $(ROS),,requirements-docs.lock))
COMPILE = $(BIN)/uv pip compile --quiet --no-config --universal --upgrade --no-header --no-annotate --no-strip-extras \
  --python-version 3.10 --generate-hashes --default-index https://pypi.org/simple
PIP = $(BIN)/python -m pip install --quiet --progress-bar off
SETUPTOOLS := 'setuptools>=70.1,<80'
comma := ,

# With ROS sourced, its rclpy is used; otherwise an extra, DISTRO, brings the client library.
ROS := $(if $(ROS_DISTRO),$(shell python3 -c 'import rclpy' 2>/dev/null && echo $(ROS_DISTRO)))

IS_SUITABLE := import ensurepip, sys, venv; sys.exit(not (3, 10) <= sys.version_info[:2] <= (3, 13))
CANDIDATES := $(if $(ROS),python3,python3 python3.12 python3.11 python3.13 python3.10)

# What mypy finds depends on the types that NumPy and rclpy bring; checked with those of 2.4, 2.5 and Jazzy.
HAS_TYPES := import numpy, sys; sys.exit(numpy.__version__[:4] not in ("2.4.", "2.5.") or "$(DISTRO)" != "jazzy")

# pytest may be the system's, without a script in VENV; "-m" would put the checkout on the path.
PYTEST := import sys; sys.path[:] = filter(None, sys.path); import pytest; sys.exit(pytest.main())

# VENV belongs to one Python and one kind of ROS; another one makes it anew.
MADE := $(VENV)/made-for-$(if $(PYTHON),$(subst /,_,$(PYTHON))-)$(or $(ROS),$(DISTRO)-wheels)
DEPENDENCIES := $(VENV)/dependencies-installed
PACKAGE := $(VENV)/package-installed
TESTING := $(VENV)/testing-installed
PEERS := $(VENV)/peers-installed
SITE := $(VENV)/site-installed
SOURCES := $(shell find flat_planner_ros config launch resource -type f -not -name '*.pyc' | sort)

export AMENT_PREFIX_PATH := $(CURDIR)/$(VENV)$(if $(AMENT_PREFIX_PATH),:$(AMENT_PREFIX_PATH))
export ROS_AUTOMATIC_DISCOVERY_RANGE := LOCALHOST
export PIP_DISABLE_PIP_VERSION_CHECK := 1

.PHONY: help demo test fuzz soak bench docs examples lint install lock clean FORCE
.DELETE_ON_ERROR:

help:  ## show this list
	@awk -F ':.*## ' '/^[a-z]+:.*## / {printf "make %-8s %s\n", $$1, $$2}' $(firstword $(MAKEFILE_LIST))
	@echo 'ARGS="..." is added to the command line of demo, test, fuzz, soak and bench; PYTHON=... chooses the interpreter,'
	@echo 'DISTRO=kilted the next ROS where none is installed.'

demo: install  ## the paper's experiment on the three nodes: table, figures and numbers in build/
	@mkdir -p build
	$(BIN)/paper_table --plot build/paper_figures.png --csv build/paper_table.csv $(ARGS)

test: export REQUIRE_ROS := 1
test: export ROS_PYTHON_CHECK_FIELDS := 1
test: lint  ## ruff, mypy and all tests
	$(BIN)/python -c '$(PYTEST)' -n 3 --dist loadfile --timeout=300 $(ARGS)

fuzz: export ALL_CASES := 1
fuzz: export FUZZ_CASES ?= 100000
fuzz: export TRUTH_CASES ?= 1000
fuzz: export RANDOM_MESSAGES ?= 10000
fuzz: install $(TESTING)  ## 100,000 random motions against multiple precision, 10,000 random messages of each kind
	$(BIN)/python -c '$(PYTEST)' -s test/fuzz test/core test/ros/wire test/ros/graph/test_controller_conformance.py $(ARGS)

soak: export PYTHONUNBUFFERED := 1
soak: install $(TESTING)  ## random motions with faults for a long time, MINUTES=30 by default
	$(BIN)/python test/soak/run.py --minutes $(or $(MINUTES),30) $(ARGS)

bench: install $(PEERS)  ## speed beside other libraries, and of the nodes; benchmarks/results.md
	$(BIN)/python benchmarks/run.py $(ARGS)

docs: install $(SITE)  ## the documentation as a site, build/docs/index.html
	$(BIN)/python docs/parameter_tables.py
	$(BIN)/python docs/wings.py
	$(BIN)/python -m sphinx -W --keep-going -q docs build/docs $(ARGS)
	@echo 'open build/docs/index.html'

examples: install  ## run examples/, which renews their pictures in docs/images, and the moving one
	@mkdir -p build/examples
	for file in examples/*.py; do \
	  MPLBACKEND=Agg $(BIN)/python $$file build/examples/$$(basename $$file .py).png || exit 1; done
	cp build/examples/*.png docs/images/examples/
	$(BIN)/flat_plan joint1=pi --duration 1 --animate docs/images/turn.gif >/dev/null

lint: install $(TESTING)  ## ruff and mypy only
	$(BIN)/python -m ruff check
	$(BIN)/python -m ruff format --check
	@if $(BIN)/python -c '$(HAS_TYPES)'; then set -x; $(BIN)/python -m mypy; \
	else echo 'mypy is left out: it is run with the types of NumPy 2.4 and 2.5 and of Jazzy only'; fi

install: $(PACKAGE)  ## the package as it stands here, with all it needs, into .venv

clean:  ## remove .venv, build and the caches
	rm -rf $(VENV) build *.egg-info .mypy_cache .pytest_cache .ruff_cache .hypothesis

$(MADE):
	@python=; for p in $(or $(PYTHON),$(CANDIDATES)); do \
	  if $$p -c '$(IS_SUITABLE)' 2>/dev/null; then python=$$p; break; fi; done; \
	if [ -z "$$python" ]; then \
	  echo 'No suitable Python among: $(or $(PYTHON),$(CANDIDATES)). Install Python 3.10 to 3.13' \
	    'with venv (Debian, Ubuntu: apt install python3-venv), or name one: make PYTHON=...' >&2; \
	  exit 1; fi; \
	echo "making .venv (about a minute) with $$($$python --version) and $(if $(ROS),ROS $(ROS),the wheels of ROS $(DISTRO))"; \
	$$python -m venv --clear $(if $(ROS),--system-site-packages) $(VENV)
	@touch $@

# Without ROS: exactly what LOCK lists, by its hashes, for any Python from 3.10 to 3.13. An index
# that has not all of it, or another kind of machine, leaves the ranges of setup.py; a file that is
# not the one listed ends it all. The compiled messages of a ROS installation need the NumPy that
# they were built with, hence ranges there too.
$(DEPENDENCIES): setup.py pyproject.toml $(LOCK) $(MADE)
	@echo 'installing what it needs into $(VENV) (about a minute)'
	@$(if $(and $(LOCK),$(if $(ROS),,yes)), \
	if $(PIP) --require-hashes -r $(LOCK) 2>$(VENV)/lock.log; then touch $@; exit 0; fi; \
	if grep -i 'do not match the hashes' -A 8 $(VENV)/lock.log >&2; then exit 1; fi; \
	echo '$(LOCK) cannot be installed here ($(VENV)/lock.log); taking the ranges of setup.py' >&2;) \
	$(PIP) $(SETUPTOOLS) \
	  $(if $(ROS),"numpy==$$(python3 -c 'import numpy; print(numpy.__version__)')") \
	  '.[$(if $(ROS),,$(DISTRO)$(comma)$(DISTRO)-lint$(comma))plot]' && touch $@

lock: $(MADE)  ## renew the requirements*.lock from the ranges of setup.py
	$(PIP) '.[lock]'
	echo $(SETUPTOOLS) | $(COMPILE) --extra jazzy --extra jazzy-lint --extra plot setup.py - -o requirements.lock
	echo $(SETUPTOOLS) | $(COMPILE) --extra kilted --extra kilted-lint --extra plot setup.py - -o requirements-kilted.lock
	$(COMPILE) --extra lint --extra test --constraint requirements.lock setup.py -o requirements-test.lock
	$(COMPILE) --extra docs --constraint requirements.lock setup.py -o requirements-docs.lock

# The comparison goes on without libraries that cannot be had here.
$(PEERS): setup.py $(DEPENDENCIES)
	$(BIN)/python -m pip install --quiet --progress-bar off \
	  "numpy==$$($(BIN)/python -c 'import numpy; print(numpy.__version__)')" '.[bench]' \
	  || echo 'some libraries of the comparison could not be installed' >&2
	@rm -rf build/lib build/bdist.* *.egg-info
	@touch $@

# What more the tests and the site need. As DEPENDENCIES: what a lock lists by its hashes, or the
# ranges of setup.py.
define install_more
@if [ -n "$(2)" ] && $(PIP) --require-hashes -r $(2) 2>$(VENV)/$(1)-lock.log; then touch $@; exit 0; fi; \
if grep -i 'do not match the hashes' -A 8 $(VENV)/$(1)-lock.log 2>/dev/null >&2; then exit 1; fi; \
$(PIP) "numpy==$$($(BIN)/python -c 'import numpy; print(numpy.__version__)')" '.[$(3)]' || exit 1
@rm -rf build/lib build/bdist.* *.egg-info
@touch $@
endef

$(TESTING): setup.py requirements-test.lock $(DEPENDENCIES)
	@echo 'installing what the tests need into $(VENV) (about a minute)'
	$(call install_more,test,$(TEST_LOCK),$(if $(ROS),,lint$(comma))test)

$(SITE): setup.py requirements-docs.lock $(DEPENDENCIES)
	$(call install_more,docs,$(DOCS_LOCK),docs)

# A removed source changes no time stamp, hence the list; and it would live on in build/lib.
$(PACKAGE): $(DEPENDENCIES) $(VENV)/sources package.xml setup.cfg $(SOURCES)
	@rm -rf build/lib build/bdist.* *.egg-info
	@echo 'installing the package into $(VENV) (some seconds)'
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation --force-reinstall .
	@rm -rf build/lib build/bdist.* *.egg-info
	@touch $@

$(VENV)/sources: FORCE $(DEPENDENCIES)
	@echo '$(SOURCES)' | cmp -s - $@ || echo '$(SOURCES)' > $@
