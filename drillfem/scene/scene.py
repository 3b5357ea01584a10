"""A scene: what is simulated, read from TOML, in SI units, and checked as a whole."""

# ruff: noqa: RUF009 (key() is dataclasses.field with a fixed set of metadata)
from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from drillfem.errors import SceneError
from drillfem.scene import ladder
from drillfem.scene.keys import complaint, guess, key, read, shown, write
from drillfem.scene.ladder import BESIDE, MODELS, ModelChoice
from drillfem.scene.nominal import Nominal, nominal
from drillfem.scene.numbers import expanded
from drillfem.scene.section import Material, Section
from drillfem.scene.tables import (
    E3,
    HOLES,
    Bit,
    Contact,
    Ends,
    Gravity,
    Hole,
    Inertia,
    Initial,
    Mesh,
    Motor,
    Mud,
    Output,
    Reference,
    Rock,
    SoftString,
    Time,
    TopDrive,
)
from drillfem.scene.uncertain import Random, at_means

if TYPE_CHECKING:
    from drillfem.boreholes import Borehole

#: Engines, and the integrators of each.
ENGINES = {
    "petsc": ("generalized-alpha", "theta", "bdf", "arkimex"),
    "compiled": ("generalized-alpha", "theta"),
    "soft-string": (),
    "condensed": ("exact", "trapezoidal", "explicit"),
    "characteristics": ("exact",),
}


