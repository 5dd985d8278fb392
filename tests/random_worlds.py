"""Worlds that seeded random sequences of operations make, for tests of what must hold in all of them.

An operation is a function of a ``RandomWorld`` with the decorator ``operation(weight)``. It takes all that is random
from ``scene.random`` and finds bodies by ``scene.static()`` and ``scene.dynamic()``, so that it does the same to equal
worlds; it returns early where there is nothing to do. What the library refuses by name is refused in a copy, too.
"""

import functools

import numpy as np
import trimesh

import nuno

MOST = 5
"""Bodies of a world besides the floor."""
BALL = trimesh.creation.icosphere(subdivisions=0, radius=0.05)
OPERATIONS = {}


class RandomWorld:
    """A world to which random operations happen.

    Args:
        seed: Of all that is random.
        world: The world; None makes one with a floor.
        device: Of the world that is made.

    Attributes:
        log: The names of the operations so far.
    """

    def __init__(self, seed, world=None, device="cpu"):
        self.random = np.random.default_rng(seed)
        self.world, self.log, self.removed, self.saved = world, [], [], None
        if world is None:
            slope = self.pick([(0.0, 0.0, -9.81), (0.0, 0.0, -9.81), (1.0, 0.0, -9.0)])
            # most often few, for tests are to be quick; None is what each body chooses
            self.world = nuno.World(device=device, gravity=slope, substeps=self.pick([3, 4, 6, None]))
            self.world.add(nuno.plane(name="floor"))
            self.do(add, add, add, attach, attach, run)

    def pick(self, choices):
        """One of some, or None of none."""
        return choices[self.random.integers(len(choices))] if len(choices) else None

    def place(self, low=(-0.1, -0.1, 0.05), high=(0.1, 0.1, 0.3)):
        """A random place [m]."""
        return self.random.uniform(low, high)

    def static(self):
        """The static bodies besides the floor."""
        return [body for body in self.world.bodies if body.name != "floor" and not body.is_dynamic]

    def dynamic(self):
        """The dynamic bodies."""
        return [body for body in self.world.bodies if body.is_dynamic]

    def movable(self):
        """All bodies besides the floor, the static ones first."""
        return [*self.static(), *self.dynamic()]

    def grips(self):
        """The active grips, in the world's order."""
        return [grip for body in self.dynamic() for grip in body._dynamics.grips]

    def happen(self, count):
        """Let some random operations happen."""
        functions = list(OPERATIONS)
        weights = np.array([OPERATIONS[function] for function in functions], dtype=float)
        return self.do(*(functions[k] for k in self.random.choice(len(functions), count, p=weights / weights.sum())))

    def do(self, *functions):
        """Let operations happen; what is refused by name changes nothing."""
        for function in functions:
            self.log.append(function.__name__)
            try:
                function(self)
            except nuno.NunoError as error:
                self.log[-1] += f" ({type(error).__name__})"
        return self


def operation(weight, of=None):
    """Register an operation, which comes as often as its weight says.

    With ``of``, a method of ``RandomWorld``, it takes one of what that gives, and is nothing where there is none.
    """

    def register(function):
        def happen_to_one(scene):
            picked = scene.pick(of(scene))
            if picked is not None:
                function(scene, picked)

        act = function if of is None else functools.wraps(function)(happen_to_one)
        OPERATIONS[act] = weight
        return act

    return register


def material_for(scene, body):
    """A random material that the shape can have."""
    rigid = [nuno.Rigid(density=300.0), nuno.Rigid(mass=0.1, restitution=0.5), nuno.Rigid(mass=0.3, friction=0.1)]
    if body.shape.is_cloth:
        return scene.pick([nuno.Cloth(), nuno.Cloth(area_density=0.3, friction=0.8), rigid[2]])
    if body.shape.is_soft:
        return scene.pick([nuno.Soft(damping=0.02), nuno.Soft(self_contact=True), rigid[0]])
    return scene.pick(rigid)


def path_from(scene, position):
    """A path from a place, 0.05 to 0.4 s long, half of them with turns."""
    times = scene.world.time + np.linspace(0.0, scene.random.uniform(0.05, 0.4), 3)
    steps = scene.random.uniform(-0.05, 0.05, (2, 3))
    turns = None
    if scene.random.random() < 0.5:
        turns = np.concatenate([[(1.0, 0.0, 0.0, 0.0)], scene.random.normal((2.0, 0.0, 0.0, 0.0), 0.3, (2, 4))])
        turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    way = scene.pick(["linear", "minimum_jerk"])
    return nuno.Path(times, [position, position + steps[0], position + steps[1]], turns, way)


def points_of(scene, body):
    """Random points of a cloth or soft body; None of a rigid one, which is gripped as a whole."""
    if isinstance(body.material, nuno.Rigid):
        return None
    if scene.random.random() < 0.5:
        return scene.random.integers(len(body.vertices), size=scene.random.integers(1, 4))
    return body.closest(body.position + scene.random.uniform(-0.05, 0.05, (2, 3)))


