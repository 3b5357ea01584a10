"""The one place that knows DOLFINx: capability probes for 0.9 to 0.11, kernel compilation, fast assembly."""

from __future__ import annotations

import contextlib
import hashlib
import logging
import os
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from .errors import MissingDependency

try:
    # isort: split
    import petsc4py
    from mpi4py import MPI  # first: it asks MPI for threads, PETSc does not

    # signals are the program's: Ctrl-C keeps what was computed, a closed pipe is no crash
    petsc4py.init(["drillfem", "-no_signal_handler"])
    import basix.ufl
    import dolfinx
    import dolfinx.fem.petsc
    import ufl
    from petsc4py import PETSc
except ImportError as error:
    raise MissingDependency(
        f"this needs DOLFINx with PETSc ({error}): use ./run (sets it up), the Docker image, "
        "`apt install python3-dolfinx-real python3-petsc4py-real` (Debian 13) or "
        "`conda install -c conda-forge fenics-dolfinx`"
    ) from None

Array = npt.NDArray[np.float64]
log = logging.getLogger("drillfem")


def cache_folder() -> Path:
    """Folder of compiled kernels: $DRILLFEM_CACHE, else $XDG_CACHE_HOME/drillfem, else ~/.cache/drillfem."""
    base = os.environ.get("DRILLFEM_CACHE")
    if base:
        return Path(base)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "drillfem"


