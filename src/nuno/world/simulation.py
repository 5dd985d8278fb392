"""Simulation: the bodies of a world, their dynamics, what holds them, and their contact rules.

``Advancing`` lets time pass, ``World`` adds the verbs that a program uses.
"""

from __future__ import annotations

import uuid
import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from nuno.bodies.body import Body
from nuno.bodies.contact_rules import ContactRules
from nuno.dynamics.dynamics import Dynamics, ParticleDynamics, dynamics_of, make_colliders
from nuno.engines.engine import Engine
from nuno.engines.engine_registry import make_engine
from nuno.errors import BodyStateError, InvalidInputError, UnknownNameError
from nuno.joints.grip import Grip
from nuno.joints.held_points import holding, released
from nuno.joints.joint import Joint
from nuno.materials import Rigid
from nuno.tables.kinematic_motion import Schedule, is_kinematic, make_schedule, path_batches_of
from nuno.world.background import FrameLock
from nuno.world.device import checked_device, found_device
from nuno.world.pace import Pace
from nuno.world.settings import Settings

if TYPE_CHECKING:
    from nuno.dynamics.rigid_dynamics import RigidScene
    from nuno.materials import Material
    from nuno.world.background import Background
    from nuno.world.driver import Driver
    from nuno.world.watcher import Watcher

CHUNK = 30  # frames between two looks at whether the state is finite: what a diverged run can lose
CUDA_CHUNK = 60  # the same on CUDA, which idles while it is looked at