@operation(5)
def add(scene):
    """A body of any shape."""
    if len(scene.world.bodies) > MOST:
        return
    turn, at = scene.random.normal(size=4), scene.place()
    box, bar = nuno.Box((0.1, 0.03, 0.03)), nuno.Box((0.03, 0.03, 0.1))
    shapes = [
        lambda: nuno.sheet((0.16, 0.12), (4, 3), position=at),
        lambda: nuno.sheet((0.2, 0.2), (5, 5), position=at),
        lambda: nuno.cloth_mesh(0.5 * BALL.vertices + at, BALL.faces),
        lambda: nuno.soft_box((0.06, 0.06, 0.06), (2, 2, 2), position=at, quaternion=turn),
        lambda: nuno.soft_box((0.12, 0.05, 0.05), (3, 1, 1), position=at),
        lambda: nuno.box((0.08, 0.06, 0.05), position=at, quaternion=turn),
        lambda: nuno.box((0.1, 0.1, 0.1), position=at),
        lambda: nuno.sphere(0.04, position=at),
        lambda: nuno.cylinder(0.03, 0.08, position=at, quaternion=turn),
        lambda: nuno.capsule(0.02, 0.06, position=at, quaternion=turn),
        lambda: nuno.compound([box, (bar, (0.0, 0.0, 0.05))], position=at, quaternion=turn),
        lambda: nuno.mesh((BALL.vertices + at, BALL.faces)),
    ]
    scene.world.add(scene.pick(shapes)())


@operation(3)
def join(scene):
    """Two rigid bodies, or one and the world; what cannot be joined is refused by name."""
    body, other = scene.pick(scene.dynamic()), scene.pick([None, *scene.static(), *scene.dynamic()])
    kind, axis = scene.pick([nuno.hinge, nuno.slider, nuno.ball_joint, nuno.fixed_joint]), scene.random.normal(size=3)
    if body is not None and other is not body and (other is not None or scene.random.random() < 0.3):
        where = {"point": body.position} if kind in (nuno.hinge, nuno.ball_joint) else {}
        along = {"axis": axis} if kind in (nuno.hinge, nuno.slider) else {}
        kind(body, other, **where, **along)


@operation(1, RandomWorld.movable)
def remove(scene, body):
    """Any body, whatever holds it or is held by it."""
    scene.world.remove(body)


@operation(10, RandomWorld.static)
def attach(scene, body):
    """A static body."""
    scene.world.attach(body, material_for(scene, body))


@operation(2, RandomWorld.dynamic)
def detach(scene, body):
    """A dynamic body."""
    scene.world.detach(body)


@operation(3, RandomWorld.dynamic)
def attach_as_another(scene, body):
    """A dynamic body, at once with another material, also of another kind."""
    scene.world.detach(body)
    scene.world.attach(body, material_for(scene, body))


@operation(2, RandomWorld.dynamic)
def attach_and_keep_velocity(scene, body):
    """A dynamic body, with another material, also of another kind, as it moves."""
    scene.world.attach(body, material_for(scene, body), keep_velocity=True)


@operation(2, RandomWorld.dynamic)
def set_velocity(scene, body):
    """Another velocity of a dynamic body, also a turn."""
    scene.world.set_velocity(body, scene.random.normal(0.0, 0.3, 3), scene.random.normal(0.0, 1.0, 3))


@operation(1, RandomWorld.dynamic)
def set_material(scene, body):
    """Another material of the same kind, as the body moves."""
    scene.world.set_material(body, material_for(scene, body))


@operation(4)
def grip(scene):
    """Points or a rigid body, to a place, along a path, or by another body, static or dynamic."""
    body = scene.pick(scene.dynamic())
    if body is None:
        return
    others = [other for other in scene.world.bodies if other is not body and other.name != "floor"]
    targets = [body.position + scene.random.uniform(-0.02, 0.02, 3), path_from(scene, body.position), *others[:2]]
    free = (1.0, 0.0, 0.0) if isinstance(body.material, nuno.Rigid) and scene.random.random() < 0.2 else None
    compliance = scene.pick([0.0, 1e-4, 1e-3])
    limit = {"max_force": scene.pick([1.0, 50.0])} if scene.random.random() < 0.4 else {}
    scene.world.grip(body, points_of(scene, body), to=scene.pick(targets), compliance=compliance, free=free, **limit)


@operation(2)
def weld(scene):
    """Two dynamic bodies."""
    bodies = scene.dynamic()
    if len(bodies) > 1:
        a, b = scene.random.choice(len(bodies), 2, replace=False)
        scene.world.weld(bodies[a], bodies[b], points_of(scene, bodies[a]), compliance=scene.pick([0.0, 1e-4]))


@operation(2, RandomWorld.grips)
def release(scene, grip):
    """A grip."""
    grip.release()


@operation(4, RandomWorld.dynamic)
def push(scene, body):
    """A dynamic body, for a while or until the next such push; a rigid one is turned, too."""
    duration = scene.pick([None, 1.0 / 60.0, 0.1, float(scene.random.uniform(0.01, 0.2))])
    torque = scene.random.uniform(-0.01, 0.01, 3) if isinstance(body.material, nuno.Rigid) else None
    scene.world.push(body, scene.random.uniform(-0.5, 0.5, 3), torque, duration)


