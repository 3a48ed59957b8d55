# Two commands work alone on a fresh machine with Python 3.11 or newer, git and make:
#   make reproduce   the paper's study, Tables 4 and 5, Figures 1 to 7 and its claims, to data/paper/report.html
#   make test        the tests
PYTHON ?= python3
BIN := .venv/bin
CPFLS := $(BIN)/cpfls
# What is never imported is never compiled; what is, at its first import.
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile
INSTALLED := .venv/.installed
INSTALLED_DEV := .venv/.installed-dev
INSTALLED_BENCH := .venv/.installed-bench
INSTALLED_DOCS := .venv/.installed-docs
INSTALLED_RELEASE := .venv/.installed-release
export OPENBLAS_NUM_THREADS := 1
# The tests start hundreds of processes: what they import is compiled once, whatever the environment says.
export PYTHONDONTWRITEBYTECODE :=

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.SECONDARY:
.PHONY: help reproduce reproduce-full reproduce-larger quick hexarotor full-circle crazyflie gap-example replay-example test test-fast decides oldest lint site tutorials wheel bench blind-study blind-quick gallery fuzz clean FORCE

help:
	@sed -n 's/^# \{0,1\}//p' Makefile | head -3
	@echo "  make quick       the same study with one small search and without Table 5, in a minute"
	@echo "  make reproduce-full   Table 5 and all readings from searches of full size; about fourteen hours on two cores"
	@echo "  make reproduce-larger   of it only 75 x 25 next to 500 x 200 on 685 samples; about an hour and a half"
	@echo "  make hexarotor   a six-rotor study with a rigid body under the fuzzy part"
	@echo "  make full-circle full rotations of a held vehicle: the structure that wins, and twelve others"
	@echo "  make crazyflie LOGS=FOLDER   the real flight; FOLDER holds log119.csv and log149.csv"
	@echo "  make gap-example [HIDDEN=NAME=VALUES]   a flight with a hidden effect, and what the gap workflow makes of it"
	@echo "  make replay-example   a vehicle that is not what its config states: found in flights, and what it predicts then"
	@echo "  make test-fast   the units that fly nothing, in less than a minute"
	@echo "  make decides     tests of words, names and verdicts once more, as another processor computes"
	@echo "  make oldest      the same with the oldest packages that are allowed"
	@echo "  make lint        formatting, lint, types, import contracts"
	@echo "  make site        the pages of docs/ as a site that needs no network, to build/site/index.html"
	@echo "  make tutorials   the commands of README.md and of all tutorials, as they stand, in empty folders"
	@echo "  make wheel       wheel and source distribution, to dist, tried in an empty environment"
	@echo "  make bench       benchmarks, as Markdown tables; hours, and goes on where it was stopped"
	@echo "  make blind-study [SEED=N DRAWS=N NONE=N SIZE=...]   flights with hidden effects, to data/blind/tables.md"
	@echo "  make blind-quick [SIZE=...]                          a few sets of each group in six minutes"
	@echo "  make gallery REPOSITORIES=FOLDER   what one public log says of each of many vehicles, from clones of them"
	@echo "  make fuzz [EACH=N]   hostile files against all that reads them"
	@echo "  make clean       remove what studies produced"

reproduce: data/paper/report.html
	@echo "open data/paper/report.html"

reproduce-full: data/paper/report-full.html
	@echo "open data/paper/report-full.html"

reproduce-larger: data/paper/report-larger.html
	@echo "open data/paper/report-larger.html"

# The searches of Table 5 are two parts that run side by side.
ifneq (,$(filter reproduce reproduce-full reproduce-larger,$(MAKECMDGOALS)))
MAKEFLAGS += --jobs=2
endif
ifneq (,$(filter reproduce-full,$(MAKECMDGOALS)))
$(info Ten searches of 500 x 200 chromosomes for each of five settings, and all readings: about fourteen hours on two cores.)
$(info Ctrl-C loses nothing: make reproduce-full goes on where it was.)
endif