@dataclass(frozen=True)
class Scene:
    """All that a simulation needs to know. To change it: `dataclasses.replace(...)`, then `.checked()`."""

    string: tuple[Section, ...] = key("the sections of the string, from the top down")
    title: str = key("one line that says what the scene is", default="", default_text="the name")
    name: str = key("short name", default="", default_text="the file's name")
    model: str = key(
        "model; 'auto' takes the poorest that can represent the scene",
        choices=(*MODELS, *BESIDE, "auto"),
        default="auto",
    )
    reading: str = key(
        "'literal': the thesis as printed, where it and the recommended reading differ",
        choices=("recommended", "literal"),
        default="recommended",
    )
    material: Material | None = key("material of all sections without their own", default=None)
    hole: Hole = key("the borehole", default=Hole())
    contact: Contact | None = key("contact with the wall of the hole", default=None, default_text="none")
    mud: Mud | None = key("drilling fluid", default=None, default_text="none")
    top_drive: TopDrive = key("what turns the string, and the weight on the bit", default=TopDrive())
    bit: Bit | None = key("the bit", default=None, default_text="none")
    motor: Motor | None = key("mud motor that shakes the lower end", default=None, default_text="none")
    rock: Rock | None = key("the rock; needed by a cutting bit", default=None, default_text="none")
    initial: Initial = key("the state at the start", default=Initial())
    ends: Ends = key("how the string is held and loaded at its ends", default=Ends())
    inertia: Inertia = key("where the string's inertia sits", default=Inertia())
    soft_string: SoftString = key("friction of the soft-string model", default=SoftString())
    reference: Reference = key("shape of the unstressed string", default=Reference())
    gravity: Gravity = key("gravity", default=Gravity())
    mesh: Mesh = key("finite elements along the string", default=Mesh())
    time: Time = key("how time or load advances", default=Time())
    output: Output = key("what is written, and how often", default=Output())
    random: tuple[Random, ...] = key(
        "what is not known: any number of random inputs, with names of your own",
        default=(),
        default_text="none",
        named=True,
    )

    # -- reading and writing ------------------------------------------------------------------------------
    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Scene:
        """Scene from nested plain data: parsed TOML, or what `to_dict` gave. Raises SceneError."""
        data = at_means(cls, expanded(data))
        scene = read(cls, {"time": {}, **data})._completed()  # an absent [time] lacks its end, and shall say so
        for path, message in scene.problems():
            raise complaint(data, path, message)
        return scene

    def to_dict(self) -> dict[str, Any]:
        """Nested plain SI data for TOML or JSON; `from_dict` gives an equal scene back."""
        data = write(self)
        for section in data["string"]:
            if section.get("material") == data.get("material"):
                section.pop("material", None)  # comes back from [material]
        return data

    def to_toml(self) -> str:
        """The scene as the text of a TOML file; `load_scene` of it gives an equal scene, bit for bit."""
        from drillfem.scene.toml import dumps

        return dumps(self.to_dict())

    def checked(self) -> Scene:
        """The same scene, after all checks; for scenes changed in Python. Raises SceneError."""
        return Scene.from_dict(self.to_dict())

    def _completed(self) -> Scene:
        """Defaults that depend on other keys, and every section with its material."""
        time = self.time
        if time.analysis == "static":
            time = replace(time, start=0.0, end=1.0, step=1.0 / time.load_steps)
        interval = self.output.interval or time.step
        fields = self.output.fields_interval or max(interval, (time.end - time.start) / 20)
        string = tuple(s if s.stiffness or s.material else replace(s, material=self.material) for s in self.string)
        name = self.name or "scene"
        return replace(
            self,
            string=string,
            name=name,
            title=self.title or name,
            time=time,
            output=replace(self.output, interval=interval, fields_interval=fields),
        )

    # -- what follows from the keys -----------------------------------------------------------------------
    @property
    def length(self) -> float:
        """Length of the unstressed string in m."""
        return math.fsum(s.length for s in self.string)

    @property
    def interfaces(self) -> tuple[float, ...]:
        """Arc lengths in m of the top, the joints between sections, and the bottom."""
        return tuple(math.fsum(s.length for s in self.string[:i]) for i in range(len(self.string) + 1))

    @property
    def mass(self) -> float:
        """Mass in kg of the string with the lumps at its ends."""
        return math.fsum(s.mass_per_length * s.length for s in self.string) + self.ends.top_mass + self.ends.bottom_mass

    def weight_per_length(self, section: Section) -> float:
        """Weight of a section in N/m, less that of the mud which its steel displaces."""
        displaced = self.mud.density * section.area if self.mud is not None else 0.0
        return (section.mass_per_length - displaced) * self.gravity.magnitude

    @property
    def weight(self) -> float:
        """Weight along e3 in N of the string, in its mud, with the lumps at its ends (out of it)."""
        lumps = (self.ends.top_mass + self.ends.bottom_mass) * self.gravity.magnitude
        total = math.fsum(self.weight_per_length(s) * s.length for s in self.string) + lumps
        return total * self.gravity.direction[2]

    @property
    def hanging_weight(self) -> float:
        """Load in N on the hook of a string that hangs in its hole: weight down the hole, not what lies on its wall."""
        hole = self.borehole if self.hole.bends else None
        if hole is None:
            return self.weight
        down = np.array(self.gravity.direction)
        deep = hole.frame(np.array(self.interfaces)).position @ down
        carried = math.fsum(self.weight_per_length(s) * h for s, h in zip(self.string, np.diff(deep), strict=True))
        below = self.ends.bottom_mass * float(hole.frame(np.array([self.length])).tangent[0] @ down)
        return carried + self.gravity.magnitude * (self.ends.top_mass * down[2] + below)

    @property
    def drills(self) -> bool:
        """Whether there is a bit that cuts."""
        return self.bit is not None and self.bit.kind == "cutting"

    @property
    def bites(self) -> bool:
        """Whether rock loads a turning bit, by the cutting law or the empirical one."""
        return self.bit is not None and self.bit.kind not in ("free", "saturating")

    @property
    def resists(self) -> bool:
        """Whether there is a bit that only resists being pushed."""
        return self.bit is not None and self.bit.kind == "saturating"

    @property
    def hangs(self) -> bool:
        """Whether a constant load holds the top, which is free to move along its axis; else its speed is given."""
        drive = self.top_drive
        return self.ends.top == "driven" and drive.block_speed is None and (self.bites or drive.hook_load is not None)

    @cached_property
    def borehole(self) -> Borehole | None:
        """Geometry of the hole, or None where there is none."""
        from drillfem.boreholes import hole_of

        return hole_of(self)

    @property
    def blade_passage(self) -> float:
        """Time between two blades (s) at the speed of the top; infinite where nothing is cut."""
        if self.bit is None or not self.drills or not self.top_drive.speed:
            return math.inf
        return 2 * math.pi / (self.bit.blades * abs(self.top_drive.speed))

    def nominal(self, spin: float | None = None, weight: float | None = None) -> Nominal:
        """Steady drilling (5-25)-(5-28); nothing of it off rock.

        spin: in the place of the speed of the drive (rad/s). weight: in the place of what hangs in the hole (N).
        """
        return nominal(self, spin, weight)

    def gain(self, weight: float | None = None) -> float:
        """Length of hole (m) that the string gains in the run: what block speed, or steady drilling, takes it.

        weight: on the bit, as for `nominal` (N).
        """
        rate = max(self.top_drive.block_speed or 0.0, self.nominal(weight=weight).rate_of_penetration)
        return (self.time.end - self.time.start) * rate if math.isfinite(rate) else 0.0

    def obstacle(self, model: str) -> str:
        """Why `model` cannot represent this scene; empty if it can."""
        return ladder.obstacle(self, model)

    def resolved_model(self) -> ModelChoice:
        """The model to run, and why: the one asked for, or for "auto" the lowest rung that represents the scene and
        what is wanted of it, by the rules of `drillfem.scene.ladder`."""
        return ladder.choose(self)

    # -- what must fit together ---------------------------------------------------------------------------
    def problems(self) -> Iterator[tuple[str, str]]:
        """(dotted key, message) for everything that does not fit together across tables."""
        yield from self._string_problems()
        yield from self._end_problems()
        yield from self._drive_problems()
        yield from self._drilling_problems()
        if self.hole.bends or self.hole.caliper or self.hole.section:
            _ = self.borehole  # complains itself
        yield from self._numerics_problems()
        yield from self._random_problems()
        if self.model != "auto" and (why := self.obstacle(self.model)):
            able = [m for m in MODELS if not self.obstacle(m)]
            if able:
                yield "model", f"must be one of {', '.join(able)}, auto for this scene: {why}"
        if self.output.wanted and all(map(self.obstacle, MODELS)):
            yield "output.wanted", f"no model of this scene gives that: {self.obstacle(MODELS[-1])}"

    def _string_problems(self) -> Iterator[tuple[str, str]]:
        hole = self.hole.diameter
        for i, s in enumerate(self.string):
            here = f"string.{i}"
            if s.stiffness is None and s.material is None:
                yield "material", f"section {s.name!r} needs it (or its own material or stiffness)"
            if s.stiffness is not None and self.time.analysis == "dynamic":
                for name, given in (("mass_per_length", s.given_mass), ("rotary_inertia", s.given_inertia)):
                    if given is None:
                        yield f"{here}.{name}", "must be given > 0 for dynamics"
            if hole is not None and s.outer_diameter is not None and hole <= s.outer_diameter:
                yield (
                    "hole.diameter",
                    f"must be larger than {here}.outer_diameter = {s.outer_diameter:g} m of section {s.name!r}",
                )
            if self.contact is not None and s.outer_diameter is None:
                yield f"{here}.outer_diameter", "must be given in m for contact"
            if hole is not None and s.contact_diameter is not None and hole <= s.contact_diameter:
                yield "hole.diameter", f"must be larger than {here}.contact_diameter = {s.contact_diameter:g} m"
        kinds = ", ".join(kind for kind in HOLES if kind != "none")
        if self.contact is not None and self.contact.normal_force == "weight" and self.mud is not None:
            yield "contact.normal_force", "must be 'wall' where there is [mud], which carries some of the weight"
        if self.contact is not None and self.hole.kind == "none":
            yield "hole.kind", f"must be one of {kinds} where there is [contact]"
        if self.hole.bends and self.contact is None:
            yield "contact", "a table with stiffness, friction_static, friction_dynamic is needed by a hole that bends"
        if hole is not None and self.bit is not None and 2 * self.bit.radius > 1.05 * hole:
            yield "bit.radius", f"must be about half of hole.diameter = {hole:g} m, which the bit drills"

    def _end_problems(self) -> Iterator[tuple[str, str]]:
        drive, ends = self.top_drive, self.ends
        if ends.top == "driven" and drive.kind == "none":
            yield (
                "ends.top",
                "must be one of clamped, pinned, hung, free, or there must be a [top_drive] with kind "
                "imposed-speed, imposed-angle, pi, soft-torque or z-torque",
            )
        if self.bit is not None and drive.axis != E3:
            yield "top_drive.axis", "must be [0, 0, 1] where there is a [bit]"
        if (self.bit is not None or self.hole.bends) and self.reference.shape != "straight":
            yield "reference.shape", "must be 'straight' where there is a [bit] or a hole that bends"
        if ends.top != "driven" and drive.kind != "none":
            yield "ends.top", f"must be 'driven' where top_drive.kind = {drive.kind!r}"
        if ends.bottom == "bit" and self.bit is None:
            yield "ends.bottom", "must be one of free, guided, clamped, or there must be a [bit]"
        if ends.bottom != "bit" and self.bit is not None and not self.resists:
            yield "ends.bottom", "must be 'bit' where there is a [bit]"
        for name, there in (("bit.kind", self.resists), ("motor", self.motor is not None)):
            if there and self.hole.bends:
                yield name, "acts along e3: the hole must be straight, and along it"
        if self.motor is not None and self.bites:
            yield "motor", f"must be left out where bit.kind = {self.bit.kind if self.bit else None!r}"
        if any(ends.top_force) and ends.top == "driven":
            yield "ends.top_force", "must be left out where ends.top = 'driven': the hook carries the string"
        held = ends.top in ("clamped", "hung", "driven") or ends.bottom == "clamped"
        if self.time.analysis == "static" and not held:
            yield (
                "ends.top",
                "must be one of clamped, hung, driven for statics, or the string can move freely",
            )

    def _drilling_problems(self) -> Iterator[tuple[str, str]]:
        drive, bit, rock = self.top_drive, self.bit, self.rock
        if self.inertia.distributed != 1 and not self.drills:
            yield "inertia.distributed", "must be 1 where there is no cutting bit to lump inertia at"
        allowed: tuple[str, ...] = ("nominal", "rest", "literal", "laid")
        if not self.bites:
            allowed = ("rest", "given") if self.hole.kind == "none" else ("rest", "given", "laid")
        if self.hole.bends:
            allowed = tuple(x for x in allowed if x in ("nominal", "laid"))
        if bit is None or self.hole.bends:
            if self.initial.state not in allowed:
                where = "the hole bends" if self.hole.bends else "there is no [bit]"
                yield "initial.state", f"must be one of {', '.join(allowed)} where {where}"
        elif self.initial.state == "laid" and self.hole.kind == "none":
            yield "initial.state", f"must be one of {', '.join(allowed)} where there is no hole to lie in"
        if drive.rise_time is not None and drive.profile is None and self.initial.state in ("nominal", "literal"):
            if self.bites:
                yield "top_drive.rise_time", f"must be left out where initial.state = {self.initial.state!r}, at speed"
        if bit is None:
            if drive.weight_on_bit is not None:
                yield "top_drive.weight_on_bit", "must be left out where there is no [bit]"
            if drive.hook_load is not None and self.hole.kind == "none":
                yield "top_drive.hook_load", "must be left out where there is no [bit] and no hole"
            return
        if not self.bites:
            if drive.weight_on_bit:
                yield (
                    "top_drive.weight_on_bit",
                    f"must be 0 or left out for bit.kind = {bit.kind!r}, which carries nothing",
                )
            if drive.hook_load is not None and self.hole.kind == "none":
                yield "top_drive.hook_load", f"must be left out for bit.kind = {bit.kind!r}: it is the whole weight"
            return
        if bit.kind == "empirical":
            if self.time.analysis == "static":
                yield "time.analysis", "must be 'dynamic' for bit.kind = 'empirical'"
            if rock is not None:
                yield "rock", "must be left out for bit.kind = 'empirical', whose numbers stand for it"
            if drive.weight_on_bit is None and drive.hook_load is None and drive.block_speed is None:
                yield "top_drive.weight_on_bit", "must be a number >= 0 in N, or give hook_load or block_speed"
            yield from self._load_problems()
            return
        if rock is None:
            yield (
                "rock",
                "a table with intrinsic_specific_energy, contact_strength, contact_strength_stalled, "
                "surface is needed by bit.kind = 'cutting'",
            )
            return
        if self.time.analysis == "static":
            yield "time.analysis", "must be 'dynamic' for bit.kind = 'cutting'"
        if drive.kind == "none":
            yield "top_drive.kind", "must be one of imposed-speed, imposed-angle, pi, ... for bit.kind = 'cutting'"
        if drive.weight_on_bit is None and drive.hook_load is None:
            if drive.block_speed is None:
                yield (
                    "top_drive.weight_on_bit",
                    "must be a number >= 0 in N, or give top_drive.hook_load or block_speed in its place",
                )
                return
        yield from self._load_problems()

    def _load_problems(self) -> Iterator[tuple[str, str]]:
        """Of the weight on a bit that is on rock, and of steady drilling with it."""
        drive, bit, rock, steady = self.top_drive, self.bit, self.rock, self.initial.state in ("nominal", "literal")
        assert bit is not None
        if steady and drive.block_speed is not None and not drive.block_speed > 0:
            yield "initial.state", f"must be rest or laid where top_drive.block_speed = {drive.block_speed:g} m/s"
            return
        weight, at_bit = self.hanging_weight, self.nominal().weight_on_bit
        if drive.hook_load is not None and at_bit <= 0:
            yield (
                "top_drive.hook_load",
                f"must be less than the string's weight {weight:.6g} N, or the bit is lifted",
            )
        if at_bit > weight:
            yield "top_drive.weight_on_bit", f"must not exceed the string's weight {weight:.6g} N"
        if steady:
            if drive.speed is not None and drive.speed <= 0:
                yield "top_drive.speed", "must be > 0 rad/s to start from steady drilling"
            if drive.profile == "spin-up":
                yield "initial.state", "must be one of rest, given for top_drive.profile = 'spin-up'"
            if rock is None:
                least, why = self._least_weight(), "below which the law (B-2) drills nothing at this speed"
            else:
                least = rock.contact_strength * bit.radius * bit.wear_flat_length
                why = (
                    "which the wear flats carry (rock.contact_strength * bit.radius * bit.wear_flat_length), or "
                    "nothing is cut"
                )
            if at_bit <= least:
                yield (
                    "top_drive.hook_load" if drive.weight_on_bit is None else "top_drive.weight_on_bit",
                    f"{at_bit:.6g} N on the bit must exceed {least:.6g} N, {why}",
                )

    def _least_weight(self) -> float:
        """Weight (N) at which an empirical bit begins to drill at the speed of the top."""
        from drillfem.bitrock.empirical import EmpiricalLaw

        return EmpiricalLaw.from_scene(self).weight(0.0, self.top_drive.speed or 0.0)

    def _drive_problems(self) -> Iterator[tuple[str, str]]:
        """Of the top drive's own, and of the mud."""
        drive, mud, hole = self.top_drive, self.mud, self.hole
        if drive.kind == "soft-torque" and self.ends.top_inertia == 0:
            yield "ends.top_inertia", "must be > 0 kg m^2, the drive's, for top_drive.kind = 'soft-torque'"
        moves = self.ends.top == "driven" and (self.hangs or bool(drive.block_speed))
        borehole = self.borehole if hole.bends and moves else None
        if borehole is not None:
            lean = float(borehole.frame(np.array([0.0])).inclination[0])
            names = ("block_speed", "hook_load", "weight_on_bit")
            name = next((n for n in names if getattr(drive, n) is not None), "weight_on_bit")
            if lean > 1e-3:
                yield (
                    f"top_drive.{name}",
                    f"must be left out where the hole starts inclined, here by {math.degrees(lean):.3g} deg: the hook "
                    "moves the top along the vertical",
                )
        if mud is None:
            return
        for i, s in enumerate(self.string):
            if s.outer_diameter is None:
                yield f"string.{i}.outer_diameter", "must be given in m where there is [mud]"
        for name, given in (("viscosity", mud.viscosity > 0), ("added_mass", mud.added_mass)):
            if given and hole.kind == "none":
                yield f"mud.{name}", "must be left out where hole.kind = 'none': it is the hole that confines the mud"

    def _numerics_problems(self) -> Iterator[tuple[str, str]]:
        time, output = self.time, self.output
        if self.mesh.elements < len(self.string):
            yield "mesh.elements", f"must be at least one for each of the {len(self.string)} sections"
        ratio = output.interval / time.step
        if not time.adaptive and (round(ratio) < 1 or abs(ratio - round(ratio)) > 1e-6 * ratio):
            yield "output.interval", f"must be a whole multiple of time.step = {time.step:g} s"
        if output.checkpoint_interval < time.step:
            yield "output.checkpoint_interval", f"must not be shorter than time.step = {time.step:g} s"
        if time.step > self.blade_passage / 8:
            most = self.blade_passage / 8
            yield "time.step", f"must be at most {most:.2g} s, an eighth of the time between two blades"
        if output.interval > time.end - time.start:
            yield "output.interval", f"must not exceed the run of {time.end - time.start:g} s"
        if output.fields_interval < output.interval * (1 - 1e-9):
            yield (
                "output.fields_interval",
                f"must not be shorter than output.interval = {output.interval:g} s",
            )
        able = self.engines
        if time.engine not in ("default", *able):
            yield "time.engine", f"must be one of default, {', '.join(able)} for {self._kind_of_run()}"
        elif time.integrator not in ("default", *(allowed := self._integrators())):
            on = self._kind_of_run() if time.engine == "default" else f"time.engine = {time.engine!r}"
            yield "time.integrator", f"must be one of default, {', '.join(allowed)} for {on}"
        elif time.adaptive and self.contact is not None and self.contact.method == "augmented":
            yield "time.adaptive", "must be false where contact.method = 'augmented', which counts with equal steps"
        elif time.adaptive and self.engine != "petsc":
            yield "time.adaptive", f"must be false where time.engine = {self.engine!r}, whose steps are equal"
        if time.integrator == "arkimex" and not 2 <= time.order <= 5:
            yield "time.order", "must be from 2 to 5 where time.integrator = 'arkimex'"

    def _random_problems(self) -> Iterator[tuple[str, str]]:
        """Of friction that varies along the hole at random, and is given along it as well."""
        fields = [r.name for r in self.random if r.is_field]
        if fields and self.contact is not None and self.contact.friction_profile is not None:
            yield "contact.friction_profile", f"must be left out where [random.{fields[0]}] gives it"
        for i, stretch in enumerate(self.hole.section or ()):
            for name in ("friction_static", "friction_dynamic"):
                if fields and getattr(stretch, name) is not None:
                    yield f"hole.section.{i}.{name}", f"must be left out where [random.{fields[0]}] gives it"

    # -- which engine runs it ---------------------------------------------------------------------------------
    @property
    def condensable(self) -> bool:
        """Whether the string is linear but for its bit, so that the condensed engine can run it."""
        dynamic = self.drills and self.time.analysis == "dynamic" and not self.top_drive.follows
        dynamic = dynamic and self.top_drive.block_speed is None and self.mud is None
        return dynamic and self.resolved_model().name in ("lumped", "torsional", "axial-torsional")

    @property
    def engines(self) -> tuple[str, ...]:
        """Engines that can run the scene, the default one first."""
        model = self.resolved_model().name
        if model == "soft-string":
            return ("soft-string",)
        if not self.condensable:
            if self.time.analysis == "static":
                return ("petsc",)
            # in a hole that bends every step is dear, and the two give the same
            return ("compiled", "petsc") if self.hole.bends and self.contact else ("petsc", "compiled")
        if model == "axial-torsional":
            return ("condensed", "petsc", "compiled")
        waves = model == "torsional" and not any(s.retardation_time for s in self.string)
        return ("condensed", "characteristics") if waves else ("condensed",)

    @property
    def engine(self) -> str:
        """The engine that runs the scene: the one asked for, else the first that knows the integrator."""
        if self.time.engine != "default":
            return self.time.engine
        steps = self.engines if not self.time.adaptive else [e for e in self.engines if e == "petsc"]
        knows = (e for e in steps if self.time.integrator in ("default", *ENGINES[e]))
        return next(knows, self.engines[0])

    def _integrators(self) -> tuple[str, ...]:
        """Integrators to choose from, besides the default."""
        engines = self.engines if self.time.engine == "default" else (self.time.engine,)
        return tuple(dict.fromkeys(name for engine in engines for name in ENGINES[engine]))

    def _kind_of_run(self) -> str:
        kind = f"model {self.resolved_model().name}"
        if self.condensable and self.engines == ("condensed",):
            return kind if self.resolved_model().name == "lumped" else f"{kind} with damping"
        return kind if self.condensable else f"{kind}: only a straight drilling string is condensed to its bit"


