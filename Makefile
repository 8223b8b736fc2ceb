# Everything a checkout can do, in a local .venv. `make help` lists it.
# Needs only make and Python 3.10 or newer; installs with uv where it is on PATH, else with pip.

PYTHON ?= # the interpreter to build .venv with; empty: the first suitable one on PATH
DEMO   ?= runs/demo

BIN := .venv/bin/python
UV  := $(shell command -v uv 2>/dev/null)

.DEFAULT_GOAL := help
.PHONY: help install install-dev demo docs test test-portable lint typecheck benchmark clean distclean

help: ## show this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-14s %s\n", $$1, $$2 }' $(firstword $(MAKEFILE_LIST))

demo: install ## train a PPO spoofer, evaluate it, write tables and a figure to runs/demo
	$(BIN) -m train.spoofer --out $(DEMO)
	$(BIN) -m spoofgym evaluate spoofers --attacker $(DEMO) --json $(DEMO)/evaluation.json --figure $(DEMO)/evaluation.png

# where bytecode is switched off, each worker and each program that a test starts would compile all sources anew
test: install-dev ## run the tests; options in ARGS, e.g. make test ARGS="-k geodesy"
	PYTHONDONTWRITEBYTECODE= $(BIN) -m pytest --durations=10 $(ARGS)

test-portable: install-dev ## run the numerical tests in the arithmetic of an older processor; options in ARGS
	$(BIN) -m tests.other_kernels $(ARGS)

lint: install-dev ## check style and docstrings
	$(BIN) -m ruff check .

typecheck: install-dev ## check types
	$(BIN) -m mypy

docs: install-dev ## build the documentation into docs/_build/html; a warning is an error
	@if $(BIN) -c 'import sys; sys.exit(sys.version_info >= (3, 11))'; then \
	    echo "not built: the documentation needs Python 3.11 or newer"; \
	else \
	    $(BIN) -m sphinx -W --keep-going -q -b html docs docs/_build/html && echo "docs/_build/html/index.html"; \
	fi

benchmark: install ## measure environment steps per second
	$(BIN) -m benchmarks.throughput

install: .venv/.installed-train ## make .venv with what the programs need
install-dev: .venv/.installed-dev ## the same, and the tools of a developer

clean: ## remove caches, compiled kernels and built packages (keeps .venv and runs/)
	rm -rf build dist docs/_build .pytest_cache .hypothesis .ruff_cache .mypy_cache
	find . -name .venv -prune -o -name __pycache__ -type d -exec rm -rf {} +

distclean: clean ## remove .venv, too
	rm -rf .venv

# ---- installation: a stamp per set of packages, so that a second call does nothing;
# bytecode is compiled at the end, on all cores (pip would use one), but not that of large parts that nothing here imports

UNUSED := /(tests|sympy|mpmath|networkx|pip|setuptools|torch/(_dynamo|_inductor|distributed|testing))/

.venv/.installed-train: EXTRAS := train
.venv/.installed-dev:   EXTRAS := train,dev

.venv/.installed-%: pyproject.toml constraints.txt | $(BIN)
	@echo "installing spoofgym[$(EXTRAS)] into .venv (PyTorch is large; this happens once)"
ifdef UV
	UV_FIND_LINKS="$$($(BIN) -m pip config get global.find-links 2>/dev/null | paste -sd, -)" \
	"$(UV)" pip install --python $(BIN) -c constraints.txt -e ".[$(EXTRAS)]"
else
	$(BIN) -m pip install --no-compile --disable-pip-version-check -c constraints.txt -e ".[$(EXTRAS)]"
endif
	@$(BIN) -m compileall -qq -j 0 -x '$(UNUSED)' .venv/lib >/dev/null 2>&1 || true
	@touch $@

$(BIN):
	@for python in $(or $(strip $(PYTHON)),python3 python3.13 python3.12 python3.11 python3.14 python3.10 python); do \
	    if "$$python" -c 'import sys, venv, ensurepip; sys.exit(not (3, 10) <= sys.version_info[:2] <= (3, 14))' 2>/dev/null; then \
	        echo "making .venv with $$("$$python" --version)"; \
	        exec "$$python" -m venv .venv; \
	    fi; \
	done; \
	echo "error: no Python 3.10 to 3.14 with the venv module on PATH. Install one (Debian and Ubuntu: also" >&2; \
	echo "python3-venv), or name it: make PYTHON=/path/to/python3" >&2; \
	exit 1