quick: data/quick/report.html
	@echo "open data/quick/report.html"

hexarotor: data/hexarotor/report.html
	@echo "open data/hexarotor/report.html"

full-circle: data/full-circle/report.html
	@echo "open data/full-circle/report.html"

ifdef LOGS
crazyflie: data/crazyflie/report.html
	@echo "open data/crazyflie/report.html"
else
crazyflie:
	@echo "make crazyflie needs LOGS=FOLDER, where FOLDER holds log119.csv and log149.csv" >&2; exit 2
endif

$(INSTALLED): pyproject.toml
	$(PYTHON) -m venv .venv
	$(PIP) -e .
	@touch $@

$(INSTALLED_DEV): pyproject.toml | $(INSTALLED)
	$(PIP) -e ".[dev]"
	@touch $@

$(INSTALLED_BENCH): $(INSTALLED_DEV)
	$(PIP) -e ".[simulators]"
	@touch $@

$(INSTALLED_DOCS): pyproject.toml | $(INSTALLED)
	$(PIP) -e ".[docs]"
	@touch $@

$(INSTALLED_RELEASE): pyproject.toml | $(INSTALLED)
	$(PIP) -e ".[release]"
	@touch $@

# Each artifact depends on its inputs and on its own part of the config, written out with all defaults and the version
# of the program; a part that comes out the same leaves its file, and so everything made from it, untouched.
STRUCTURE := structure input_map consequents harmonic_order products membership_functions training_share
PART_trajectory := trajectory vehicle seed $(addprefix identification.,$(STRUCTURE))
PART_simulate := vehicle simulation
PART_import := import vehicle identification.training_share
PART_reduce := reduction $(addprefix identification.,$(STRUCTURE))
PART_identify := identification
PART_searches := reduction identification
PART_report := vehicle report

define part
data/%/.part/$(1).yaml: configs/%.yaml FORCE | $(INSTALLED)
	@mkdir -p $$(@D)
	@{ echo "# $$$$($(CPFLS) --version)"; $(CPFLS) config $$< $(foreach key,$(PART_$(1)),--section $(key)); } > $$@.new
	@if cmp --silent $$@.new $$@; then rm $$@.new; else mv $$@.new $$@; fi
endef
$(foreach stage,trajectory simulate import reduce identify searches report,$(eval $(call part,$(stage))))

data/%/trajectory.h5: data/%/.part/trajectory.yaml
	$(CPFLS) trajectory configs/$*.yaml -o $@ --force

data/%/flight.h5: data/%/trajectory.h5 data/%/.part/simulate.yaml
	$(CPFLS) simulate configs/$*.yaml $< -o $@ --force

data/%/selection.h5: data/%/flight.h5 data/%/.part/reduce.yaml
	$(CPFLS) reduce configs/$*.yaml $< -o $@ --force

# Table 4 has two more sizes.
TABLE_4_SIZES := 1170 2743
data/paper/selection-%.h5: data/paper/flight.h5 data/paper/.part/reduce.yaml
	$(CPFLS) reduce configs/paper.yaml $< -o $@ --force --set reduction.size=$*

# Stopped and started again searches go on where they were.
SEARCHES = $(BIN)/python -m benchmarks.paper.searches --force
# Table 5 in two parts of equal length, each named by its first seed; what follows is in small pieces.
LARGEST := data/paper/selection-2743.h5
data/paper/searches-%.h5: data/paper/flight.h5 $(LARGEST) data/paper/.part/searches.yaml
	$(SEARCHES) configs/paper.yaml $< table-5 -o $@ --seed $* --seeds 5 --population 40 --generations 10 --selection $(LARGEST)

data/paper/full-%.h5: data/paper/flight.h5 $(LARGEST) data/paper/.part/searches.yaml
	$(SEARCHES) configs/paper.yaml $< table-5 -o $@ --seed $* --seeds 5 --selection $(LARGEST)