# -- files ------------------------------------------------------------------------------------------------
def _folder() -> Path:
    package = Path(__file__).resolve().parents[1]
    shipped = package / "scenes"
    return shipped if shipped.is_dir() else package.parent / "demos" / "scenes"


def builtin_scenes() -> dict[str, str]:
    """Names of the built-in scenes, with their titles."""
    return {p.stem: str(_parse(p).get("title", p.stem)) for p in sorted(_folder().glob("*.toml"))}


def load_scene(name_or_path: str | Path, overrides: Mapping[str, Any] | None = None) -> Scene:
    """Read, complete and check a scene.

    name_or_path: name of a built-in scene, or a TOML file. overrides: values by dotted key (`bit.blades`,
    `string.0.length`); text is taken as TOML (`6`, `[1, 0, 0]`, `true`) or else as it stands (`4 in`,
    `spatial`); None removes the key.

    Raises SceneError: one line with the key, its value and what is allowed.
    """
    text = str(name_or_path)
    names = [p.stem for p in sorted(_folder().glob("*.toml"))]
    path = _folder() / f"{text}.toml" if text in names else Path(text)
    try:
        if not _exists(path):
            if path.suffix == ".toml" or path.name != text:
                raise SceneError("no such file")
            raise SceneError(f"no such file and no built-in scene: {guess(text, names)}")
        data = _parse(path)
        for dotted, value in (overrides or {}).items():
            _override(data, dotted, value)
        data = _with_files(data, path.parent)
        return Scene.from_dict({"name": path.stem, **data})
    except SceneError as error:
        raise SceneError(" ".join(f"scene {text or repr(text)}: {error}".split())) from None


