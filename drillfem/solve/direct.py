"""Runs through PETSc: any rung of the ladder, dynamic (TS) or static (SNES)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from ..compat import Array
from ..errors import SimulationError
from ..models.rod import Rod
from ..results import ResultWriter
from .audit import COMMON, FRICTION, MOTOR, TIP, WORKS, EnergyAudit, variables
from .contact import Rock, rock_of
from .dynamics import Marcher, Stepper
from .guards import runaway
from .interrupt import Interrupts
from .laid import start_of
from .newton import turn_between
from .statics import Statics

Observer = Callable[[float], None]


def _marcher(engine: str) -> type[Marcher]:
    """Who steps: PETSc, or the compiled engine."""
    if engine != "compiled":
        return Stepper
    from .compiled import CompiledStepper

    return CompiledStepper


class DirectRun:
    """A dynamic run of a rod: stepper, rock and audit, advanced step by step, with a state that can be saved."""

    def __init__(self, rod: Rod) -> None:
        self.rod, scene = rod, rod.scene
        marcher = _marcher(scene.engine)
        marcher.adopt(rod)
        u0 = start_of(rod)
        self.rock: Rock | None = rock_of(scene) if rod.has_bit else None
        self.stepper = marcher(rod, u0, self.rock)
        self.bit_angle = 0.0
        self.steps = 0
        self.depth_start = 0.0
        self._motion = (0.0, 0.0, 0.0)
        self.depth_start = self._bit_motion(u0)[0] if rod.turns else 0.0
        self._mark_bit(u0)
        self._first_row(u0)
        if not rod.turns and scene.resists:
            self.depth_start = float(rod.tip()[2])

    # -- start ---------------------------------------------------------------------------------------------------------

    def _bit_motion(self, u: Array) -> tuple[float, float, float]:
        """Depth drilled (m), axial speed (m/s) and spin (rad/s) of the lower end in a state."""
        self.rod.find_bit(u)
        depth, speed, spin = self.rod.end_motion(u)
        return depth - self.depth_start, speed, spin

    def _mark_bit(self, u: Array) -> None:
        if not self.rod.turns:
            return
        at = self.rod.bit
        self._motion = self._bit_motion(u)
        rotation = u[at.rotation]
        self.rotation = rotation.copy() if isinstance(at.rotation, slice) else float(rotation)
        self.stepper.newton.start_rotation = self.rotation
        # the surface knows depths from the start of the run
        self.stepper.newton.start_depth = self.depth_start

    def _first_row(self, u: Array) -> None:
        rod = self.rod
        if self.rock is not None:
            _, speed, spin = self._bit_motion(u)
            rod.set_bit_load(*self.rock.at_rest(speed, spin, 0.0))
        rod.residual(rod.scene.time.start, u, np.zeros_like(u), np.empty_like(u))
        kinetic, strain = rod.energies()
        self._stored = kinetic + strain
        self.audit = EnergyAudit(self._stored, rod.scene.time.start, self._powers(rod.scene.time.start))
        self._row_time = rod.scene.time.start
        self._works = self.audit.until(self._row_time)

    # -- one step ------------------------------------------------------------------------------------------------------

    def _powers(self, t: float) -> dict[str, float]:
        """Powers at the state last evaluated (the integrator's stage)."""
        rod = self.rod
        p = rod.powers()
        drive = rod.top_torque(t) * rod.scene.top_drive.motion(t)[1]
        if rod.drive is not None:
            drive = rod.drive.power(t, *rod.top_motion(rod.u.x.array))
        bit, scene = 0.0, rod.scene
        if rod.has_bit:
            bit = float(rod.bit_load @ rod.end_motion(rod.u.x.array)[1:])
        elif scene.resists:
            speed = rod.end_speed(rod.u.x.array)
            bit = rod.resistance(speed) * speed
        out = {
            "work_top_drive": drive,
            "work_gravity": -p["gravity"],
            "work_hook_load": rod.end_power(),
            "work_bit": bit,
            "dissipated": p["damping"],
            "work_wall": p.get("contact", 0.0) + p.get("friction", 0.0),
        }
        if scene.motor is not None:
            out[MOTOR] = rod.push_power()
        return out | ({FRICTION: p.get("friction", 0.0)} if rod.wall is not None else {})

    def step(self, until: float) -> float:
        """One accepted step; moves the rock, books the energy. Returns the time."""
        rod = self.rod
        before = self._motion[1]
        report = self.stepper.step(until)
        self.audit.add(report.stage_time, self._powers(report.stage_time))
        if rod.drive is not None:
            self.audit.works["work_top_drive"] += rod.drive.work
        if rod.turns:
            u = self.stepper.u
            turn = turn_between(self.rotation, u[rod.bit.rotation])
            self.bit_angle += turn
            self._mark_bit(u)
            if self.rock is not None:
                depth, speed, spin = self._motion
                self.rock.commit(turn, depth, report.step, before, speed, spin)
        self.steps += 1
        return report.time

    def row(self, t: float) -> dict[str, float]:
        """History row of the present state."""
        rod, u = self.rod, self.stepper.u
        torque, speed = rod.top_torque(t), rod.scene.top_drive.motion(t)[1]
        if rod.drive is not None:
            torque, speed = rod.drive.torque(), rod.drive.speed
        hook_load = rod.hook_load()
        rod.set_state(u, rod.u_dot.x.array)
        kinetic, strain = rod.energies()
        out = {
            "top_torque": torque,
            "top_angular_speed": speed,
            "hook_load": hook_load,
            "top_power": torque * speed,
            "kinetic_energy": kinetic,
            "strain_energy": strain,
        }
        self._stored, self._works, self._row_time = kinetic + strain, self.audit.until(t), t
        out |= self._works
        if rod.scene.motor is not None:
            out["motor_force"] = float(rod.push.value)
        if rod.wall is not None:
            out |= rod.wall_row()
        if rod.turns:
            depth, speed, spin = self._bit_motion(u)
            out |= {"bit_angular_speed": spin, "bit_axial_speed": speed, "bit_angle": self.bit_angle}
        if self.rock is not None:
            return out | {
                "bit_depth": depth,
                "bit_torque": float(rod.bit_load[1]),
                "bit_weight": float(rod.bit_load[0]),
                **self.rock.row(),
            }
        tip = rod.tip()
        if rod.scene.resists:
            speed = rod.end_speed(u)
            out["bit_depth"], out["bit_axial_speed"] = float(tip[2]) - self.depth_start, speed
            out["bit_weight"] = rod.resistance(speed)
        return out | {name: float(x) for name, x in zip(TIP, tip, strict=True)}

    def look(self) -> None:
        """Let the rod take the present state, for a picture of it or as if there were one."""
        self.rod.set_state(self.stepper.u, self.rod.u_dot.x.array)

    def fields(self) -> dict[str, Array]:
        """Fields along the string, after :meth:`look`."""
        return self.rod.fields() | (self.rock.picture() if self.rock is not None else {})

    # -- save and load -------------------------------------------------------------------------------------------------

    def save(self) -> dict[str, Any]:
        """Everything that a continuation needs."""
        rod = self.rod
        self.audit.error(self._stored, self._works)  # brings the scale up to date
        state: dict[str, Any] = {
            "stored": self._stored,
            "u": self.stepper.u.copy(),
            "bit_load": rod.bit_load.copy(),
            "bit_angle": self.bit_angle,
            "steps": self.steps,
            "newton_iterations": self.stepper.newton.iterations,
            "rejected": self.stepper.rejected,
            "audit_time": self.audit.time,
            "audit_start": self.audit.stored_at_start,
            "audit_scale": self.audit.scale,
            "powers": dict(self.audit.powers),
            "works": dict(self.audit.works),
            "works_of_row": dict(self._works),
            "time_step": self.stepper.length,
        }
        if self.rock is not None:
            state["rock"] = self.rock.save()
        if rod.drive is not None:
            state["drive"] = rod.drive.save()
        if rod.wall is not None:
            state["multipliers"] = rod.wall.multipliers.copy()
        return state

    def load(self, t: float, state: dict[str, Any]) -> None:
        """Continue from a saved state."""
        rod, stepper = self.rod, self.stepper
        stepper.set_state(t, state["u"], float(state["time_step"]))
        rod.set_bit_load(*state["bit_load"])
        self._stored = float(state["stored"])
        self.bit_angle, self.steps = float(state["bit_angle"]), int(state["steps"])
        stepper.newton.iterations, stepper.rejected = int(state["newton_iterations"]), int(state["rejected"])
        self.audit = EnergyAudit(
            float(state["audit_start"]),
            float(state["audit_time"]),
            {k: float(v) for k, v in state["powers"].items()},
            {k: float(v) for k, v in state["works"].items()},
            float(state["audit_scale"]),
        )
        self._works, self._row_time = {k: float(v) for k, v in state["works_of_row"].items()}, t
        if self.rock is not None:
            self.rock.load(state["rock"])
        if rod.drive is not None:
            rod.drive.load(state["drive"], rod.top_motion(stepper.u)[0])
        if rod.wall is not None:
            rod.wall.multipliers[:] = state["multipliers"]
            rod.seek_hole(stepper.u)
        self._mark_bit(stepper.u)

    def restart(self) -> None:
        """Forget everything but the state, as a run does that is resumed here."""
        self.stepper.restart()
        self.rod.seek_hole(self.stepper.u)

    def summary(self) -> dict[str, Any]:
        """Counts and the energy balance up to the last row, for the summary."""
        return {
            "steps": self.steps,
            "newton_iterations": self.stepper.newton.iterations,
            "rejected_steps": self.stepper.rejected,
            "energy_balance_error": self.audit.error(self._stored, self._works),
            "factorisations": self.stepper.newton.factorisations,
            **self.power(self.rod.scene.time.start),
        }

    def power(self, start: float) -> dict[str, float]:
        """What loads at the ends of a string with a saturating bit put in (W), what the rock takes out, and the ratio
        (7-10), (7-11): means from ``start`` (s) to the last row.

        Recommended reading: out is what the rock takes. Literal: it is what the whole force on the bit does, with motor
        and inertia.
        """
        rod, works, time = self.rod, self._works, self._row_time - start
        if not rod.scene.resists or not time > 0:
            return {}
        taken = works["work_bit"]
        if rod.literal:
            mass, speed = rod.scene.ends.bottom_mass, rod.end_speed(self.stepper.u)
            taken = works.get(MOTOR, 0.0) - taken - mass * speed**2 / 2
        fed = works["work_hook_load"]
        found = {"power_in": fed / time, "power_out": taken / time}
        return found | ({"power_ratio": taken / fed} if fed > 0 else {})

    def destroy(self) -> None:
        """Free what is not Python's."""
        self.stepper.destroy()


def grid(start: float, interval: float, after: float) -> Iterator[float]:
    """Times start + k interval that lie after ``after``."""
    k = math.floor((after - start) / interval + 1e-9) + 1
    while True:
        yield start + k * interval
        k += 1


def run_dynamic(scene: Any, writer_of: Callable[..., ResultWriter], until: float, progress: Observer | None) -> Any:
    """March a scene to ``until``, writing as it goes. Returns the Result."""
    return march(Rod(scene), writer_of, until, progress)


def march(rod: Rod, writer_of: Callable[..., ResultWriter], until: float, progress: Observer | None) -> Any:
    """:func:`run_dynamic` with a rod that is there."""
    scene, run = rod.scene, DirectRun(rod)
    names = variables(rod.has_bit, rod.turns, rod.wall is not None, scene.resists, scene.motor is not None)
    if not scene.drills:
        names.pop("rock_volume", None)  # the empirical law knows no surface
    writer = writer_of(rod.model, rod.size, names)
    start = scene.time.start
    out = scene.output
    pictured = writer.pictured
    try:
        with writer, Interrupts() as interrupts:
            t = start
            if writer.restart is not None:
                t, state = writer.restart
                run.load(t, state)
            elif until > start:
                writer.append(t, run.row(t))
                run.look()
                if pictured:
                    writer.field(t, run.fields())
                writer.checkpoint(t, run.save())
            run.restart()
            rows, pictures = grid(start, out.interval, t), grid(start, out.fields_interval, t)
            saves = grid(start, out.checkpoint_interval, t)
            next_row, next_picture, next_save = next(rows), next(pictures), next(saves)
            tiny = 1e-9 * max(1.0, abs(until))
            try:
                while t < until - tiny:
                    interrupts.check()
                    t = run.step(min(next_row, next_picture, next_save, until))
                    if t >= next_row - tiny or t >= until - tiny:
                        row = run.row(t)
                        writer.append(t, row)
                        if why := runaway({"time": t} | row, scene):
                            raise SimulationError(why)
                        next_row = next(rows)
                        if progress is not None:
                            progress(t)
                    if t >= next_picture - tiny:
                        run.look()
                        if pictured:
                            writer.field(t, run.fields())
                        next_picture = next(pictures)
                    if t >= next_save - tiny:
                        writer.checkpoint(t, run.save())
                        run.restart()
                        next_save = next(saves)
            finally:
                writer.update(**run.summary())
            return writer.finish({"converged": True})
    finally:
        run.destroy()


def run_static(scene: Any, writer_of: Callable[..., ResultWriter], progress: Observer | None) -> Any:
    """Follow the loads of a static scene from 0 to 1; the load factor stands on the time axis."""
    rod = Rod(scene)
    statics = Statics(rod)
    u0 = start_of(rod)
    writer = writer_of(rod.model, len(statics.x.x.array), variables(False))
    force, moment, g = (c.value.copy() for c in (rod.tip_force, rod.tip_moment, rod.loads.g))

    def set_load(factor: float) -> None:
        rod.tip_force.value, rod.tip_moment.value, rod.loads.g.value = factor * force, factor * moment, factor * g

    def record(factor: float, x: Array) -> None:
        rod.set_state(statics.state(x), np.zeros(rod.size))
        r, _ = rod.shape()
        zero = dict.fromkeys([*COMMON, *WORKS], 0.0)
        writer.append(factor, zero | {"strain_energy": rod.energies()[1]} | dict(zip(TIP, r[-1].tolist(), strict=True)))
        writer.field(factor, rod.fields())
        if progress is not None:
            progress(factor)

    with writer:
        x0 = statics.start(u0)
        set_load(0.0)
        record(0.0, x0)
        factors = np.arange(1, scene.time.load_steps + 1) / scene.time.load_steps
        done = statics.solve(x0, factors, set_load, record)
        return writer.finish({"steps": done.load_steps, "newton_iterations": done.newton_iterations, "converged": True})