# What the paper leaves open, combined: two flights, three noises of the torque, four choices of samples, and whether
# errors are taken over the whole flight or over the samples learned from. Samples are chosen by the motion, which is
# the same with every noise.
CHOSEN := paper-literal sigma_min KD-exchange
define chosen
data/$(1)/chosen-$(2).h5: data/$(1)/noise-0.h5 data/$(1)/.part/reduce.yaml
	$(CPFLS) reduce configs/$(1).yaml $$< -o $$@ --force --set reduction.size=685 --set reduction.criterion=$(2)
endef

define reading
data/$(1)/noise-$(2).h5: data/$(1)/trajectory.h5 data/$(1)/.part/simulate.yaml
	$(CPFLS) simulate configs/$(1).yaml $$< -o $$@ --force --set simulation.relative_noise.torque=$(2)

data/$(1)/readings-$(2).h5: data/$(1)/noise-$(2).h5 $(CHOSEN:%=data/$(1)/chosen-%.h5) data/$(1)/.part/searches.yaml
	$(SEARCHES) configs/$(1).yaml $$< readings -o $$@ $$(READ) --set simulation.relative_noise.torque=$(2) \
		--population 20 --generations 5 --samples 685 $(CHOSEN:%=--selection data/$(1)/chosen-%.h5)

data/$(1)/readings-full-$(2).h5: data/$(1)/noise-$(2).h5 data/$(1)/.part/searches.yaml
	$(SEARCHES) configs/$(1).yaml $$< readings -o $$@ $$(READ) --set simulation.relative_noise.torque=$(2) \
		--population 75 --generations 25 --samples 2743 --samples 1170 --samples 685
endef
READ := --set identification.local_search.reinsert=always
NOISES := 0 0.01 0.05
FLIGHTS := paper paper-gentle
$(foreach flight,$(FLIGHTS),$(foreach rule,$(CHOSEN),$(eval $(call chosen,$(flight),$(rule)))))
$(foreach flight,$(FLIGHTS),$(foreach noise,$(NOISES),$(eval $(call reading,$(flight),$(noise)))))
read = $(foreach flight,$(FLIGHTS),$(NOISES:%=data/$(flight)/$(1)-%.h5))

# The smaller search next to the paper's, on its own.
data/paper/larger-%.h5: data/paper/flight.h5 data/paper/.part/searches.yaml
	$(SEARCHES) configs/paper.yaml $< larger -o $@ --seed $* --seeds 5

# No artifact holds a time, so what the report says of time is measured for it and given to it.
data/paper/times.json: benchmarks/reproduction_time.py data/paper/trajectory.h5
	$(BIN)/python -m benchmarks.reproduction_time --out $@

# A flight that the model never learns from: another direction, the other way round.
UNSEEN = --set trajectory.path=straight --set "trajectory.direction=[1.0, -0.6, 0.2]" \
	--set trajectory.displacement_m=$(UNSEEN_M) --set trajectory.yaw_turn_rad=-6.283185307179586
UNSEEN_M := 50.0
data/paper/unseen-trajectory.h5 data/quick/unseen-trajectory.h5: UNSEEN_M := 4.5
data/%/unseen-trajectory.h5: data/%/.part/trajectory.yaml
	$(CPFLS) trajectory configs/$*.yaml -o $@ --force $(UNSEEN)

data/%/unseen.h5: data/%/unseen-trajectory.h5 data/%/.part/simulate.yaml
	$(CPFLS) simulate configs/$*.yaml $< -o $@ --force

data/%/model.h5: data/%/flight.h5 data/%/selection.h5 data/%/unseen.h5 data/%/.part/identify.yaml
	$(CPFLS) identify configs/$*.yaml $< --selection data/$*/selection.h5 --validate data/$*/unseen.h5 -o $@ --force

ARTIFACTS := trajectory flight unseen selection model

