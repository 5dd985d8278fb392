"""World: bodies that come and go, and dynamics that come and go."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from nuno.bodies.body import Body
from nuno.bodies.body_facts import place_text, warn_of_double
from nuno.bodies.given_velocity import given_velocity, present_velocity
from nuno.dynamics.dynamics import check_material, default_material
from nuno.dynamics.push import make_push
from nuno.errors import BodyStateError, InvalidInputError
from nuno.files.html_table import html_table
from nuno.joints.grip import Grip
from nuno.joints.joint import Joint
from nuno.joints.make_grip import make_grip, warn_shared
from nuno.joints.tie import check_leader, check_weld, tie_to_leader
from nuno.materials import Material, Rigid
from nuno.shapes.coordinates import Coordinates
from nuno.shapes.path import Path
from nuno.solvers.resolution_warnings import warn_of_resolution
from nuno.tables.kinematic_motion import arrive, path_for
from nuno.validation import finite_array, flag, number
from nuno.world.setting import Setting


class World(Setting):
    """A room: static bodies, which cost nothing, and attached ones, which move.

    All methods may be called while the world runs in the background; they take effect between frames. In what a run
    calls for each frame, a world can only be read: all that would change or copy it raises BodyStateError. Where a body
    is asked for, an imagined world also takes the body of the world that it was imagined from.

    Args:
        device: "auto" (CUDA where there is a device, else the CPU), "cpu", "cuda" or "cuda:1" ...
        gravity: (3,) [m/s2].
        frame_rate: Frames per second of simulated time [1/s].
        substeps: Substeps of a frame; None lets each solver choose by its rule.
        engine: What moves the dynamic bodies: "nuno", "mujoco" (the extra of that name) ... What an engine lacks is
            refused with an EngineCapabilityError before anything moves.

    Raises:
        InvalidInputError: a value that is not finite or out of range.
        UnknownNameError: there is no such engine.
        MissingPackageError: the engine's package is not installed.
        EngineCapabilityError: the engine does not run on the device.
    """

    def _repr_html_(self) -> str:
        with self.lock:
            bodies = tuple(self._bodies.values())
            rows = [
                (body.name, body.shape.kind, place_text(body),
                 "static" if body.material is None else type(body.material).__name__)
                for body in bodies
            ]  # fmt: skip
            batch = f", {self.world_count} worlds" if self.world_count > 1 else ""
            title = f"World at t = {self.time:.3f} s{batch}"
        return html_table(title, rows, columns=("body", "shape", "position", "dynamics") if rows else ())

    # Bodies

    def add(self, body: Body) -> Body:
        """Put a body into the world and return it; a name that is taken gets a number ("box_1").

        Raises:
            BodyStateError: the body is in a world already.
            InvalidInputError: no body, or one that has values for another number of worlds.
        """
        with self._change("add"):
            if not isinstance(body, Body):
                raise InvalidInputError(f"add needs a Body, got {type(body).__name__}")
            if body._world is not None or body.key in self._bodies:
                where = "this" if body.key in self._bodies else "another"
                raise BodyStateError(f"{body.name!r} is in {where} world already")
            for what, array in (("position", body._position), ("quaternion", body._quaternion)):
                self._check_worlds(what, array.shape[:-1])
            for what, value in (("friction", body.friction), ("thickness", body.thickness)):
                self._check_worlds(what, np.shape(value))
            if body._deformed is not None and len(body._deformed[0]) not in (1, self.world_count):
                raise InvalidInputError(f"{body.name!r} has the shapes of {len(body._deformed[0])} worlds")
            taken = {other.name for other in self._bodies.values()}
            name, number_ = body.name, 0
            while name in taken:
                number_ += 1
                name = f"{body.name}_{number_}"
            if number_:
                warn_of_double(body, self._own(body.name), name)
            body._name = name
            self._register(body)
            self._colliders_changed()
        return body

    def remove(self, body: Body | str) -> Body:
        """Take a body out of the world, detached in the shape that it has now, and return it.

        Grips that it leads end. Bodies of the world that follow it (``assoc``) stand still from now on where they are;
        to let them go along with it where it stands again, ``assoc`` them anew.
        """
        with self._change("remove"):
            removed = self._own(body)
            if removed.is_dynamic:
                self._detach(removed)
            for other in self._attached():
                for grip in [g for g in other.grips if g.target is removed]:
                    self._drop_grip(grip)
            if removed.children:
                _leave_standing(removed, set(self.bodies))
            del self._bodies[removed.key]
            removed._world = removed._path = None
            self._colliders_changed()
        return removed

    def find(self, name: str) -> Body:
        """Return the body of that name.

        Raises:
            UnknownNameError: there is none.
        """
        with self._call():
            return self._own(name)

    # Dynamics

    def attach(
        self, body: Body | str, material: Material | None = None, *, velocity: ArrayLike | None = None,
        angular_velocity: ArrayLike | None = None, keep_velocity: bool = False,
    ) -> Body:  # fmt: skip
        """Give a body dynamics, from the shape that it has now, at rest or moving; no other body changes.

        The body takes the material's friction and thickness over, and keeps them when it is detached. Without
        a material a cloth gets ``Cloth``, a soft body ``Soft`` and any other ``Rigid``, with the body's friction.
        ``Rigid`` may be given to all but planes: a cloth or soft body then keeps the shape that it has now.

        Args:
            body: The body.
            material: The material.
            velocity: As of ``set_velocity``; None is at rest.
            angular_velocity: As of ``set_velocity``; None is without a turn.
            keep_velocity: Take a dynamic body over from the dynamics that it has, which end as ``detach`` ends them
                (its grips let go). What becomes cloth or soft keeps the velocities of the vertices. What becomes rigid
                keeps the velocity of the centre of mass and the angular velocity I^-1 L. A static body has no velocity
                to keep, also where it was detached at this instant: it starts at rest.

        Raises:
            BodyStateError: it has dynamics already and ``keep_velocity`` is not set, follows another frame or a path,
                would deform while it holds a rigid body, or is to be rigid where each world has deformed it otherwise.
            InvalidInputError: the shape has no such dynamics, or the material or a velocity does not fit.
            MeshError: a rigid body without volume.
        """
        with self._change("attach"):
            own = self._own(body)
            flag("keep_velocity", keep_velocity)
            if own.is_dynamic and not keep_velocity:
                raise BodyStateError(
                    f"{own.name!r} is dynamic already; detach it first to change its material, or set keep_velocity"
                )
            if keep_velocity and not (velocity is None and angular_velocity is None):
                raise InvalidInputError("keep_velocity leaves no room for a velocity or angular_velocity")
            if own._parent is not None:
                raise BodyStateError(f"{own.name!r} follows another frame; dissoc it first")
            if own._path is not None:
                raise BodyStateError(f"{own.name!r} follows a path; end that with world.move(body, None) first")
            chosen: Any = default_material(own) if material is None else material
            check_material(own.shape, chosen, self.world_count)
            self._check_joined(own, chosen)
            given = None if not own.is_dynamic else present_velocity(own)
            if velocity is not None or angular_velocity is not None:
                is_rigid = isinstance(chosen, Rigid)
                given = given_velocity(own, is_rigid, velocity, angular_velocity, self.world_count)
            following = [
                grip
                for other in self._attached()
                for grip in other.grips
                if grip.target is own and not isinstance(grip, Joint)
            ]
            if not own.is_dynamic:
                check_leader(own, not isinstance(chosen, Rigid), following)
            self._engine.allow_dynamics(own, chosen)
            dynamics = self._engine.attach(own._as_static(), chosen)
            if given is not None:
                dynamics.set_velocity(own, given)
            if own.is_dynamic:
                self._detach(own)
                following = []
            own._friction, own._dynamics = chosen.friction, dynamics
            for grip in following:
                tie_to_leader(grip, self.world_count)
                grip.body._dynamics.grips_changed = True  # type: ignore[union-attr]
            if not dynamics.is_rigid:
                own._deformed = None
            self._colliders_changed()
            if not self._quiet:
                warn_of_resolution(own)
        return own

    def detach(self, body: Body | str) -> Body:
        """Take a body's dynamics away: static from now on, in the shape that it has now. Its grips let go.

        Raises:
            BodyStateError: it has none.
        """
        with self._change("detach"):
            own, _ = self._own_dynamics(body, "there is nothing to detach")
            self._detach(own)
        return own

    def move(self, body: Body | str, to: Path | None) -> None:
        """Let a static body follow a path from now on; what touches it feels its surface move.

        The body is where the path is at once, which is a jump where that is elsewhere, keeps its own orientation
        where the path has none, and rests at the last key. Bodies that follow it (``assoc``) move along. Another
        path takes the place of this one; ``locate`` and its like end it.

        Args:
            body: The body.
            to: The path; None ends it, and the body stays where it is.

        Raises:
            BodyStateError: the body is dynamic, or follows another frame.
            InvalidInputError: ``to`` is no path, or one for another number of worlds.
        """
        with self._change("move"):
            own = self._own(body)
            if to is not None:
                self._engine.require("moving shapes")
            before = (own._path is None, own._position.ndim, own._quaternion.ndim)
            own._path = None if to is None else path_for(own, to, self.world_count)
            arrive([own], self._time)
            if before != (own._path is None, own._position.ndim, own._quaternion.ndim):
                self._colliders_changed()

    def set_material(self, body: Body | str, material: Material) -> None:
        """Change the material of a dynamic body as it moves: its shape, velocity, grips and pushes stay.

        Raises:
            BodyStateError: the body is static, or of another kind (detach it, and attach it with the new one).
            InvalidInputError: the material does not fit the shape or the batch.
        """
        with self._change("set_material"):
            own, dynamics = self._own_dynamics(body, "attach it with the material")
            if type(material) is not type(dynamics.material):
                kinds = f"{type(dynamics.material).__name__}, not {type(material).__name__}"
                raise BodyStateError(f"{own.name!r} moves as {kinds}; detach it to attach it as another kind")
            chosen: Any = material
            check_material(own.shape, chosen, self.world_count)
            self._engine.allow_dynamics(own, chosen)
            own._friction = chosen.friction
            self._renew(own, chosen)
            self._colliders_changed()
            if not self._quiet:
                warn_of_resolution(own)

    def grip(
        self, body: Body | str, where: Any = None, *, to: Any, compliance: float = 0.0, free: ArrayLike | None = None,
        max_force: ArrayLike | None = None, ignore: Sequence[Body | str] | None = None,
    ) -> Grip:  # fmt: skip
        """Hold points of a dynamic body, or a rigid one as a whole, from now on.

        Args:
            body: The body.
            where: Vertex indices, (k,) for the same ones in every world or (worlds, k), -1 for none; or
                ``SurfacePoints``, from ``body.at`` or ``body.closest``. None for a rigid body.
            to: Where the mean of the points goes: a ``Path``, or a fixed point (3,) or (worlds, 3) [m]. The
                points keep their present offsets from it, which turn with the path's quaternions. Or a
                ``Body``: then they keep their present places in its frame, or, where it is a cloth or soft body, at its
                nearest points. If that body is dynamic it bears the force.
            compliance: [m/N]; 0 is stiff. Of a rigid body's turns as much [1/(N m)].
            free: (3,), a direction of the world along which a rigid body may slide; None holds it entirely.
            max_force: [N], a number or (worlds,): the most that the grip bears, at each point where it holds points,
                and as much [N m] of a rigid body's turns. None is 10 kN, or 1,000 m/s2 times the mass of the heaviest
                rigid body that it joins; points that follow a path, a place or a static body have no limit then. With
                one they are solved beside the body's contacts, which takes longer.
            ignore: Bodies that a rigid body passes through while it is held; None is ``to``, where that is a body.

        Raises:
            BodyStateError: the body is static.
            InvalidInputError: a vertex out of range, a target that cannot be used, or a limit that is not positive.
        """
        with self._change("grip"):
            own, dynamics = self._own_dynamics(body, "attach it before it is gripped")
            target = self._own(to) if isinstance(to, Body) else None
            if ignore is not None and (isinstance(ignore, str) or not isinstance(ignore, Sequence)):
                raise InvalidInputError(f"ignore must be a sequence of bodies or names, got {ignore!r}")
            if target is own:
                raise InvalidInputError(f"{own.name!r} cannot be gripped by itself")
            leader = None if target is None else target._dynamics
            if dynamics.is_rigid and target is not None and leader is not None and not leader.is_rigid:
                raise InvalidInputError(f"{target.name!r} deforms; grip its points to {own.name!r} instead")
            grip = make_grip(
                own, where, to, number("compliance", compliance, low=0.0), target, free, self, max_force=max_force,
                ignored=None if ignore is None else [self._own(other) for other in ignore],
            )  # fmt: skip
            warn_shared(grip, dynamics.grips)
            self._hold(grip)
        return grip

    def weld(
        self, a: Body | str, b: Body | str, where: Any = None, *, compliance: float = 0.0,
        max_force: ArrayLike | None = None,
    ) -> Grip:  # fmt: skip
        """Join two dynamic bodies where they are now, until the grip that is returned is released.

        Args:
            a: A cloth or soft body, of which ``where`` says the points as in ``grip``; or a rigid body.
            b: Another body. Points of ``a`` stay on its nearest points, or at their places in its frame if it is rigid.
            where: None where both are rigid.
            compliance: [m/N]; 0 is stiff.
            max_force: [N], the most that it bears; see ``grip``.

        Raises:
            BodyStateError: one of them is static.
            InvalidInputError: points that ``a`` does not have, or a rigid ``a`` and a ``b`` that deforms.
        """
        with self._change("weld"):
            check_weld(self._own(a), self._own(b))
            return self.grip(a, where, to=self._own(b), compliance=compliance, max_force=max_force)

    def push(
        self, body: Body | str, force: ArrayLike, torque: ArrayLike | None = None, duration: float | None = None
    ) -> None:
        """Apply a force to a dynamic body.

        Args:
            body: The body.
            force: (3,) or (worlds, 3), spread over the vertices by their share of the mass at even density; or of every
                vertex, (n, 3) or (worlds, n, 3) [N]. Where worlds = n, two axes mean vertices. On a rigid body it acts
                at the centre of mass.
            torque: (3,) or (worlds, 3) [N m], on rigid bodies only.
            duration: How long [s], on top of other pushes; None is until the next such push, which takes its
                place (a force of zero ends it).

        Raises:
            BodyStateError: the body is static.
        """
        with self._change("push"):
            own, dynamics = self._own_dynamics(body, "attach it before it is pushed")
            dynamics.add_push(make_push(own, force, torque, duration, self))

    def set_friction(self, a: Body | str, b: Body | str, mu: Any) -> None:
        """Give a pair of bodies its own friction coefficient, a number or (worlds,); None takes it back.

        Raises:
            InvalidInputError: the same body twice, or a coefficient that is negative or not finite.
        """
        with self._change("set_friction"):
            pair = self._pair(a, b)
            if mu is None:
                self._rules.friction.pop(pair, None)
            else:
                value = finite_array("mu", mu, (), (self.world_count,))
                if (value < 0.0).any():
                    raise InvalidInputError(f"mu must be at least 0, got {mu!r}")
                self._engine.require("pair friction")
                self._rules.friction[pair] = float(value) if value.ndim == 0 else value
            self._colliders_changed()

    def ignore_contact(self, a: Body | str, b: Body | str, ignore: bool = True) -> None:
        """Let two bodies pass through each other, or, with ``ignore=False``, touch again.

        A cloth given twice passes through itself, which saves most of a step's time where it does not fold.
        """
        with self._change("ignore_contact"):
            own = self._own(a)
            flag("ignore", ignore)
            pair = frozenset((own.key,)) if own is self._own(b) else self._pair(a, b)
            (self._rules.ignored.add if ignore else self._rules.ignored.discard)(pair)
            self._colliders_changed()

    def sum_impulses(self, body: Body | str, on: bool = True) -> None:
        """Sum up what static bodies give a cloth or soft body, from the next frame on, or, with ``on=False``, no more.

        ``world.contacts(body).impulses`` then tells of them too. A body's frames take several times as long while its
        impulses are summed up; its motion keeps every bit. Copies of the world sum up as it does, and a body that is
        attached anew as before. For rigid bodies all is summed up in any case.
        """
        with self._change("sum_impulses"):
            own = self._own(body)
            if flag("on", on):
                self._engine.require("impulses")
            (self._rules.summed.add if on else self._rules.summed.discard)(own.key)
            self._engine.changed()


def _leave_standing(frame: Coordinates, bodies: set[Body]) -> None:
    """Let bodies of a world follow a frame no more, nor frames that follow it."""
    for child in frame.children:
        if isinstance(child, Body) and child in bodies:
            frame.dissoc(child)
        else:
            _leave_standing(child, bodies)
