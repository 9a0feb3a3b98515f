# `make test` and `make bench` work from a bare machine: both set up what they need first.
PYTHON_HERE := .venv/bin/python
export PYTHON

.DEFAULT_GOAL := help
.PHONY: help setup system test test-slow bench lint typecheck format clean

help:  ## list the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## /  make \1\t/' | expand -t 20

setup:  ## make .venv and, as root on Debian or Ubuntu, install the Vulkan driver
	@scripts/setup.sh

system:  ## install the system packages alone (as root)
	@scripts/system_packages.sh

test: lint  ## lint and every test but the slow ones
	@$(PYTHON_HERE) -m pytest -n 2

test-slow: setup  ## the tests marked slow
	@$(PYTHON_HERE) -m pytest -m slow

bench: setup  ## success rate of the policies; writes benchmarks/results and the pages that quote it
	@$(PYTHON_HERE) -m benchmarks.success_rate
	@$(PYTHON_HERE) -m benchmarks.report

lint: setup  ## ruff and codespell
	@$(PYTHON_HERE) -m ruff check .
	@$(PYTHON_HERE) -m ruff format --check .
	@$(PYTHON_HERE) -m codespell_lib

typecheck: setup  ## pyright
	@$(PYTHON_HERE) -m pyright

format: setup  ## rewrite the code as ruff formats it
	@$(PYTHON_HERE) -m ruff check --fix .
	@$(PYTHON_HERE) -m ruff format .

clean:  ## remove the virtual environment and all caches
	rm -rf .venv build dist *.egg-info .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
