# make render [SCENE=scenes/tree.plsys] [OUT=tree.png]   sets everything up and draws a scene
# make test                                              sets up what tests need and runs them
# make help                                              the rest
SCENE ?= scenes/tree.plsys
OUT ?= $(basename $(notdir $(SCENE))).png
PYTHON ?= python3
BIN := .venv/bin

# What an installation is made of: a change in any of them installs again.
SOURCES := pyproject.toml CMakeLists.txt README.md LICENSE grammar/src/parser.c \
  $(shell find compiler lsp runtime -name '*.py' -o -name '*.c' -o -name '*.h')
RUNTIME_C := $(wildcard runtime/*.c runtime/shapes/*.c runtime/accel/*.c)
CFLAGS_DEV := -std=gnu11 -O3 -g -Wall -Wextra -Werror -Wno-psabi -ffp-contract=off -fno-math-errno -fPIC -fvisibility=hidden -Iruntime -Iruntime/include

.PHONY: render test stress help dev generate bench bench-lsp check-generated bless wheel clean

render: .venv/.installed ## draw SCENE to OUT
	$(BIN)/plsys render $(SCENE) -o $(OUT)

test: .venv/.tests ## run all tests
	sh tests/install_povray.sh
	sh tests/editors/install.sh $(BIN)/python
	$(BIN)/python -m pytest tests

stress: .venv/.tests ## the tests that try at random, for hours: 10^6 edits, 10^5 messages, 10^4 extreme scenes
	PLSYS_STRESS=1 $(BIN)/python -m pytest tests/grammar/test_incremental.py tests/compiler/test_mutated.py \
	  tests/lsp/test_editing.py tests/lsp/test_hostile.py tests/test_extremes.py

help: ## this list
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1 \t\2/p' Makefile | expand -t 24

.venv/bin/python:
	sh tests/make_venv.sh $(PYTHON)

.venv/.builder: .venv/bin/python
	$(BIN)/python -m pip install --quiet scikit-build-core cmake ninja
	touch $@

.venv/.installed: .venv/.builder $(SOURCES)
	$(BIN)/python -m pip install --quiet --no-build-isolation .
	touch $@

.venv/.tests: .venv/.installed pyproject.toml
	$(BIN)/python -m pip install --quiet --no-build-isolation '.[test]'
	touch $@

# libembree-dev and povray are Debian's; the bench says what is missing.
.venv/.bench: .venv/.installed pyproject.toml
	$(BIN)/python -m pip install --quiet --no-build-isolation '.[bench]'
	touch $@

dev: runtime/libplsys.so compiler/libelementary.so compiler/libgrammar.so ## build the C parts in place, for PYTHONPATH use

runtime/libplsys.so: $(RUNTIME_C) $(shell find runtime -name '*.h')
	$(CC) $(CFLAGS_DEV) -shared -o $@ $(RUNTIME_C) -lm -lpthread
compiler/libelementary.so: runtime/elementary.c $(wildcard runtime/*.h)
	$(CC) $(CFLAGS_DEV) -shared -o $@ runtime/elementary.c -lm
compiler/libgrammar.so: grammar/src/parser.c
	$(CC) -O2 -fPIC -shared -Igrammar/src -o $@ grammar/src/parser.c

generate: ## write all generated files again
	$(PYTHON) runtime/generate.py
	$(PYTHON) grammar/generate.py

bench: .venv/.bench ## measure plsys, Embree, POV-Ray and Mitsuba side by side (ONLY=order20,menger QUICK=1)
	PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/python tests/bench/bench.py $(if $(ONLY),--only $(ONLY)) $(if $(QUICK),--quick) $(BENCH)

bench-lsp: .venv/.tests ## measure the language server against its budgets
	$(BIN)/python tests/bench/lsp.py

check-generated: ## fail if a generated file isn't what its table gives
	$(PYTHON) runtime/generate.py --check
	$(PYTHON) grammar/generate.py --check

bless: .venv/.tests ## rewrite the expected texts of golden tests
	PLSYS_BLESS=1 $(BIN)/python -m pytest tests

wheel: .venv/.builder ## build a wheel into dist/
	$(BIN)/python -m pip wheel --no-deps --no-build-isolation -w dist .

clean: ## remove everything that was built
	rm -rf .venv build dist runtime/*.so compiler/*.so
