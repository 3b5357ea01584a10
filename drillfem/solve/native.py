"""Compiled loops over the elements of a string: forms by their FFCx kernels, and a direct solver (`native.c`).

The kernels are those that DOLFINx calls. What is saved is everything around them: coefficients are read straight from
the vectors, element matrices go straight into the elimination, and Python is entered once per form.
"""

from __future__ import annotations

import hashlib
import importlib.util
import logging
import sysconfig
import tempfile
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cffi
import dolfinx
import numpy as np
import numpy.typing as npt
import ufl

from ..compat import Array, compile_form, jit_options
from ..models.rod import Rod
from .lanes import DECLARATIONS, kernel_names, with_lanes
from .newton import DRAGGING, MAX_ITERATIONS, PATIENCE, STALLED, TOLERANCE, BitCoupledNewton, Outcome

if TYPE_CHECKING:
    from .compiled import CompiledSystem

log = logging.getLogger("drillfem")
I4 = npt.NDArray[np.int32]
_REACHES = "the kinematic rows of this rod reach beyond their nodes: use time.engine = 'petsc'"
#: Answers of `newton` in native.c that are no Outcome.
_OUTSIDE, _NOT_LOCAL = 4, 5
_SOURCE = Path(__file__).with_name("native.c")


@cache
def _announce() -> None:
    """Tell the user, once per process, why it takes a while."""
    log.info("compiling loops, once")


def _load(source: str, declarations: str) -> Any:
    """A compiled library: a module with ``lib`` and ``ffi``. Compiled once per source and processor."""
    options = jit_options()
    # as the form compiler, but with fused products, and no errno in the way of SIMD roots
    arguments = ["-std=c17", *options["cffi_extra_compile_args"], "-ffp-contract=fast", "-fno-math-errno"]
    key = hashlib.sha256(repr((source, declarations, arguments, cffi.__version__)).encode()).hexdigest()[:16]
    name, folder = f"drillfem_native_{key}", Path(options["cache_dir"])
    path = folder / (name + sysconfig.get_config_var("EXT_SUFFIX"))
    if not path.exists():
        _announce()
        builder = cffi.FFI()
        builder.cdef(declarations)
        builder.set_source(name, source, extra_compile_args=arguments)
        folder.mkdir(parents=True, exist_ok=True)
        # moved into place whole: several processes may do so at once
        with tempfile.TemporaryDirectory(dir=folder) as work:
            Path(builder.compile(tmpdir=work)).replace(path)
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@cache
def library() -> Any:
    """The loops of `native.c`."""
    source = _SOURCE.read_text(encoding="utf-8")
    return _load(source, source.split("/* DECLARATIONS */")[1].split("/* END */")[0])


def source_of(form: dolfinx.fem.Form) -> Path:
    """The C file that a form was compiled from: FFCx leaves it beside its library."""
    library = Path(form.module.__file__)
    return library.with_name(library.name.split(".")[0] + ".c")


def _kernels_with_lanes(form: dolfinx.fem.Form, numbers: list[int]) -> tuple[list[int], Any]:
    """Addresses of kernels of a form rewritten to do several elements at once, and what keeps them alive; or none."""
    code = source_of(form)
    try:
        text = code.read_text(encoding="utf-8")
        names = kernel_names(text)
        module = _load(with_lanes(text, [names[i] for i in numbers]), DECLARATIONS)
    except (OSError, ValueError, cffi.VerificationError) as error:
        log.debug("%s: no lanes (%s)", code, error)
        return [], None
    return [int(module.lib.kernel_address(i)) for i in range(len(numbers))], module