# The page of a study of the paper holds its claims too.
REPORT = $(CPFLS) report $(1) -o $(2) --force
PAPER_REPORT = $(BIN)/python -m benchmarks.paper.report $(1) -o $(2) $(TIMES)
define made_page
data/%/$(1).html: $(foreach name,$(ARTIFACTS),data/%/$(name).h5) data/%/.part/report.yaml
	$$(call $$(if $$(filter paper quick,$$*),PAPER_REPORT,REPORT),configs/$$*.yaml $$(filter %.h5,$$^),$$@)
endef
$(foreach page,report report-larger report-full,$(eval $(call made_page,$(page))))

# Full rotations: one flight to choose models on, one that judges them; both random, of seeds of their own.
CIRCLE := data/full-circle
$(CIRCLE)/kept-trajectory.h5 $(CIRCLE)/unseen-trajectory.h5: UNSEEN = --set trajectory.path=full-rotation --seed $(CIRCLE_SEED)
$(CIRCLE)/kept-trajectory.h5: CIRCLE_SEED := 101
$(CIRCLE)/unseen-trajectory.h5: CIRCLE_SEED := 201
$(CIRCLE)/kept-trajectory.h5: $(CIRCLE)/.part/trajectory.yaml
	$(CPFLS) trajectory configs/full-circle.yaml -o $@ --force $(UNSEEN)

$(CIRCLE)/kept.h5: $(CIRCLE)/kept-trajectory.h5 $(CIRCLE)/.part/simulate.yaml
	$(CPFLS) simulate configs/full-circle.yaml $< -o $@ --force

# Structures other than the one that wins, as consequents-products-order-functions. Learned from all samples, chosen on
# a flight kept for it and judged on another once; each is a file, so that a stopped loop goes on.
STRUCTURES := $(addprefix seesaw-additive-2-,1 3 5 7) $(addprefix harmonic-additive-1-,1 3 5) \
	$(addprefix harmonic-tensor-1-,1 3) harmonic-additive-2-3 $(addprefix harmonic-tensor-2-,1 3)
of_structure = $(word $(1),$(subst -, ,$*))
$(CIRCLE)/structures/%.h5: $(CIRCLE)/flight.h5 $(CIRCLE)/kept.h5 $(CIRCLE)/unseen.h5 $(CIRCLE)/.part/identify.yaml
	@mkdir -p $(@D)
	$(CPFLS) identify configs/full-circle.yaml $< --choose-on $(word 2,$^) --validate $(word 3,$^) -o $@ \
		--force $(if $(wildcard $@.checkpoint),--resume) --set identification.choice=held-out \
		--set identification.consequents=$(call of_structure,1) --set identification.products=$(call of_structure,2) \
		--set identification.harmonic_order=$(call of_structure,3) --set identification.membership_functions=$(call of_structure,4) \
		--set identification.validation.enabled=false

$(CIRCLE)/report.html: $(STRUCTURES:%=$(CIRCLE)/structures/%.h5)

# The real flight: its logs are in the folder LOGS.
REAL := data/crazyflie
$(REAL)/log%.h5: $(LOGS)/log%.csv $(REAL)/.part/import.yaml
	$(CPFLS) import configs/crazyflie.yaml $< -o $@ --force

$(REAL)/selection.h5: $(REAL)/log119.h5 $(REAL)/.part/reduce.yaml
	$(CPFLS) reduce configs/crazyflie.yaml $< -o $@ --force

$(REAL)/model.h5: $(REAL)/log119.h5 $(REAL)/selection.h5 $(REAL)/log149.h5 $(REAL)/.part/identify.yaml
	$(CPFLS) identify configs/crazyflie.yaml $< --selection $(REAL)/selection.h5 --validate $(REAL)/log149.h5 -o $@ --force

REAL_ARTIFACTS := log119 log149 selection model
$(REAL)/report.html: $(REAL_ARTIFACTS:%=$(REAL)/%.h5) $(REAL)/.part/report.yaml
	$(CPFLS) report configs/crazyflie.yaml $(filter %.h5,$^) -o $@ --force

