# Two commands do everything from a fresh clone: `make demo` and `make test`.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
OUT ?= out/demo
BENCHMARK ?= out/benchmark.json

.PHONY: install demo test lint types benchmark endurance protobuf clean

install: $(STAMP)

$(STAMP): pyproject.toml constraints.txt scripts/system_libraries.sh
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "EndoTwin needs Python 3.11 or later; $(PYTHON) is $$($(PYTHON) --version). Try: make PYTHON=python3.11" >&2; exit 2; }
	@sh scripts/system_libraries.sh
	@$(PYTHON) -m venv $(VENV) \
	  || { echo "cannot make $(VENV): install the package python3-venv (apt-get install python3-venv)" >&2; exit 2; }
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	@touch $@

demo: install
	$(BIN)/endotwin demo --out $(OUT)

test: lint types
	$(BIN)/python -m pytest

lint: install
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: install
	$(BIN)/mypy

benchmark: install
	$(BIN)/endotwin benchmark --out $(BENCHMARK)

endurance: install
	$(BIN)/python -m pytest -n 0 -s tests/dataset/test_interrupted.py tests/recording/test_mutations.py --kills 100 --mutations 10000

protobuf: install
	$(BIN)/python -m grpc_tools.protoc -I twin/recording --python_out twin/recording --pyi_out twin/recording \
	  twin/recording/endotwin.proto

clean:
	rm -rf $(VENV) out build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
