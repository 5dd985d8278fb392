"""Changes that differ from world to world of a batch, and that make the same of each world by itself.

A change is a function of a ``Variation``, with the decorator ``change(weight)``, that draws all that is random from
``random`` and from what the first world of the batch has, and returns what is done to a world: a function of the world
and of ``own``, which takes a world's own part of an array by world. What the library refuses by name for the batch is
not done to any.
"""

import numpy as np

import nuno
from random_worlds import RandomWorld, material_for

CHANGES = {}


class Variation:
    """A batch of worlds that become different, and each of them alone.

    Args:
        seed: Of all that is random.
        world: The single world that all begin as.
        count: Worlds of the batch.

    Attributes:
        batch: The worlds together.
        singles: Each world alone.
        log: The names of the changes so far.
    """

    def __init__(self, seed, world, count):
        self.random, self.log, self.saved = np.random.default_rng(seed), [], None
        saved = world.save()
        self.batch = world.imagine(count)
        self.singles = [nuno.World(device=world.device) for _ in range(count)]
        for single in self.singles:
            single.restore(saved)

    @property
    def scene(self):
        """The batch as what operations of `random_worlds` take."""
        scene = RandomWorld(0, self.batch)
        scene.random = self.random
        return scene

    def index(self, body):
        """A body's number, the same in all worlds."""
        return self.batch.bodies.index(body)

    def each(self, *shape, size=1.0):
        """Numbers (worlds, ...) within ``size`` of zero, in one world of two not changed at all."""
        values = self.random.uniform(-size, size, (len(self.singles), *shape))
        changed = self.random.random(len(self.singles)) < 0.6
        return values * changed.reshape(-1, *[1] * len(shape))

    def happen(self, count):
        """Let some changes happen to all worlds."""
        functions = list(CHANGES)
        weights = np.array([CHANGES[function] for function in functions], dtype=float)
        for k in self.random.choice(len(functions), count, p=weights / weights.sum()):
            self.do(functions[k])

    def do(self, function):
        """Let a change happen to all worlds."""
        self.log.append(function.__name__)
        done = function(self)
        if done is None:
            return
        try:
            done(self.batch, lambda values: values)
        except nuno.NunoError as error:
            self.log[-1] += f" ({type(error).__name__})"
            return
        for k, single in enumerate(self.singles):
            done(single, lambda values, k=k: values[k])


def change(weight):
    """Register a change, which comes as often as its weight says."""

    def register(function):
        CHANGES[function] = weight
        return function

    return register


def _positions(variation, body):
    """Where a body is, (worlds, 3)."""
    return np.broadcast_to(body.position, (len(variation.singles), 3))


@change(5)
def place(variation):
    """Any body, elsewhere."""
    body = variation.scene.pick([*variation.scene.static(), *variation.scene.dynamic()])
    if body is None:
        return None
    k, places = variation.index(body), _positions(variation, body) + variation.each(3, size=0.05)
    return lambda world, own: world.bodies[k].locate(own(places))


@change(3)
def velocity(variation):
    """A dynamic body, at another velocity and turn."""
    body = variation.scene.pick(variation.scene.dynamic())
    if body is None:
        return None
    k, linear, turn = variation.index(body), variation.each(3, size=0.8), variation.each(3, size=2.0)
    return lambda world, own: world.set_velocity(world.bodies[k], own(linear), own(turn))


@change(3)
def push(variation):
    """A dynamic body, by another force."""
    body = variation.scene.pick(variation.scene.dynamic())
    if body is None:
        return None
    k, force = variation.index(body), variation.each(3, size=0.6)
    duration = variation.scene.pick([None, 1.0 / 60.0, 0.04])
    torque = variation.each(3, size=0.01) if isinstance(body.material, nuno.Rigid) else None

    def done(world, own):
        world.push(world.bodies[k], own(force), None if torque is None else own(torque), duration)

    return done


@change(3)
def path(variation):
    """A static body, along another path."""
    body = variation.scene.pick(variation.scene.static())
    if body is None:
        return None
    times = variation.batch.time + np.array([0.0, 0.05, 0.12])
    keys = _positions(variation, body)[:, None] + np.stack([variation.each(3, size=0.04) for _ in range(3)], axis=1)
    keys[:, 0] = _positions(variation, body)
    k = variation.index(body)
    return lambda world, own: world.move(world.bodies[k], nuno.Path(times, own(keys)))


@change(3)
def hold(variation):
    """Points of a cloth or soft body, others in each world, or a rigid body, to another place, or to a body."""
    body = variation.scene.pick(variation.scene.dynamic())
    if body is None:
        return None
    k, points = variation.index(body), None
    if not isinstance(body.material, nuno.Rigid):
        points = variation.random.integers(body.vertices.shape[-2], size=(len(variation.singles), 2))
    others = [other for other in variation.batch.bodies if other is not body and other.name != "floor"]
    other = variation.scene.pick([None, None, *others])
    to = _positions(variation, body) + variation.each(3, size=0.02)
    compliance = variation.scene.pick([0.0, 1e-4])

    def done(world, own):
        target = own(to) if other is None else world.bodies[variation.index(other)]
        world.grip(world.bodies[k], None if points is None else own(points), to=target, compliance=compliance)

    return done


@change(1)
def release(variation):
    """A grip."""
    grips = variation.scene.grips()
    if not grips:
        return None
    k = variation.random.integers(len(grips))
    if any(len(RandomWorld(0, single).grips()) != len(grips) for single in variation.singles):
        return None  # of a world that was reset some may have come or gone
    return lambda world, own: RandomWorld(0, world).grips()[k].release()


@change(2)
def friction(variation):
    """Of a body or of a pair."""
    first, second = (variation.scene.pick(variation.batch.bodies) for _ in range(2))
    a, b = variation.index(first), variation.index(second)
    mu = 0.4 + variation.each(size=0.4)
    if a == b:
        return lambda world, own: setattr(world.bodies[a], "friction", own(mu))
    return lambda world, own: world.set_friction(world.bodies[a], world.bodies[b], own(mu))


@change(3)
def attach(variation):
    """A static body, as it is in each world."""
    body = variation.scene.pick(variation.scene.static())
    if body is None:
        return None
    k, material = variation.index(body), material_for(variation.scene, body)
    return lambda world, own: world.attach(world.bodies[k], material)


@change(1)
def detach(variation):
    """A dynamic body, where it is in each world."""
    body = variation.scene.pick(variation.scene.dynamic())
    if body is None:
        return None
    k = variation.index(body)
    return lambda world, own: world.detach(world.bodies[k])


@change(4)
def reset(variation):
    """Some worlds, to what they were or to what one of them was."""
    if variation.saved is None or variation.random.random() < 0.3:
        variation.saved = variation.batch.save(), [single.save() for single in variation.singles]
        return None
    whole, alone = variation.saved
    chosen = variation.random.random(len(alone)) < 0.5
    source = variation.scene.pick([None, int(variation.random.integers(len(alone)))])
    numbers = np.arange(len(alone))

    def done(world, own):
        if world is variation.batch:
            world.reset(chosen, whole if source is None else whole.pick(source))
        elif own(chosen):
            world.restore(alone[own(numbers) if source is None else source].at(world.time))
            for body, other in zip(world.bodies, variation.batch.bodies, strict=True):
                if other._path is None:  # one that has ended comes back in none
                    body._path = world._kinematic = None

    return done


@change(6)
def run(variation):
    """One to three frames, or parts of frames."""
    seconds = float(variation.scene.pick([1.0 / 60.0, 2.0 / 60.0, 0.05, 0.013]))
    return lambda world, own: world.run(seconds)