#: keys whose rows may stand in a file
_FILES = (("hole", "survey"), ("hole", "caliper"), ("contact", "friction_profile"))


def _with_files(data: dict[str, Any], beside: Path) -> dict[str, Any]:
    """The data with the tables that it names as files (survey, caliper, friction) in their place."""
    named = [data[table].get(name) for table, name in _FILES if isinstance(data.get(table), dict)]
    if not any(isinstance(value, str) for value in named):
        return data
    from drillfem.boreholes.files import with_files

    return with_files(data, beside)


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):  # a name that no file can have
        return False


def _parse(path: Path) -> dict[str, Any]:
    if path.is_dir():
        raise SceneError("is a folder, must be a TOML file")
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except UnicodeDecodeError as error:
        raise SceneError(f"is not UTF-8 text (byte {error.start})") from None
    except (ValueError, RecursionError) as error:
        raise SceneError(f"is not valid TOML: {error}") from None
    except OSError as error:
        raise SceneError(f"cannot be read: {error.strerror}") from None


def _override(data: dict[str, Any], dotted: str, value: Any) -> None:
    parts = dotted.split(".")
    if not all(p.strip() for p in parts):
        raise SceneError(
            f"override {dotted!r} = {shown(value)}: must be key=value with a key such as bit.blades or string.0.length"
        )
    if isinstance(value, str):
        try:
            parsed = tomllib.loads(f"value = {value}")
            value = parsed["value"] if len(parsed) == 1 else value
        except (ValueError, RecursionError):
            pass  # plain text: a unit string or a name
    here: Any = data
    for i, part in enumerate(parts):
        last = i == len(parts) - 1
        path = ".".join(parts[: i + 1])
        if isinstance(here, list):
            if not (part.isdecimal() and int(part) < len(here)):
                raise SceneError(
                    f"override {path} = {shown(value)}: must be a number from 0 to {len(here) - 1} after "
                    f"{'.'.join(parts[:i])}"
                )
            place: Any = int(part)
        elif isinstance(here, dict):
            place = part
            if not last:
                here.setdefault(part, {})
        else:
            raise SceneError(f"override {dotted} = {shown(value)}: {'.'.join(parts[:i])} = {shown(here)} is no table")
        if last and value is None and isinstance(here, dict):
            here.pop(place, None)
        elif last:
            here[place] = value
        else:
            here = here[place]
