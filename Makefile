# make demo    set up, run the main scenario as separate nodes, record it, check the recording, write the report
# make quick   set up, lint, check types, run the tests of all laws and of the pages: a minute and a half
# make test    set up, lint, show that each part of the product works: five minutes
# make test-all   make test, then make test-rest: every test
# make test-rest  the tests that are marked thorough
# make update-references  record bags/reference anew and print the difference that is accepted with it
# make docs    write the tables of README.md and docs/ anew from the tables of the code and from docs/rows.json
# make book    the documentation as a book in build/book/site, to be read without a network; needs Chromium
# make numbers run the studies and write docs/rows.json anew (some minutes), then make docs
# make bench   set up, measure the graph, the core and bags
# make colcon  build src/ as a ROS 2 workspace and start a node from it
# make clean   remove everything made here

PYTHON ?= python3
PACKAGES := pedestal_common receiver_law drive_law ship_motion_sim tracking_receiver_sim acu_tracker adu_drive \
	pedestal_operator pedestal_recording pedestal_results pedestal_hardware equipment_sim pedestal_bringup pedestal_workbench \
	pedestal_station pedestal_studies pedestal
ROS := 'ros-jazzy-rclpy[fastrtps]' ros-jazzy-common-interfaces
# pip would write the bytecode of all that it installs on one core, tests of others included; here that of the product is
# written on all cores, and the rest when it is imported.
PIP := -m pip --disable-pip-version-check install --quiet --use-pep517 --constraint constraints.txt --no-compile
# Needs setuptools first; otherwise pip makes an environment for each package that it builds.
BUILT_HERE := --no-build-isolation
DEMO := bags/runs/demo
# Graphs in realtime that are killed, frozen and cut, not beside other tests; the files that take longest come first,
# and before them those that share one (conftest.py).
REALTIME := test/test_live.py test/test_rotctld.py test/test_page.py test/test_station_night.py test/test_operating.py \
	test/test_supervision.py \
	test/test_realtime.py test/test_drives.py test/test_iq.py test/test_level_receiver.py test/test_ins_input.py \
	test/test_rotator.py test/test_field.py test/test_network.py
# Tests of laws, which lie beside their packages and start no graph. That of the compiler starts processes by the
# dozen, and compiles.
LAWS := $(foreach package,receiver_law drive_law ship_motion_sim tracking_receiver_sim acu_tracker adu_drive pedestal_common,src/$(package)) \
	$(patsubst %,--ignore src/pedestal_common/test/test_%.py,compiled law_cache law_orders)
# The files in the order of pyproject.toml, where those of graphs come first: a file of few tests, each a graph, would
# else be the last, and one core idle.
IN_TURN := --dist loadfile --no-loadscope-reorder
# SECONDS COMMAND: three times what it takes.
LIMITED := .venv/bin/python test/limited.py
# What fails runs once more, alone. A test process that hangs is ended and named, and another process runs the tests after
# it (conftest.py). Because each such process costs a phase_timeout, few are replaced.
PYTEST_IN_TURN = .venv/bin/python test/run_tests.py $(IN_TURN) --max-worker-restart 3 $(PYTEST)
LINT = .venv/bin/ruff check . && .venv/bin/codespell && .venv/bin/mypy
# Containers often set it: every process would compile the sources again.
unexport PYTHONDONTWRITEBYTECODE

install: .venv/tests
	@.venv/bin/python -m pedestal_bringup.loop.prepare

demo: .venv/installed
	@.venv/bin/python -m pedestal_bringup.loop.prepare leo_pass
	rm -rf $(DEMO) $(DEMO).log
	.venv/bin/pedestal run leo_pass --bag $(DEMO)
	.venv/bin/pedestal verify $(DEMO)
	.venv/bin/pedestal report $(DEMO)
	@echo 'Report: $(CURDIR)/$(DEMO)/report.html'

quick: install
	$(LINT)
	$(LIMITED) 900 $(PYTEST_IN_TURN) -m 'not thorough' --numprocesses 2 $(LAWS) test/test_pages.py

test: install
	$(LINT)
	$(LIMITED) 1800 $(PYTEST_IN_TURN) -m 'not thorough' --numprocesses 2

test-rest: install
	$(LIMITED) 2400 $(PYTEST_IN_TURN) -m thorough --numprocesses 3 $(addprefix --ignore=,$(REALTIME))
	$(LIMITED) 1500 $(PYTEST_IN_TURN) -m thorough --numprocesses 2 $(REALTIME)

