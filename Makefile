# `make test` and `make bench` work from a bare machine: both set up what they need first.
BIN := .venv/bin
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
	@$(BIN)/python -m pytest -n 2

test-slow: setup  ## the tests marked slow
	@$(BIN)/python -m pytest -m slow

bench: setup  ## success rate of the policies; writes benchmarks/results
	@$(BIN)/python -m benchmarks.success_rate

lint: setup  ## ruff and codespell
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/codespell

typecheck: setup  ## pyright
	@$(BIN)/pyright

format: setup  ## rewrite the code as ruff formats it
	@$(BIN)/ruff check --fix .
	@$(BIN)/ruff format .

clean:  ## remove the virtual environment and all caches
	rm -rf .venv build dist *.egg-info .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
