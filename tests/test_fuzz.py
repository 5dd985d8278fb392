"""Random operations on a world with bodies of every kind, against a plain model of what must be true."""

import numpy as np
import pytest

import nuno

MOST_BODIES = 7
MATERIALS = {"sheet": nuno.Cloth(air_drag=2.0), "soft": nuno.Soft(damping=0.05), "rigid": nuno.Rigid(density=300.0)}


class Model:
    """What must be true: bodies by name, their kinds, which are dynamic, which grips are held, and the time."""

    def __init__(self):
        self.kinds, self.dynamic, self.grips, self.time = {}, set(), [], 0.0

    def copy(self):
        """Return a copy, for what is saved."""
        other = Model()
        other.kinds, other.dynamic = dict(self.kinds), set(self.dynamic)
        other.grips, other.time = list(self.grips), self.time
        return other

    def let_go(self, name):
        """Forget the grips that a body is in, as what is held or as what moves and leads it."""
        self.grips = [grip for grip in self.grips if name not in grip[1:]]


class Fuzz:
    """A world and its model, and the operations that may happen to both.

    Args:
        seed: Of all that is random.
    """

    def __init__(self, seed):
        self.random = np.random.default_rng(seed)
        self.world, self.model, self.made, self.saved = nuno.World(device="cpu"), Model(), 0, None
        self.world.add(nuno.plane(name="floor"))
        self.counts = {}

    def pick(self, names):
        """One of some names, or None."""
        names = sorted(names)
        return names[self.random.integers(len(names))] if names else None

    def static(self):
        """Names of the static bodies."""
        return self.model.kinds.keys() - self.model.dynamic

    def add(self):
        """A body somewhere above the floor."""
        if len(self.model.kinds) >= MOST_BODIES:
            return
        kind = self.pick(MATERIALS)
        at = self.random.uniform((-0.3, -0.3, 0.05), (0.3, 0.3, 0.5))
        name = f"{kind}{self.made}"
        self.made += 1
        body = {
            "sheet": lambda: nuno.sheet((0.12, 0.12), (4, 4), position=at, name=name),
            "soft": lambda: nuno.soft_box((0.06, 0.06, 0.06), (2, 2, 2), position=at, name=name),
            "rigid": lambda: nuno.box((0.06, 0.06, 0.06), position=at, name=name),
        }[kind]()
        self.world.add(body)
        self.model.kinds[name] = kind

    def remove(self):
        """Any body, dynamic or not, gripped or not."""
        name = self.pick(self.model.kinds)
        if name is None:
            return
        # grips to a static body that goes let go as well
        self.world.remove(name)
        del self.model.kinds[name]
        self.model.dynamic.discard(name)
        self.model.let_go(name)

    def attach(self):
        """A static body, as its own kind, or now and then as rigid."""
        name = self.pick(self.static())
        if name is None:
            return
        kind = "rigid" if self.random.random() < 0.1 else self.model.kinds[name]
        if kind == "rigid" and self.model.kinds[name] == "sheet":
            self.world.attach(name, nuno.Rigid(mass=0.02))
        else:
            self.world.attach(name, MATERIALS[kind])
        self.model.dynamic.add(name)
        self.model.let_go(name)

    def detach(self):
        """A dynamic body."""
        name = self.pick(self.model.dynamic)
        if name is None:
            return
        self.world.detach(name)
        self.model.dynamic.discard(name)
        self.model.let_go(name)

    def grip(self):
        """Points of a body, or a rigid one, in place, or to a moving body: a weld."""
        name = self.pick(self.model.dynamic)
        if name is None:
            return
        body = self.world.find(name)
        rigid = isinstance(body.material, nuno.Rigid)
        where = None if rigid else self.random.choice(len(body.vertices), 2, replace=False)
        held = body.position if rigid else body.vertices[where].mean(axis=0)
        compliance = self.pick([0.0, 1e-3])
        other = self.pick(self.model.dynamic - {name})
        led = other is not None and self.random.random() < 0.3
        if led and rigid and not isinstance(self.world.find(other).material, nuno.Rigid):
            led = False
        if led:
            grip = self.world.weld(name, other, where, compliance=compliance)
        else:
            grip = self.world.grip(name, where, to=held, compliance=compliance)
        self.model.grips.append((grip, name, other) if led else (grip, name))

    def release(self):
        """A grip."""
        if self.model.grips:
            self.model.grips.pop(self.random.integers(len(self.model.grips)))[0].release()

    def push(self):
        """A dynamic body, with up to its weight or so, for a while."""
        name = self.pick(self.model.dynamic)
        if name is not None:
            self.world.push(name, self.random.uniform(-0.2, 0.2, 3), duration=float(self.random.uniform(0.02, 0.2)))

    def locate(self):
        """A static body, elsewhere."""
        name = self.pick(self.static())
        if name is not None:
            self.world.find(name).locate(self.random.uniform((-0.3, -0.3, 0.05), (0.3, 0.3, 0.5)))

    def move(self):
        """A static body, along a path; ended at once, so that it can be attached again."""
        name = self.pick(self.static())
        if name is not None:
            at = self.world.find(name).position
            path = nuno.Path([self.world.time, self.world.time + 0.05], [at, at + self.random.uniform(-0.03, 0.03, 3)])
            self.world.move(name, path)
            self.step()
            self.world.move(name, None)

    def rules(self):
        """Friction of a pair, or none of their contact."""
        if len(self.model.kinds) >= 2:
            a, b = self.random.choice(sorted(self.model.kinds), 2, replace=False)
            self.world.set_friction(str(a), str(b), float(self.random.uniform(0.0, 1.0)))
            self.world.ignore_contact(str(a), str(b), bool(self.random.integers(2)))

    def step(self):
        """One to three frames."""
        frames = int(self.random.integers(1, 4))
        for _ in range(frames):
            self.world.step()
        self.model.time += frames / self.world.frame_rate

    def save(self):
        """All that is, for later."""
        self.saved = self.world.save(), self.model.copy(), self.shapes()

    def restore(self):
        """What was saved: every body is where it was, bit for bit."""
        if self.saved is not None:
            self.world.restore(self.saved[0])
            self.model = self.saved[1].copy()
            for name, vertices in self.saved[2].items():
                np.testing.assert_array_equal(self.world.find(name).vertices, vertices, err_msg=name)

    def adopt(self):
        """One of two futures, after a frame."""
        futures = self.world.imagine(2)
        futures.step()
        self.world.adopt(futures, 1)
        self.model.time += 1.0 / self.world.frame_rate

    OPERATIONS = (
        (add, 8), (remove, 2), (attach, 10), (detach, 4), (grip, 5), (release, 4), (push, 5), (locate, 3), (move, 2),
        (rules, 3), (step, 12), (save, 2), (restore, 1), (adopt, 1),
    )  # fmt: skip
    STILL = ("add", "push", "rules", "save", "grip", "release")

    def shapes(self):
        """All vertices."""
        return {name: self.world.find(name).vertices for name in self.model.kinds}

    def one(self):
        """One random operation, and what must be true after it."""
        weights = np.array([weight for _, weight in self.OPERATIONS], dtype=float)
        operation = self.OPERATIONS[self.random.choice(len(weights), p=weights / weights.sum())][0]
        name = operation.__name__
        self.counts[name] = self.counts.get(name, 0) + 1
        before = self.shapes()
        operation(self)
        model, world = self.model, self.world
        assert {body.name for body in world.bodies} == {"floor", *model.kinds}
        assert {body.name for body in world.bodies if body.is_dynamic} == model.dynamic
        assert all(grip.active for grip, *_ in model.grips)
        assert world.time == pytest.approx(model.time, abs=1e-9)
        after = self.shapes()
        assert all(np.isfinite(vertices).all() for vertices in after.values())
        if name in self.STILL:
            for body, vertices in before.items():
                np.testing.assert_array_equal(after[body], vertices, err_msg=f"{name} moved {body}")
        if name in ("step", "adopt"):
            for body in self.static():
                np.testing.assert_array_equal(after[body], before[body], err_msg=f"{name} moved {body}")
        for body in world.bodies:
            if body.is_dynamic:
                assert np.isfinite(body.velocities).all(), body.name


@pytest.mark.parametrize(("seed", "operations"), [(1, 100), (2, 100), pytest.param(3, 2000, marks=pytest.mark.slow)])
def test_random_operations(seed, operations):
    """Whatever is done in whatever order: the world agrees with the model, and stays finite."""
    fuzz = Fuzz(seed)
    for k in range(operations):
        try:
            fuzz.one()
        except Exception as error:
            raise AssertionError(f"seed {seed}, operation {k}, after {fuzz.counts}") from error
    assert set(fuzz.counts) >= {"add", "remove", "attach", "detach", "grip", "release", "step", "save"}
