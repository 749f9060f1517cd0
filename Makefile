# Two commands do everything from a fresh clone: `make demo` and `make test`.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
# A new pip takes half the time of Python 3.11's; Python compiles what is imported, not all of torch. The
# constraints name every package: they are installed by two processes, and only resolved where some of them are
# not for this machine.
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check
OUT ?= out/demo
BENCHMARK ?= out/benchmark.json

# Without its bytecode every start of Python compiles all that it imports: a command takes twice as long to begin.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: install demo test lint types docs validate benchmark endurance protobuf schema samples tables clean

install: $(STAMP)

$(STAMP): pyproject.toml constraints.txt scripts/system_libraries.sh
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "EndoTwin needs Python 3.11 or later; $(PYTHON) is $$($(PYTHON) --version). Try: make PYTHON=python3.11" >&2; exit 2; }
	@sh scripts/system_libraries.sh
	@$(PYTHON) -m venv $(VENV) \
	  || { echo "cannot make $(VENV): install the package python3-venv (apt-get install python3-venv)" >&2; exit 2; }
	$(PIP) --upgrade pip
	@{ grep -v '^#' constraints.txt | xargs -P 2 -n 24 $(PIP) --no-compile --no-deps \
	  && $(PIP) --no-deps --no-build-isolation -e . \
	  && $(BIN)/python -m pip check; } >/dev/null 2>&1 || $(PIP) --no-compile -c constraints.txt -e '.[all,dev]'
	@touch $@

demo: install
	$(BIN)/endotwin demo --out $(OUT)

# Types are checked while kernels are compiled: mypy has one process.
test: lint
	@$(BIN)/mypy & types=$$!; $(BIN)/python tests/support/compiled.py && $(BIN)/python -m pytest; tests=$$?; \
	  wait $$types && exit $$tests

lint: install
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: install
	$(BIN)/mypy

# The documents as a site, in out/site: look at it with `python3 -m http.server -d out/site`.
docs: install
	$(BIN)/python docs/site/build.py out

# Half an hour: the real demo and its figures, documented commands, tutorials, browser, wheel, site.
validate: install
	$(BIN)/python -m pytest -m 'slow and not endurance' --durations=0

benchmark: install
	$(BIN)/endotwin benchmark --out $(BENCHMARK)

# Commands killed 300 times, disks that fill up, 5,000 hostile runs, 10,000 damaged files.
endurance: install
	$(BIN)/python -m pytest -m endurance -n 0 -s

protobuf: install
	$(BIN)/python -m grpc_tools.protoc -I twin/recording --python_out twin/recording --pyi_out twin/recording \
	  twin/recording/endotwin.proto

# The lines of `endotwin run`, for programs in other languages.
schema: install
	$(BIN)/python -m twin.live.lines > assets/run_protocol.schema.json

# Sample logs and a tiny dataset, which `endotwin samples` copies.
samples: install
	$(BIN)/python -m scripts.studies.make_samples

# Tables and figures of the documents, from the files of docs/data.
tables: install
	$(BIN)/python -m scripts.studies.tables

clean:
	rm -rf $(VENV) out build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