@operation(2, RandomWorld.movable)
def locate(scene, body):
    """Any body, elsewhere, at any turn."""
    body.locate(scene.place()).rotate(scene.random.uniform(0.0, 3.0), scene.random.normal(size=3))


@operation(1, RandomWorld.movable)
def nudge(scene, body):
    """Any body, a little."""
    body.translate(scene.random.uniform(-0.01, 0.01, 3))


@operation(4, RandomWorld.static)
def move(scene, body):
    """A static body, along a path."""
    scene.world.move(body, path_from(scene, body.position))


@operation(1, RandomWorld.static)
def end_path(scene, body):
    """A static body stays where it is."""
    scene.world.move(body, None)


@operation(1)
def assoc(scene):
    """A static body follows another body."""
    follower, leader = scene.pick(scene.static()), scene.pick([*scene.static(), *scene.dynamic()])
    if follower is not None and follower is not leader and follower not in (leader, leader.parent):
        leader.assoc(follower)


@operation(0.5)
def dissoc(scene):
    """A body that follows another stands still."""
    body = scene.pick([body for body in scene.static() if isinstance(body.parent, nuno.Body)])
    if body is not None:
        body.parent.dissoc(body)


@operation(2)
def rules(scene):
    """Friction of a pair or of a body, a pair or a cloth that does not touch (itself), groups."""
    a, b = scene.pick(scene.world.bodies), scene.pick(scene.world.bodies)
    kind = scene.random.integers(4)
    if kind == 0 and a is not b:
        scene.world.set_friction(a, b, scene.pick([None, 0.1, 0.9]))
    elif kind == 1:
        scene.world.ignore_contact(a, b, bool(scene.random.integers(2)))
    elif kind == 2:
        a.friction = scene.random.uniform(0.0, 1.0)
    else:
        a.group = int(scene.random.integers(1, 4))


@operation(12)
def run(scene):
    """One to three frames, or parts of frames."""
    scene.world.run(float(scene.pick([1.0 / 60.0, 1.0 / 60.0, 2.0 / 60.0, 0.05, 0.013])))


@operation(1)
def go_back(scene):
    """Save, or restore what was saved."""
    if scene.saved is None:
        scene.saved = scene.world.save()
    else:
        scene.world.restore(scene.saved)
        scene.saved = None


@operation(1)
def adopt(scene):
    """One of two futures, after a frame."""
    if scene.world.world_count == 1:
        futures = scene.world.imagine(2)
        futures.step()
        scene.world.adopt(futures, int(scene.random.integers(2)))


def state_of(world, k=None):
    """All that can be seen of a world, or of world k of a batch: arrays by name."""
    picked = functools.partial(_of_world, world.world_count, k)
    found = {"time": np.array(world.time)}
    for n, body in enumerate(world.bodies):
        own = f"{n} {body.name} {body.is_dynamic} {type(body.material).__name__} {body.is_deformed}"
        found[f"{own} vertices"] = picked(body.vertices, 2)
        found[f"{own} velocities"] = picked(body.velocities, 2)
        found[f"{own} position"], found[f"{own} quaternion"] = picked(body.position, 1), picked(body.quaternion, 1)
        found[f"{own} friction"] = picked(np.asarray(body.friction), 0)
        if _leads(body._path, world, k):
            found[f"{own} path"] = picked(body._path.at(world.time), 1)
    return found


def _leads(path, world, k):
    """Whether a path leads anywhere in a world; a batch has one for all, which stays in place where a world has none.

    One that has ended is no more than a place, either.
    """
    if path is None or path.times[-1] <= world.time:
        return False
    parts = [path.positions] if path.quaternions is None else [path.positions, path.quaternions]
    own = [_of_world(world.world_count, k, keys, 2) for keys in parts]
    return any((keys != keys[..., :1, :]).any() for keys in own)


def wrenches_of(world, k=None):
    """What all grips bear, by number, in the order of bodies."""
    grips = RandomWorld(0, world).grips()
    picked = functools.partial(_of_world, world.world_count, k)
    return {f"grip {n} on {grip.body.name}": np.stack([picked(part, 1) for part in grip.wrench])
            for n, grip in enumerate(grips)}  # fmt: skip


def _of_world(worlds, k, values, axes):
    """World k of an array that may have an axis of worlds before so many others."""
    return values[k] if worlds > 1 and np.ndim(values) > axes else values


def differences(found, expected):
    """What is not the same, to the bit, in words; empty where all is."""
    if list(found) != list(expected):
        return [f"other bodies: {list(found)} for {list(expected)}"]
    told = []
    for name, values in expected.items():
        own = found[name]
        if own.shape != values.shape or not np.array_equal(own, values, equal_nan=True):
            far = np.abs(own - values).max() if own.shape == values.shape else np.nan
            told.append(f"{name}: {far:.3g} off")
    return told