PAPER := data/paper/report.html data/paper/report-full.html data/paper/report-larger.html
# The printed peaks are those of the gentle path.
$(PAPER): data/paper-gentle/trajectory.h5
$(PAPER): $(TABLE_4_SIZES:%=data/paper/selection-%.h5) data/paper/times.json
$(PAPER): TIMES = --times data/paper/times.json
$(PAPER) data/quick/report.html: $(wildcard benchmarks/paper/*.py)
data/paper/report.html: data/paper/searches-1.h5 data/paper/searches-6.h5 $(call read,readings)
data/paper/report-larger.html: data/paper/searches-1.h5 data/paper/searches-6.h5 data/paper/larger-1.h5 data/paper/larger-6.h5
data/paper/report-full.html: data/paper/full-1.h5 data/paper/full-6.h5 $(call read,readings-full)

# Two flights with an effect that the model lacks; the second is held out. HIDDEN takes several, or none.
HIDDEN := com_offset=0.01,-0.006
GAP := data/gap-example
GAP_CONFIG := configs/gap/example.yaml
GAP_REPORT := $(GAP)/gap/report.html
gap-example: $(GAP_REPORT)
	@echo "open $(GAP_REPORT)"

$(GAP)/.hidden: FORCE | $(INSTALLED)
	@mkdir -p $(@D)
	@echo "$(HIDDEN)" | cmp --silent - $@ || echo "$(HIDDEN)" > $@

$(GAP)/path-1.h5: $(GAP_CONFIG) | $(GAP)/.hidden
	$(CPFLS) trajectory $< -o $@ --force

$(GAP)/path-2.h5: $(GAP_CONFIG) | $(GAP)/.hidden
	$(CPFLS) trajectory $< -o $@ --force --set trajectory.path=straight --set "trajectory.direction=[1.0, -0.6, 0.3]"

$(GAP)/flight-%.h5: $(GAP)/path-%.h5 $(GAP)/.hidden
	$(CPFLS) simulate $(GAP_CONFIG) $< $(addprefix --effect ,$(HIDDEN)) --seed $* -o $@ --force

$(GAP_REPORT): $(GAP_CONFIG) $(GAP)/flight-1.h5 $(GAP)/flight-2.h5
	$(CPFLS) gap $< $(GAP)/flight-1.h5 --held-out $(GAP)/flight-2.h5 -o $(@D) --force

# The picture of README.md: the element alone, without its page.
docs/gap-example.svg: $(GAP_REPORT)
	sed -n '/<figure id="gap-picture-1">/,/<\/svg>/{/<figure/d;s/.*<svg/<svg/;s/<\/svg>.*/<\/svg>/;p}' $< > $@

# Five flights from before, and two with a rotor that lost a fifth of its thrust.
CHANGED := data/changed-example
docs/changed.svg: tests/builders/changed_flights.py | $(INSTALLED)
	$(BIN)/python -m tests.builders.changed_flights $(CHANGED)
	$(CPFLS) changed $(CHANGED)/study.yaml $(CHANGED)/weak*.csv --since $(CHANGED)/before*.csv -o $(CHANGED)/changed --force
	sed -n '/<figure id="changed-1-numbers">/,/<\/svg>/{/<figure/d;s/.*<svg/<svg/;s/<\/svg>.*/<\/svg>/;p}' $(CHANGED)/changed/report.html > $@

# Flights of a vehicle that is not what its config states; the last is held out. Each has a path of its own.
REPLAY := data/replay-example
REPLAY_CONFIG := configs/replay-example.yaml
TRAINING := $(REPLAY)/flight-1.h5 $(REPLAY)/flight-2.h5 $(REPLAY)/flight-3.h5
HELD_OUT := $(REPLAY)/flight-4.h5
replay-example: $(REPLAY)/report.html $(REPLAY)/vehicle.c
	@echo "open $<"