@cache
def _processor() -> str:
    """Short hash of what this processor can do: kernels of -march=native must not travel to a lesser one."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith(("flags", "Features")):
                return hashlib.sha256(line.encode()).hexdigest()[:8]
    return "generic"


def jit_options() -> dict[str, Any]:
    """Options of the form compiler: known cache folder, optimised for this processor."""
    return {
        "cache_dir": str(cache_folder() / f"jit-{_processor()}"),
        "cffi_extra_compile_args": ["-O3", "-march=native", "-w"],
        "timeout": 300,
    }


#: FFCx speaks up (to :class:`_Announce` alone) when it compiles rather than loads
_VERBOSE = {"verbosity": logging.INFO}


class _Announce(logging.Handler):
    """Tells the user, once per process, that the form compiler is at work, and afterwards how long it took."""

    def __init__(self) -> None:
        super().__init__(logging.INFO)
        self.told = False
        self.compiled = False

    def emit(self, record: logging.LogRecord) -> None:
        if "Calling JIT C compiler" in record.getMessage():
            self.compiled = True
            if not self.told:
                self.told = True
                log.info("compiling forms, once")


_announce = _Announce()


@contextlib.contextmanager
def _announced() -> Iterator[None]:
    ffcx = logging.getLogger("ffcx")
    level, propagate = ffcx.level, ffcx.propagate
    ffcx.addHandler(_announce)
    ffcx.setLevel(logging.INFO)
    ffcx.propagate = False
    try:
        yield
    finally:
        ffcx.removeHandler(_announce)
        ffcx.setLevel(level)
        ffcx.propagate = propagate


def _name_rules_by_more_digits() -> None:
    """FFCx names quadrature rules in its C code by three hexadecimal digits: two of ours for P4 share them (dc7)."""
    with contextlib.suppress(ImportError, AttributeError):
        from ffcx.ir.representationutils import QuadratureRule

        short = QuadratureRule.id
        QuadratureRule.id = lambda rule: rule.hash_obj.hexdigest()[-12:] if hasattr(rule, "hash_obj") else short(rule)


_name_rules_by_more_digits()


def compile_form(form: ufl.Form) -> dolfinx.fem.Form:
    """Compile a form; the first time ever on a machine this takes seconds and says so."""
    with _announced():
        start = time.perf_counter()
        _announce.compiled = False
        compiled = dolfinx.fem.form(form, form_compiler_options=_VERBOSE, jit_options=jit_options())
        if _announce.compiled:
            log.debug("compiled a form in %.1f s", time.perf_counter() - start)
    return compiled


def compile_expression(expression: Any, points: Array, comm: MPI.Comm) -> dolfinx.fem.Expression:
    """Compile an expression for evaluation at reference points (n, 1)."""
    with _announced():
        return dolfinx.fem.Expression(
            expression, points, comm=comm, form_compiler_options=_VERBOSE, jit_options=jit_options()
        )


def lagrange(mesh: dolfinx.mesh.Mesh, degree: int, size: int) -> dolfinx.fem.FunctionSpace:
    """Continuous vector field with ``size`` components, one block per node."""
    return dolfinx.fem.functionspace(mesh, basix.ufl.element("Lagrange", "interval", degree, shape=(size,)))


def discontinuous(mesh: dolfinx.mesh.Mesh, degree: int, size: int | None = None) -> dolfinx.fem.FunctionSpace:
    """Discontinuous field: scalar, or with ``size`` components."""
    shape = {} if size is None else {"shape": (size,)}
    return dolfinx.fem.functionspace(
        mesh, basix.ufl.element("Lagrange", "interval", degree, discontinuous=True, **shape)
    )


def quadrature_field(mesh: dolfinx.mesh.Mesh, degree: int, size: int) -> tuple[dolfinx.fem.Function, Array]:
    """A field of ``size`` numbers known at the points of a rule alone, and its block of every point (cells, points)."""
    element = basix.ufl.quadrature_element("interval", value_shape=(size,), degree=degree)
    V = dolfinx.fem.functionspace(mesh, element)
    return dolfinx.fem.Function(V), V.dofmap.list


def reference_nodes(V: dolfinx.fem.FunctionSpace) -> Array:
    """Reference points (n, 1) of the nodes of a space: a method in 0.9, a property later."""
    points = V.element.interpolation_points
    return points() if callable(points) else points


def gauss_points(count: int) -> Array:
    """Gauss-Legendre points on the reference interval, shape (count, 1)."""
    return ((np.polynomial.legendre.leggauss(count)[0] + 1) / 2)[:, None]


class VectorForm:
    """A compiled linear form that assembles into a NumPy array with little overhead."""

    def __init__(self, form: ufl.Form) -> None:
        self.form = compile_form(form)
        self._cpp = self.form._cpp_object

    def __call__(self, out: Array) -> Array:
        """Assemble into ``out`` (owned dofs), which is overwritten."""
        out[:] = 0.0
        cpp = dolfinx.cpp.fem
        cpp.assemble_vector(out, self._cpp, cpp.pack_constants(self._cpp), cpp.pack_coefficients(self._cpp))
        return out

    def at_ends(self, out: Array) -> Array:
        """Assemble; only the end conditions' rows of ``out`` need be right."""
        return self(out)


class ScalarForm:
    """A compiled functional."""

    def __init__(self, form: ufl.Form) -> None:
        self.form = compile_form(form)
        self._cpp = self.form._cpp_object

    def __call__(self) -> float:
        cpp = dolfinx.cpp.fem
        return float(cpp.assemble_scalar(self._cpp, cpp.pack_constants(self._cpp), cpp.pack_coefficients(self._cpp)))


class MatrixForm:
    """A compiled bilinear form with its PETSc matrix."""

    def __init__(self, form: ufl.Form) -> None:
        self.form = compile_form(form)

    def create(self) -> PETSc.Mat:
        """An empty matrix with the sparsity of the form."""
        matrix = dolfinx.fem.petsc.create_matrix(self.form)
        # dolfinx.fem has no portable way to keep rows that are replaced later: the diagonal must exist
        matrix.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
        return matrix

    def __call__(self, matrix: PETSc.Mat) -> PETSc.Mat:
        """Assemble into ``matrix``, which is overwritten."""
        matrix.zeroEntries()
        dolfinx.fem.petsc.assemble_matrix(matrix, self.form)
        matrix.assemble()
        return matrix

    def dense(self) -> Array:
        """The assembled matrix as a dense array."""
        matrix = self(self.create())
        array = matrix.convert("dense").getDenseArray().copy()
        matrix.destroy()
        return array
