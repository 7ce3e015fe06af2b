# Everything runs in .venv, which is built once, and again when its pins change.
PYTHON := .venv/bin/python
SUBJECT ?= camera

.PHONY: help setup develop ros episode test endurance lint benchmark results claims pictures docs dist clean

help: ## show this list
	@sed -n 's/^\([a-z]*\):.*## /  make \1\t/p' Makefile

setup: .venv/installed ## install what an episode needs: missing system packages, and Python packages in .venv

develop: .venv/installed-dev ## also install what tests, style checks and benchmarks need

.venv/installed: pyproject.toml setup.py requirements.txt scripts/setup.sh
	@scripts/setup.sh
	@touch $@

.venv/installed-dev: .venv/installed requirements-dev.txt
	@scripts/setup.sh dev
	@touch $@

ros: develop ## add ROS 2 to .venv if no other installation is sourced; 'make test' then also runs the ROS tests
	$(PYTHON) -m pip --disable-pip-version-check --quiet install --constraint requirements.txt --no-build-isolation \
	    --editable '.[ros]' ros-test-msgs==2.3.0

episode: setup ## explore the NIST 6 x 4 m arena; leaves a recording and a report in runs/nist_6x4-0
	$(PYTHON) scripts/run_episode.py --view web

# Each core begins with tests that stand together, which share fixtures, and takes over others' when it is done.
# Bytecode is kept, even where Python is told to write none, for the many processes that tests start.
test: develop ## run all tests on all cores
	PYTHONDONTWRITEBYTECODE= $(PYTHON) -m pytest -n logical --dist worksteal

endurance: develop ## check 200 random arenas, try 2,000 broken files and robots, kill a dataset generator, run all examples in the docs
	SEEDS=200 KILLS=10 SARSIM_MUTATIONS=2000 SARSIM_DOCUMENTS=1 $(PYTHON) -m pytest \
	    tests/sarsim/arenas/test_random_arena.py tests/sarsim/dataset/test_disturbed.py tests/sarsim/test_jobs.py \
	    tests/test_foreign_files.py \
	    tests/test_documents_run.py

lint: develop ## check style, types and who imports whom
	$(PYTHON) -m ruff check
	$(PYTHON) -m ruff format --check
	.venv/bin/lint-imports --no-cache
	$(PYTHON) -m mypy

benchmark: develop ## compare with other software, such as make benchmark SUBJECT=camera
	$(PYTHON) scripts/benchmark.py $(SUBJECT)

results: develop ## measure and write all pages of results, or one: make results PAGE=metric-map FLAGS="--frames 8" AGAIN=1
	$(PYTHON) scripts/results.py $(PAGE) $(if $(FLAGS),--flags="$(FLAGS)") $(if $(FOLDER),--folder "$(FOLDER)") $(if $(AGAIN),--again)

claims: develop ## check the claims in the section Reproduce of README, and report which hold
	$(PYTHON) scripts/results.py --claims

pictures: develop ## draw the pictures of the run that PAGE=episode measured, or others: make pictures PICTURE="camera lanes"
	$(PYTHON) scripts/draw_pictures.py $(PICTURE)

docs: develop .venv/docs-installed ## build the documentation site in build/site
	NO_MKDOCS_2_WARNING=1 $(PYTHON) -m mkdocs build --strict --quiet
	@echo "to read it: $(PYTHON) -m http.server --bind 127.0.0.1 --directory build/site"

.venv/docs-installed: docs/requirements.txt
	$(PYTHON) -m pip --disable-pip-version-check --quiet install --no-deps --requirement $<
	@touch $@

# From the sdist alone, so that it is whole.
dist: setup ## build the wheel and the sdist in dist/
	rm -rf dist
	$(PYTHON) -c "from setuptools import build_meta; build_meta.build_sdist('dist')" >/dev/null
	$(PYTHON) -m pip --quiet wheel --no-deps --no-build-isolation --wheel-dir dist dist/*.tar.gz
	@ls -sh dist

clean: ## remove everything that was built, including .venv, but keep runs/
	rm -rf .venv build dist *.egg-info .hypothesis .mypy_cache .pytest_cache .ruff_cache
	find . -name __pycache__ -prune -exec rm -rf {} +