$(REPLAY)/path-2.h5: TOWARDS := [1.0, -0.7, 0.3]
$(REPLAY)/path-2.h5: METRES := 3.5
$(REPLAY)/path-3.h5: TOWARDS := [-0.4, 1.0, -0.2]
$(REPLAY)/path-3.h5: METRES := 2.0
$(REPLAY)/path-4.h5: TOWARDS := [0.8, 1.0, 0.4]
$(REPLAY)/path-4.h5: METRES := 3.2
$(REPLAY)/path-%.h5: $(REPLAY_CONFIG) | $(INSTALLED)
	@mkdir -p $(@D)
	$(CPFLS) trajectory $< -o $@ --force $(if $(TOWARDS),--set trajectory.path=straight \
		--set "trajectory.direction=$(TOWARDS)" --set trajectory.displacement_m=$(METRES))

$(REPLAY)/flight-%.h5: $(REPLAY)/path-%.h5
	$(CPFLS) simulate $(REPLAY_CONFIG) $< --seed $* -o $@ --force

$(REPLAY)/vehicle.h5: $(REPLAY_CONFIG) $(TRAINING) $(HELD_OUT)
	$(CPFLS) vehicle $< $(TRAINING) --held-out $(HELD_OUT) -o $@ --force

$(REPLAY)/replay-stated.h5: $(REPLAY_CONFIG) $(HELD_OUT)
	$(CPFLS) replay $< vehicle $(HELD_OUT) -o $@ --force

$(REPLAY)/replay-found.h5: $(REPLAY_CONFIG) $(REPLAY)/vehicle.h5 $(HELD_OUT)
	$(CPFLS) replay $^ -o $@ --force

$(REPLAY)/vehicle.c: $(REPLAY)/vehicle.h5
	$(CPFLS) export $< -o $@ --force

$(REPLAY)/report.html: $(REPLAY_CONFIG) $(REPLAY)/vehicle.h5 $(REPLAY)/replay-found.h5 $(REPLAY)/replay-stated.h5
	$(CPFLS) report $^ -o $@ --force

# The picture of README.md: the element alone, without its page.
docs/replay-example.svg: $(REPLAY)/report.html
	sed -n '/<figure id="vehicle-errors-1">/,/<\/svg>/{/<figure/d;s/.*<svg/<svg/;s/<\/svg>.*/<\/svg>/;p}' $< > $@

# What the docstrings say, and what the cells of the notebook give.
docs/api.md: FORCE | $(INSTALLED_DEV)
	$(BIN)/python docs/api_page.py > $@.new && mv $@.new $@

docs/notebook.ipynb: FORCE | $(INSTALLED_DEV)
	$(BIN)/python docs/run_notebook.py > $@.new && mv $@.new $@

# Rewriting assertions for their messages takes longer than most tests; what failed runs again with them.
PYTEST := $(BIN)/python -m pytest
test: $(INSTALLED_DEV)
	$(PYTEST) -n 2 --dist worksteal --assert=plain || { $(PYTEST) --last-failed; exit 1; }

# In less than a minute: units alone, but for rooms whose units simulate flights, fit models or start processes.
FLYING := changes consistency export gap identification look playback response simulation tuning validation workers
test-fast: $(INSTALLED_DEV)
	$(PYTEST) -n 2 --dist worksteal --assert=plain tests/unit $(FLYING:%=--ignore=tests/unit/%)

# What decides (words, names, verdicts, choices), with the linear algebra of the plainest processor.
DECIDES = $$(grep -rl --include='*.py' mark.decides tests) -m decides --assert=plain
decides: $(INSTALLED_DEV)
	OPENBLAS_CORETYPE=Prescott $(PYTEST) $(DECIDES)

# The same with the oldest packages that pyproject.toml allows; old ones call what the newest next to them call outdated.
OLDEST := .venv-oldest/bin/python
oldest:
	$(PYTHON) -m venv .venv-oldest
	$(OLDEST) -m pip install --quiet --disable-pip-version-check pytest hypothesis $$($(PYTHON) -c "import tomllib; \
		print(*(each.replace('>=', '==') for each in tomllib.load(open('pyproject.toml', 'rb'))['project']['dependencies']))")
	PYTHONPATH=. $(OLDEST) -m pytest -W ignore::DeprecationWarning $(DECIDES)