class Simulation(Settings):
    """The bodies of one world, or of a batch of equal ones, and their time; the arguments are ``World``'s."""

    def __init__(
        self, *, device: str = "auto", gravity: ArrayLike = (0.0, 0.0, -9.81), frame_rate: float = 60.0,
        substeps: int | None = None, engine: str = "nuno",
    ) -> None:  # fmt: skip
        self._device = checked_device(device)
        if device.startswith("cuda"):  # "auto" and "cpu" are always there, and Warp is loaded when they are used
            found_device(device)
        super().__init__(gravity, frame_rate, substeps)
        self.world_count = 1
        self.lock = FrameLock()  # hold it (``with world.lock:``) to read several bodies at the same instant
        self._time = 0.0
        self._clock_shift: np.ndarray | None = None  # (worlds,) [s], what each world's clock is behind; None: nothing
        self._family = uuid.uuid4().hex
        # whether its materials are guesses, of which many are imagined: nobody is told of their resolution, and one
        # that passes through itself is a guess that does not fit
        self._quiet = False
        self._bodies: dict[str, Body] = {}
        # arrays of states that callers have views of
        self._views: weakref.WeakKeyDictionary[Dynamics, dict[str, Any]] = weakref.WeakKeyDictionary()
        self._bodies_by_key: weakref.WeakValueDictionary[str, Body] = weakref.WeakValueDictionary()
        self._grips_by_key: weakref.WeakValueDictionary[str, Grip] = weakref.WeakValueDictionary()
        self._rules = ContactRules()
        self._colliders: dict[Any, Any] = {}
        self._collider_version = 0
        # bodies that follow a path or a body that does; None: to be found anew
        self._kinematic: list[Body] | None = None
        self._schedule: Schedule | None = None
        self._rests = False  # whether kinematic bodies are where they were in the frame before
        self._reported = 0.0  # [s], up to when the present run has told of itself
        self._telling = False  # whether it tells of a frame just now
        self._resting: tuple[Any, ...] | None = None  # what kinematic bodies followed when they were told to rest
        self.drivers: list[Driver] = []  # asked around every frame, such as a simulated robot
        self._left_out: list[Driver] = []  # those of which it was said that imagined worlds are without them
        self._background: Background | None = None
        self._pace = Pace()
        self._rigid: RigidScene | None = None
        self._watchers: list[Watcher] = []  # viewers and films: told of each piece of a run
        self._engine = make_engine(engine, self, self._device, self._rules)

    def __repr__(self) -> str:
        batch = f", {self.world_count} worlds" if self.world_count > 1 else ""
        return f"<World at t = {self._time:.3f} s, {len(self._bodies)} bodies{batch}>"

    @property
    def time(self) -> float:
        """The simulated time [s]."""
        return self._time

    @property
    def clock(self) -> Any:
        """Each world's own clock [s], a number or (worlds,): ``time``, but for what ``reset`` has set back.

        Paths and pushes go by ``time``, which all worlds of a batch share.
        """
        shift = np.zeros(self.world_count) if self._clock_shift is None else self._clock_shift
        return self._time - (shift if self.world_count > 1 else float(shift[0]))

    @property
    def device(self) -> str:
        """The device that dynamics run on, "cpu" or "cuda:0" ..."""
        self._device = found_device(self._device)
        return self._device

    @property
    def bodies(self) -> tuple[Body, ...]:
        """All bodies, in the order in which they were added."""
        with self._call():
            return tuple(self._bodies.values())

    @property
    def engine(self) -> Engine:
        """The engine that moves what is dynamic: its ``name``, and its ``capabilities``."""
        return self._engine

    @property
    def is_running(self) -> bool:
        """Return True if frames are made in the background."""
        return self._background is not None and self._background.alive

    def __copy__(self) -> Simulation:
        raise BodyStateError("a world is copied with imagine(1), which gives it bodies of its own, or kept with save")

    def __deepcopy__(self, memo: Any) -> Simulation:
        return self.__copy__()

    def __reduce__(self) -> Any:
        raise BodyStateError("a world is not pickled: save(path) writes it to a file, and restore reads it")

    @contextmanager
    def _call(self) -> Iterator[None]:
        with self.lock:
            self._raise_background_error()
            yield

    @contextmanager
    def _change(self, what: str) -> Iterator[None]:
        """Hold the lock for a call that changes the world, or takes what it is as a whole.

        Raises:
            BodyStateError: the call comes from ``each_frame``, where the world's clock is behind its dynamic bodies.
        """
        with self._call():
            self._check_between_frames(what)
            yield

    def _check_between_frames(self, what: str) -> None:
        if self._telling:
            raise BodyStateError(
                f"{what} was called in each_frame, in the midst of a run; there a world can only be read: "
                "run or step up to then, and call it after that"
            )

    def _raise_background_error(self) -> None:
        background = self._background
        if background is not None and background.error is not None and not background.is_current_thread:
            self._background = None
            raise background.error

    def _own(self, body: Body | str) -> Body:
        """Return this world's body for a name, one of its bodies, or one of the world it comes from."""
        if isinstance(body, str):
            named = next((b for b in self._bodies.values() if b.name == body), None)
            if named is None:
                raise UnknownNameError("body", body, [b.name for b in self._bodies.values()])
            return named
        if not isinstance(body, Body):
            raise InvalidInputError(f"a body or its name is needed, got {type(body).__name__}")
        own = self._bodies.get(body.key)
        if own is None:
            where = "no world" if body._world is None else "another world"
            raise BodyStateError(f"{body.name!r} is in {where}, not in this one")
        return own

    def _own_dynamics(self, body: Body | str, instead: str) -> tuple[Body, Dynamics]:
        """Return this world's body and its dynamics; a static one is refused, and told what to do ``instead``."""
        own = self._own(body)
        dynamics = dynamics_of(own)
        if dynamics is None:
            raise BodyStateError(f"{own.name!r} is static; {instead}")
        return own, dynamics

    def _pair(self, a: Body | str, b: Body | str) -> frozenset[str]:
        first, second = self._own(a), self._own(b)
        if first is second:
            raise InvalidInputError(f"a pair needs two bodies, got {first.name!r} twice")
        return frozenset((first.key, second.key))

    def _attached(self) -> list[Dynamics]:
        return [own for body in self._bodies.values() if (own := dynamics_of(body)) is not None]

    def _check_joined(self, body: Body, material: Any) -> None:
        """Refuse that a static body to which others are joined becomes a cloth or soft body."""
        if isinstance(material, Rigid) or body.is_dynamic:  # a joint with a dynamic body ends as that is detached
            return
        for dynamics in self._attached():
            for grip in dynamics.grips:
                if isinstance(grip, Joint) and grip.target is body:
                    raise BodyStateError(
                        f"{grip.body.name!r} is joined to {body.name!r}, which can only become Rigid; "
                        "release that first"
                    )

    def _check_worlds(self, what: str, axes: tuple[int, ...]) -> None:
        if axes and axes != (self.world_count,):
            raise InvalidInputError(f"{what} must be one value or {self.world_count}, one a world, got {axes[0]}")

    def _register(self, body: Body) -> None:
        body._world = self
        self._bodies[body.key] = self._bodies_by_key[body.key] = body

    def _detach(self, body: Body) -> None:
        dynamics = dynamics_of(body)
        assert dynamics is not None
        tied = [grip for other in self._attached() for grip in other.grips if grip.is_tie and grip.target is body]
        for grip in [*dynamics.grips, *tied]:
            self._drop_grip(grip)
        body._thickness = body.thickness
        body._freeze()
        dynamics.release()
        self._colliders_changed()

    def _hold(self, grip: Grip, worlds: np.ndarray | None = None) -> None:
        """Let a grip hold; in a batch, of some worlds (worlds,) bool alone as far as the others can tell."""
        dynamics = dynamics_of(grip.body)
        assert dynamics is not None
        self._engine.allow_grip(grip.spec, grip.target is not None and grip.target.is_dynamic)
        grip._world = self
        self._grips_by_key[grip.key] = grip
        dynamics.note_grips(worlds)
        dynamics.grips.append(grip)
        self._engine.changed()
        if grip.ignored:
            self._held_changed(worlds)

    def _drop_grip(self, grip: Grip, worlds: np.ndarray | None = None) -> None:
        """Let a grip go, in all worlds or in some (worlds,) bool, where it holds nothing any more."""
        dynamics = dynamics_of(grip.body)
        self._engine.changed()
        if worlds is not None:
            grip.spec = released(grip.spec, worlds)
        if worlds is None or not holding(grip.spec, self.world_count).any():
            grip._world = None
        if dynamics is not None:
            dynamics.note_grips(worlds)
            dynamics.grips = [other for other in dynamics.grips if other is not grip or grip.active]
            if grip.ignored:
                self._held_changed(worlds)

    def _colliders_changed(self) -> None:
        self._collider_version += 1
        self._engine.changed()
        self._take_held()
        self._colliders.clear()
        self._kinematic = None

    def _take_held(self) -> None:
        grips = [grip for dynamics in self._attached() for grip in dynamics.grips]
        self._rules.set_held(
            (grip.body.key, key, holding(grip.spec, self.world_count)) for grip in grips for key in grip.ignored
        )

    def _held_changed(self, worlds: np.ndarray | None) -> None:
        """Let what a held rigid body passes through be other bodies now, in all worlds or in some (worlds,) bool."""
        if worlds is None:
            self._colliders_changed()
            return
        self._take_held()
        if self._rigid is not None:
            self._rigid.held_changed(self, worlds)

    def _body_changed(self, key: str) -> None:
        """Be told that a body was moved, or its friction or groups changed."""
        body = self._bodies[key]
        dynamics = dynamics_of(body)
        if dynamics is not None and not np.array_equal(dynamics.friction, body.friction):
            self._renew(body, dynamics.material)  # a solver takes its friction when it is made
        self._colliders_changed()

    def _renew(self, body: Body, material: Material) -> None:
        """Give a dynamic body a solver for another material or friction, in the state that it is in."""
        dynamics = dynamics_of(body)
        assert dynamics is not None
        state = dynamics.state()
        renewed = self._engine.make(body, material, state, body.friction)
        dynamics.release()
        renewed.grips, renewed.pushes, renewed.grips_changed = dynamics.grips, dynamics.pushes, True
        body._dynamics = renewed
        renewed.load_state(state)

    def _bring_colliders(self) -> None:
        static: list[Body] | None = None
        for body in self._bodies.values():
            dynamics = dynamics_of(body)
            if not isinstance(dynamics, ParticleDynamics):
                continue
            dynamics.sum_impulses(body.key in self._rules.summed)
            if dynamics.collider_version == self._collider_version:
                continue
            if static is None:
                static = [b for b in self._bodies.values() if not b.is_dynamic]
            touching, friction = self._rules.colliders_of(body, static)
            key = (
                *(b.key for b in touching),
                *((name, np.asarray(mu).tobytes()) for name, mu in friction.items()),
            )
            if key not in self._colliders:
                self._colliders[key] = make_colliders(touching, friction, self)
            dynamics.solver.set_colliders(self._colliders[key])
            dynamics.collider_version = self._collider_version

    def _bring_rigid(self) -> None:
        if self._rigid is not None:
            self._rigid.bring(self)

    def _rigid_scene(self, origin: np.ndarray) -> RigidScene:
        """Return what moves the rigid bodies, made anew where the world has become another."""
        from nuno.dynamics.rigid_dynamics import RigidScene

        settings = (self.world_count, self.device, self.gravity, self.frame_rate, self.substeps)
        if self._rigid is None or self._rigid.settings != settings:
            self._rigid = RigidScene(self, origin)
        return self._rigid

    def _wrench(self, grip: Grip) -> tuple[np.ndarray, np.ndarray]:
        """Return force [N] and torque [N m], (worlds, 3) each, that an active grip bears."""
        if grip.borne is not None:
            time, borne = grip.borne
            if time == self._time:
                own = np.where(holding(grip.spec, self.world_count)[:, None], borne, 0.0)
                return own[:, :3], own[:, 3:]
            grip.borne = None
        return self._engine.wrench(grip)

    def _kinematic_bodies(self) -> list[Body]:
        if self._kinematic is None:
            self._kinematic = [b for b in self._bodies.values() if not b.is_dynamic and is_kinematic(b)]
        return self._kinematic

    def _schedule_kinematic(self, start: float, duration: float) -> None:
        """Tell colliders and grips where the kinematic bodies are in the run from ``start`` on."""
        kinematic = self._kinematic_bodies()
        self._rests = self._kinematic_rest(kinematic, start)
        if self._rests:
            return
        self._schedule = None
        if kinematic:
            self._schedule = make_schedule(kinematic, start, duration, 1.0 / self.frame_rate)
            for colliders in self._colliders.values():
                colliders.follow(self._schedule)

    def _kinematic_rest(self, kinematic: list[Body], start: float) -> bool:
        """Return True if all paths had ended when they were last told of, and nothing has changed since."""
        before, self._resting = self._resting, None
        if not kinematic or self._rigid is not None:
            return False
        path_batches, others = path_batches_of(kinematic)
        if others or any(start < path_batch.times[-1] for path_batch, _ in path_batches):
            return False
        self._resting = (self._collider_version, *(path_batch for path_batch, _ in path_batches))
        return self._resting == before
