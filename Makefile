# make demo: the main job. make test: the tests. Both make the virtual environment first, with nothing but python3.
PYTHON ?= python3
VENV := .venv
DEMO := --method acc,slot,ipcb,pgm-g,pgm,pgm-symmetric,fg,fg-gmm,dbn-pf,interactive,always-go,always-yield,oracle-best \
	--world closed-form --source surrogate --out out/demo
BIN := $(VENV)/bin

.PHONY: demo test coverage lint docs clean

demo: $(VENV)/installed
	$(BIN)/merge-cosim sweep designed-2 $(DEMO) --verify 0.005 --overwrite
	$(BIN)/merge-cosim sweep us101-replay $(DEMO) --add
	$(BIN)/merge-cosim report out/demo
	@$(BIN)/merge-cosim summary out/demo --verdict

test: $(VENV)/installed
	$(BIN)/pytest -n auto --dist worksteal

coverage: $(VENV)/installed
	$(BIN)/pytest -n auto --dist worksteal --cov=merge_cosim --cov-branch --cov-report=term:skip-covered

lint: $(VENV)/installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

docs: out/venv-docs/installed
	NO_MKDOCS_2_WARNING=1 out/venv-docs/bin/mkdocs build --strict --quiet
	@echo "open out/site/index.html"

clean:
	rm -rf $(VENV) out

$(VENV)/installed: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "make: Python 3.11 or newer is needed; name one with PYTHON=python3.12"; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[dev]'
	@touch $@

# The API reference is read from the source text, so the docs need neither SUMO nor the package itself.
out/venv-docs/installed: pyproject.toml
	$(PYTHON) -m venv out/venv-docs
	out/venv-docs/bin/python -m pip install --quiet --disable-pip-version-check \
		$$($(PYTHON) -c 'import tomllib; print(*tomllib.load(open("pyproject.toml", "rb"))["project"]["optional-dependencies"]["docs"])')
	@touch $@