lint: $(INSTALLED_DEV)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# A link or an anchor that leads nowhere, or a page in no menu, ends it.
site: $(INSTALLED_DOCS)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

# Each page is a target, so that --jobs types two side by side.
TYPED := $(addprefix typed/,$(wildcard docs/tutorial-*.md) README.md)
.PHONY: $(TYPED)
tutorials: $(TYPED)
$(TYPED): typed/%: | $(INSTALLED)
	$(BIN)/python docs/run_blocks.py $*

# Equal sources give an equal wheel, byte by byte: it is built twice. Then it does what README.md begins with in an
# environment that holds nothing else, and the source distribution is installed in its place.
EMPTY := build/empty/bin
wheel: export SOURCE_DATE_EPOCH := $(shell git log -1 --format=%ct 2>/dev/null || echo 1764000000)
wheel: $(INSTALLED_RELEASE)
	rm -rf dist build
	$(BIN)/python -m build --outdir dist >/dev/null
	$(BIN)/python -m build --wheel --outdir build/again >/dev/null
	cmp dist/*.whl build/again/*.whl
	$(PYTHON) -m venv build/empty
	$(EMPTY)/python -m pip install --quiet --disable-pip-version-check dist/*.whl
	$(EMPTY)/python docs/run_blocks.py README.md
	$(EMPTY)/python -m pip install --quiet --disable-pip-version-check --force-reinstall --no-deps dist/*.tar.gz
	$(EMPTY)/cpfls --version

# Every table is also written to benchmarks/results, as JSON. Programs that measure times run one after the other, the
# rest two at once. Stopped and started again it goes on where it was, unless the code has changed since.
TIMED := evaluation whole_run long_flights gap replay export_speed simulators first_use
UNTIMED := band_coverage trends look_health
bench: $(INSTALLED_BENCH)
	$(MAKE) --jobs=1 data/paper/times.json $(TIMED:%=benchmarks/results/%.done)
	$(MAKE) --jobs=2 --output-sync=target $(UNTIMED:%=benchmarks/results/%.done)

benchmarks/results/%.done: benchmarks/%.py $(shell find cpfls_cli benchmarks/shared tests/builders -name "*.py")
	$(BIN)/python -m benchmarks.$*
	@mkdir -p $(@D) && touch $@

# Stopped and started again it goes on where it was. SIZE takes more options: `python -m benchmarks.blind_study --help`.
SEED := 2027
DRAWS := 6
NONE := 200
blind-study: $(INSTALLED_DEV)
	$(BIN)/python -m benchmarks.blind_study run --out data/blind --seed $(SEED) --draws $(DRAWS) --none $(NONE) $(SIZE)

# A few sets of each group on a seed for development: what a change of the rules does. Flights are flown once and kept.
blind-quick: $(INSTALLED_DEV)
	$(BIN)/python -m benchmarks.blind_study quick --out data/blind-quick --seed 31 --processes 1 $(SIZE)

# What one public log says of each of many vehicles; REPOSITORIES is a folder of clones, owner/name each.
gallery: $(INSTALLED_DEV)
	$(BIN)/python -m benchmarks.gallery $(REPOSITORIES) > docs/gallery.md.new
	mv docs/gallery.md.new docs/gallery.md

# Hostile files, as a table; hours at full size. FUZZ takes more options.
EACH := 10000
fuzz: $(INSTALLED_DEV)
	$(BIN)/python -m benchmarks.fuzz --each $(EACH) $(FUZZ)

clean:
	rm -rf data/paper data/paper-gentle data/quick data/hexarotor data/full-circle data/crazyflie data/gap-example data/replay-example data/changed-example

FORCE:
