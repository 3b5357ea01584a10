# RUN= (empty) runs a target in the current environment, as the image does.
RUN ?= ./run
OUT ?= results
ARGS ?=
IMAGE ?= drillfem

.PHONY: demo demo-well test lint verify image

demo: ## the main job: a 1200 m string drills rock; history, pictures and a table in $(OUT)/demo
	$(RUN) drillfem demo --out $(OUT)/demo

demo-well: ## a string starts to turn in a real, horizontal well; pictures, a film, torque and drag in $(OUT)/demo-well
	$(RUN) drillfem demo well --out $(OUT)/demo-well

test: ## the fast tests, on two cores; ARGS="-k bit -x" goes to pytest
	$(RUN) pytest -n 2 --dist loadfile $(ARGS)

lint:
	$(RUN) ruff check
	$(RUN) ruff format --check
	$(RUN) mypy

verify: ## the long tests and the benchmarks (hours)
	$(RUN) pytest -m "verify or slow" $(ARGS)
	for bench in benchmarks/*.py; do $(RUN) python3 $$bench || exit 1; done

# CERT=FILE hands the certificates of the host to pip, where the network needs them (podman, buildah).
image: ## with docker, podman or buildah
	@builder=$$($(if $(CERT),,command -v docker ||) command -v podman || command -v buildah) || \
	    { echo "make image needs $(if $(CERT),,docker, )podman or buildah" >&2; exit 1; }; \
	$$builder build -t $(IMAGE) $(if $(CERT),--build-arg PIP_CERT=/host-ca.crt -v $(CERT):/host-ca.crt:ro) .