def _aligned(size: int) -> Array:
    """Zeros (size,) that begin where SIMD units want them to."""
    room = np.zeros(size + 8)
    return room[-room.ctypes.data // 8 % 8 :][:size]


def _entities(mesh: dolfinx.mesh.Mesh, kind: str, data: Any, number: int) -> Iterator[tuple[int, int]]:
    """Cells of an integral, and the local number of their facet (0 for an integral over cells)."""
    of_cell = kind == "cell"
    mesh.topology.create_connectivity(0, 1)
    mesh.topology.create_connectivity(1, 0)
    if number != -1:
        found = data.find(number) if hasattr(data, "find") else dict(data)[number]
    elif of_cell:
        found = np.arange(mesh.topology.index_map(1).size_local)
    else:
        found = dolfinx.mesh.exterior_facet_indices(mesh.topology)
    cells, facets = mesh.topology.connectivity(0, 1), mesh.topology.connectivity(1, 0)
    for entity in found.tolist():
        if of_cell:
            yield entity, 0
        else:
            (cell,) = cells.links(entity)
            yield int(cell), facets.links(cell).tolist().index(entity)


class _Form:
    """A form in the shape that the loops read. Everything that they point to is kept alive here."""

    def __init__(self, form: ufl.Form, rod: Rod) -> None:
        self.form = compile_form(form)
        native = library()
        self._lib, self._ffi = native.lib, native.ffi
        self._keep: list[Any] = [rod.mesh]
        c = self.c = self._ffi.new("struct form *")
        nodes = np.ascontiguousarray(rod.V.dofmap.list, dtype=np.int32)
        c.cells, c.nodes = nodes.shape
        c.block = rod.ansatz.size
        c.dofs = self._pointer(nodes, "int32_t *")
        geometry = rod.mesh.geometry
        c.geometry = self._pointer(np.ascontiguousarray(geometry.x[geometry.dofmap]), "double *")
        compiled = self.form.ufcx_form
        self._fields(form, compiled)
        self._constants(form)
        self._actions(form, compiled, rod.mesh)

    def _pointer(self, array: Any, kind: str) -> Any:
        self._keep.append(array)
        return self._ffi.cast(kind, array.ctypes.data)

    def _fields(self, form: ufl.Form, compiled: Any) -> None:
        ffi, c = self._ffi, self.c
        used = [
            form.coefficients()[compiled.original_coefficient_positions[i]] for i in range(compiled.num_coefficients)
        ]
        fields = ffi.new("struct field[]", max(len(used), 1))
        offset = 0
        for field, f in zip(fields, used, strict=False):
            dofmap = f.function_space.dofmap
            dofs = np.ascontiguousarray(dofmap.list, dtype=np.int32)
            field.values = self._pointer(f.x.array, "double *")
            self._keep.append(f)
            field.dofs = self._pointer(dofs, "int32_t *")
            field.nodes, field.block, field.offset = dofs.shape[1], dofmap.index_map_bs, offset
            offset += dofs.shape[1] * dofmap.index_map_bs
        self._keep.append(fields)
        c.fields, c.n_fields = fields, len(used)
        c.w = self._pointer(np.zeros(max(offset, 1)), "double *")
        c.width = offset

    def _constants(self, form: ufl.Form) -> None:
        ffi, c = self._ffi, self.c
        used = form.constants()
        constants = ffi.new("struct constant[]", max(len(used), 1))
        for constant, value in zip(constants, used, strict=False):
            # the very memory that Constant.value writes to
            constant.value = self._pointer(value.value, "double *")
            constant.size = value.value.size
            self._keep.append(value)
        self._keep.append(constants)
        c.constants, c.n_constants = constants, len(used)
        c.c = self._pointer(np.zeros(max(sum(value.value.size for value in used), 1)), "double *")

    def _at(self, where: list[list[tuple[int, int]]], number: int, found: list[tuple[int, int]]) -> None:
        """Have a kernel called for some cells and facets, one by one."""
        kernel = self.form.ufcx_form.form_integrals[number].tabulate_tensor_float64
        address = int(self.form.module.ffi.cast("uintptr_t", kernel))
        for cell, facet in found:
            where[cell].append((address, facet))

    def _actions(self, form: ufl.Form, compiled: Any, mesh: Any) -> None:
        ffi, c = self._ffi, self.c
        where: list[list[tuple[int, int]]] = [[] for _ in range(c.cells)]
        ((_, data),) = form.subdomain_data().items()
        begins, everywhere = compiled.form_integral_offsets, []
        for kind, name in ((0, "cell"), (1, "exterior_facet")):
            for i in range(begins[kind], begins[kind + 1]):
                found = list(_entities(mesh, name, data[name][0], compiled.form_integral_ids[i]))
                if kind == 0 and sorted(found) == [(cell, 0) for cell in range(c.cells)]:
                    everywhere.append((i, found))
                else:
                    self._at(where, i, found)
        addresses, module = _kernels_with_lanes(self.form, [i for i, _ in everywhere]) if everywhere else ([], None)
        if not addresses:
            for i, found in everywhere:
                self._at(where, i, found)
        lanes = ffi.new("uintptr_t[]", addresses or [0])
        c.lanes, c.n_lanes = lanes, len(addresses)
        self._keep += [lanes, module]
        actions = ffi.new("struct action[]", max(sum(map(len, where)), 1))
        for action, (address, facet) in zip(actions, (a for cell in where for a in cell), strict=False):
            action.kernel, action.facet = address, facet
        first = np.concatenate([[0], np.cumsum([len(cell) for cell in where])]).astype(np.int32)
        c.entries = (c.nodes * c.block) ** compiled.rank
        for work, size in (("w_lanes", c.width), ("x_lanes", 6), ("A_lanes", c.entries)):
            setattr(c, work, self._pointer(_aligned(max(size, 1) * self._lib.lanes()), "double *"))
        self._keep.append(actions)
        c.actions, c.first = actions, self._pointer(first, "int32_t *")


class NativeVector(_Form):
    """A linear form; the like of :class:`drillfem.compat.VectorForm`."""

    def __init__(self, form: ufl.Form, rod: Rod) -> None:
        super().__init__(form, rod)
        nodes = rod.V.dofmap.list
        ends = np.flatnonzero(np.isin(nodes, rod.constrained // rod.ansatz.size).any(axis=1)).astype(np.int32)
        self._ends, self._n_ends = self._pointer(ends, "int32_t *"), len(ends)

    def __call__(self, out: Array) -> Array:
        """Assemble into ``out`` (dofs), which is overwritten."""
        self._lib.assemble_vector(self.c, self._ffi.from_buffer("double[]", out), out.size, self._ffi.NULL, 0)
        return out

    def at_ends(self, out: Array) -> Array:
        """Assemble; only the end conditions' rows of ``out`` are right."""
        self._lib.assemble_vector(self.c, self._ffi.from_buffer("double[]", out), out.size, self._ends, self._n_ends)
        return out


class NativeScalar(_Form):
    """A functional; the like of :class:`drillfem.compat.ScalarForm`."""

    def __call__(self) -> float:
        return float(self._lib.assemble_scalar(self.c))


class NativeSolver(_Form):
    """Factorises the Jacobian of a rod and solves with it: condensation to the vertices, a block tridiagonal system.

    Rows of the rod's constrained dofs are unit rows. Raises ValueError where they are not velocities at its ends.
    """

    def __init__(self, form: ufl.Form, rod: Rod) -> None:
        super().__init__(form, rod)
        ffi, a = self._ffi, rod.ansatz
        s = self.s = ffi.new("struct solver *")
        nodes, block = rod.V.dofmap.list, a.size
        n, count = nodes.shape
        nx, nv, d = len(a.x_names), len(a.v_names), count - 1
        # from the top down; in an element: top, bottom, inner nodes
        place = rod.V.tabulate_dof_coordinates()[:, 0][nodes]
        order = np.argsort(place.mean(axis=1))
        element = np.empty(n, dtype=np.int32)
        element[order] = np.arange(n)
        along = np.argsort(place[order], axis=1)
        local = np.concatenate([along[:, :1], along[:, -1:], along[:, 1:-1]], axis=1).astype(np.int32)
        node = np.take_along_axis(nodes[order], local, axis=1).astype(np.int32)
        held = np.zeros(rod.size, dtype=np.uint8)
        held[rod.constrained] = 1
        where, what = np.divmod(rod.constrained, block)
        if np.any(what < nx) or not np.isin(where, (node[0, 0], node[-1, 1])).all():
            raise ValueError("the compiled engine holds velocities at the ends only")
        s.n, s.d, s.nx, s.nv, s.check = n, d, nx, nv, 1
        s.element = self._pointer(element, "int32_t *")
        s.local, s.node = self._pointer(local, "int32_t *"), self._pointer(node, "int32_t *")
        s.held = self._pointer(held, "uint8_t *")
        inner, rows = (d - 1) * nv, (d + 1) * nv
        sizes = {
            "P": (n * d + 1) * nx * nx,
            "D": (n * d + 1) * nx * nv,
            "K": n * rows * rows,
            "B": n * rows * (d + 1) * nx,
            "I": n * inner * inner,
            "H": n * inner * 2 * nv,
            "G": n * inner * 2 * nv,
            "S": (n + 1) * nv * nv,
            "L": n * nv * nv,
            "U": n * nv * nv,
            "g": (n + 1) * nv,
            "z": n * inner,
        }
        for name, size in sizes.items():
            setattr(s, name, self._pointer(np.zeros(max(size, 1)), "double *"))
        self._y = np.zeros(rod.size)
        self._to = ffi.from_buffer("double[]", self._y)

    def factorise(self) -> None:
        """Assemble and factorise the Jacobian at the present values of its coefficients."""
        if self._lib.factorise(self.s, self.c):
            raise ValueError(_REACHES)
        self.s.check = 0

    def solve(self, b: Array) -> Array:
        """J^-1 b, shape (dofs,): a view, valid until the next."""
        self._lib.solve(self.s, self._ffi.from_buffer("double[]", b), self._to)
        return self._y


class NativeStage:
    """State u = x0 + a (x - x0) and rate u_dot = b (x - x0) + rate of a stage; all arrays (dofs,), kept and written."""

    def __init__(self, x: Array, x0: Array, rate: Array, u: Array, u_dot: Array) -> None:
        native = library()
        self._keep = (x, x0, rate, u, u_dot)
        self._stage, self._null = native.lib.stage, native.ffi.NULL
        self._size = x.size
        self._x, self._x0, self._rate, self._u, self._u_dot = (
            native.ffi.from_buffer("double[]", array) for array in self._keep
        )

    def __call__(self, a: float, b: float, with_rate: bool) -> None:
        rate = self._rate if with_rate else self._null
        self._stage(self._size, self._x, self._x0, a, b, rate, self._u, self._u_dot)


class NativeNewton:
    """All iterations of a stage of a step in C, of a rod without rock whose hole does not bend.

    The arrays of ``system`` are kept, read and written; so are those of the rod.
    """

    def __init__(self, system: CompiledSystem, solver: NativeSolver, rod: Rod) -> None:
        native = library()
        self._lib, self._rod, self._system = native.lib, rod, system
        ffi = native.ffi
        self._keep: list[Any] = [solver]

        def pointer(array: Any, kind: str = "double *") -> Any:
            self._keep.append(array)
            return ffi.cast(kind, array.ctypes.data)

        c = self._c = ffi.new("struct newton *")
        near, off = rod.residual_forms
        c.near, c.off, c.jacobian, c.solver = near.c, off.c, solver.c, solver.s  # type: ignore[attr-defined]
        c.size, c.block, c.n_held = rod.size, rod.ansatz.size, len(rod.constrained)
        c.x, c.x0, c.rate, c.known = map(pointer, (system.x, system.x0, system.rate, system.known))
        c.u, c.u_dot = pointer(rod.u.x.array), pointer(rod.u_dot.x.array)
        c.f, c.trusted, c.y = pointer(system.f), pointer(system.trusted), pointer(np.zeros(rod.size))
        c.held, c.target, c.reaction = (
            pointer(rod.constrained, "int32_t *"),
            pointer(rod.imposed),
            pointer(rod.reaction),
        )
        names = rod.ansatz.x_names + rod.ansatz.v_names
        c.unit = pointer(np.array([1.0 / TOLERANCE[name[0]] for name in names]))
        c.shift = pointer(rod.shift.value)
        self._wall = self._wall_of(rod, pointer) if rod.wall is not None else ffi.NULL
        c.wall = self._wall

    @staticmethod
    def _wall_of(rod: Rod, pointer: Callable[..., Any]) -> Any:
        # compiled when it is imported
        from ..boreholes.search import search

        wall, contact = rod.wall, rod.scene.contact
        assert wall is not None and contact is not None
        w = library().ffi.new("struct wall *")
        w.search = search.address
        w.n_axes, w.speed = len(wall.axes), rod.ansatz.index("v1") if "v1" in rod.ansatz.v_names else 0
        w.axes[0 : w.n_axes] = wall.axes
        w.r = pointer(np.zeros((len(rod.nodes), 3)))
        w.cells = pointer(wall.cells, "int32_t *")
        (w.n_cells, w.per_cell), w.n_points, w.width = wall.cells.shape, len(wall.basis), wall.data.shape[1]
        w.basis, w.radius, w.p, w.data = map(pointer, (wall.basis, wall.radius, wall.p, wall.data))
        table = wall.hole.table
        w.knots, w.coefficients, w.radius_at = map(pointer, (table.knots, table.coefficients, table.radius_at))
        w.hole_radius, w.friction_at, w.friction = map(pointer, (table.radius, table.friction_at, table.friction))
        w.n_knots, w.n_radius, w.n_friction = len(table.knots), len(table.radius), len(table.friction)
        w.reach, w.retardation = rod.wall_reach, wall.retardation
        return w

    def __call__(self, newton: BitCoupledNewton, a: float, b: float, rate: bool, known: bool) -> Outcome | None:
        """The stage u = x0 + a (x - x0), u-dot = b (x - x0) + rate; None where the string leaves the hole that is
        known, which the iterations in Python look into."""
        c, wall = self._c, self._rod.wall
        c.renew, c.contraction, c.factored = newton.renew, newton.contraction, newton.factored_shift
        c.iterations, c.factorisations = newton.iterations, newton.factorisations
        found = self._lib.newton(c, a, b, rate, known, newton.keep, MAX_ITERATIONS, DRAGGING, STALLED, PATIENCE)
        if found == _NOT_LOCAL:
            raise ValueError(_REACHES)
        newton.renew, newton.contraction, newton.factored_shift = bool(c.renew), c.contraction, c.factored
        newton.iterations, newton.factorisations = c.iterations, c.factorisations
        self._rod.near_wall = bool(c.touching)
        if wall is not None:
            wall.gap, wall.trouble = self._wall.found[0], ""
        if found == _OUTSIDE:
            self._system.x[:] = self._system.trusted
            return None
        return Outcome(found)
