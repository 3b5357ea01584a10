# docker run -v "$PWD/results:/results" drillfem                    the demo; its results land in ./results
# docker run drillfem drillfem list                                 any command
# docker run --user "$(id -u):$(id -g)" -v "$PWD:/results" drillfem mpirun -n 2 python3 my.py
FROM debian:trixie-slim

COPY packages.txt requirements.txt /opt/drillfem/
# tini hands signals on to all processes: `docker stop` and Ctrl-C end a run as they do outside
RUN apt-get update \
    && sed 's/#.*//' /opt/drillfem/packages.txt | DEBIAN_FRONTEND=noninteractive xargs apt-get install -y --no-install-recommends tini \
    && rm -rf /var/lib/apt/lists/*

# Where the network needs the host's certificates: --build-arg PIP_CERT=/host-ca.crt -v /etc/ssl/certs/ca-certificates.crt:/host-ca.crt:ro
ARG PIP_CERT
RUN python3 -m venv --system-site-packages /opt/drillfem/venv \
    && /opt/drillfem/venv/bin/pip install -q --no-cache-dir -r /opt/drillfem/requirements.txt

# any user may run it (docker run --user): HOME and the cache of compiled kernels belong to all
ENV PATH=/opt/drillfem/venv/bin:$PATH HOME=/opt/drillfem/home USER=drillfem DRILLFEM_CACHE=/opt/drillfem/cache \
    NUMBA_CACHE_DIR=/opt/drillfem/cache/numba OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 \
    OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OMPI_MCA_btl=self,sm \
    PRTE_MCA_rmaps_default_mapping_policy=:oversubscribe HWLOC_HIDE_ERRORS=2 UCX_LOG_LEVEL=error \
    MPLBACKEND=Agg VTK_DEFAULT_OPENGL_WINDOW=vtkEGLRenderWindow PYTHONDONTWRITEBYTECODE=1

COPY . /opt/drillfem/src
RUN pip install -q --no-cache-dir --no-deps --no-build-isolation /opt/drillfem/src \
    && rm -rf /opt/drillfem/src/build /opt/drillfem/src/*.egg-info \
    && useradd --home-dir /opt/drillfem/home drillfem \
    && mkdir -p /opt/drillfem/home /opt/drillfem/cache /results \
    && cd / && drillfem warm-up \
    && chmod -R a+rwX /opt/drillfem/home /opt/drillfem/cache && chmod 1777 /results

USER drillfem
WORKDIR /results
ENTRYPOINT ["tini", "-g", "--"]
CMD ["make", "-s", "-C", "/opt/drillfem/src", "demo", "RUN=", "OUT=/results"]