test-all: test
	$(MAKE) test-rest

update-references: install
	.venv/bin/python bags/reference/update.py

docs: install
	.venv/bin/python -m tools.reference

# What is made of the code is written beside a copy of docs/; no page may fetch anything from elsewhere. A browser opens
# the book from the disk, searches it, and looks for clipped tables and code.
book: install .venv/mkdocs
	.venv/bin/python -m tools.book build/book/pages
	NO_MKDOCS_2_WARNING=1 .venv/bin/python -m mkdocs build --strict
	! grep --recursive --include='*.html' --extended-regexp --files-with-matches \
	    '<(script|img|iframe|link)[^>]*(src|href)="?(https?:)?//' build/book/site
	BOOK=build/book/site .venv/bin/python -m pytest $(PYTEST) test/test_built_book.py
	@echo 'Book: $(CURDIR)/build/book/site/index.html'

numbers: install
	.venv/bin/python -m tools.numbers.published
	.venv/bin/python -m tools.reference

bench: install
	.venv/bin/pedestal bench graph
	.venv/bin/pedestal bench core
	.venv/bin/pedestal bench bag

# colcon leaves build/, install/ and log/ where it is called, so that is build/colcon/.
colcon: .venv-colcon/installed
	rm -rf build/colcon && mkdir -p build/colcon
	cd build/colcon && ../../.venv-colcon/bin/colcon build --base-paths ../../src
	. build/colcon/install/local_setup.sh && .venv-colcon/bin/python -m pytest test/test_colcon.py

clean:
	rm -rf .venv .venv-colcon build install log .pytest_cache .ruff_cache bags/runs src/*/build src/*/*.egg-info
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

.venv/installed: Makefile constraints.txt $(wildcard src/*/setup.py) | .venv/bin/pip
	@echo 'Installing into .venv (the first time this takes some minutes) ...'
	.venv/bin/python $(PIP) setuptools
	.venv/bin/python $(PIP) $(BUILT_HERE) $(ROS) $(foreach package,$(PACKAGES),--editable src/$(package))
	.venv/bin/python -m compileall -qq -j 0 -x '/tests?/' .venv/lib
	@touch $@

.venv/tests: .venv/installed
	@echo 'Installing what the tests use into .venv ...'
	.venv/bin/python $(PIP) ruff codespell mypy py-spy pytest-timeout pytest-xdist $(foreach package,$(PACKAGES),'$(package)[test]')
	@touch $@

.venv-colcon/installed: Makefile constraints.txt $(wildcard src/*/setup.py) | .venv-colcon/bin/pip
	@echo 'Installing into .venv-colcon ...'
	.venv-colcon/bin/python $(PIP) setuptools
	.venv-colcon/bin/python $(PIP) $(BUILT_HERE) $(ROS) colcon-common-extensions colcon-ros numpy numba rosbags sgp4 pyerfa
	@touch $@

.venv/mkdocs: .venv/tests
	@echo 'Installing mkdocs into .venv ...'
	.venv/bin/python $(PIP) mkdocs-material
	@touch $@

# Debian and Ubuntu keep ensurepip in a package of its own, python3-venv. Where that is missing, pip comes from
# the wheel in Debian's package python3-pip-whl, which `apt-get download` fetches without root.
APT := apt-get -qq -o APT::Sandbox::User=root
%/bin/pip:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' || \
	    { echo 'Python 3.10 or newer is needed; name one: make PYTHON=python3.12'; exit 1; }
	@rm -rf $*
	@if $(PYTHON) -c 'import ensurepip' 2>/dev/null; then $(PYTHON) -m venv $*; else ( \
	    $(PYTHON) -m venv --without-pip $* && cd $* && \
	    { $(APT) download python3-pip-whl 2>/dev/null || \
	        { $(APT) update && $(APT) download python3-pip-whl; }; } && \
	    dpkg -x python3-pip-whl_*.deb . && wheel=$$(echo usr/share/python-wheels/pip-*.whl) && \
	    PYTHONPATH=$$wheel bin/python -m pip install --quiet --no-index $$wheel && \
	    rm -r usr python3-pip-whl_*.deb ); fi || \
	    { rm -rf $*; echo 'This Python cannot make an environment with pip: sudo apt-get install python3-venv'; exit 1; }

.PHONY: install demo quick test test-rest test-all update-references docs book numbers bench colcon clean
