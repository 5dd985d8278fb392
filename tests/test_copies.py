"""Copies of worlds are copies: all that random sequences of operations make, to the bit, now and later."""

import pytest

import nuno
from random_worlds import RandomWorld, differences, move, push, state_of, wrenches_of

SHORT, LONG = range(24), range(1000, 3000)
LONGEST = 4
"""Of the short ones, one that takes as many seconds as all others together."""
OPERATIONS = 22
"""Of a sequence: enough for bodies that come and go while others are held."""


def furnished(device):
    """A world with bodies of its own, which has run."""
    world = nuno.World(device=device, substeps=7)
    world.attach(world.add(nuno.box((0.2, 0.2, 0.2), name="own", position=(3.0, 1.0, 0.5))))
    world.add(nuno.sphere(0.1, position=(2.9, 1.0, 0.2)))
    world.attach(world.add(nuno.sheet((0.2, 0.2), (3, 3), position=(3.0, 1.0, 1.0))))
    world.run(0.05)
    return world


def copies_of(world, folder, device):
    """Ways to copy a world: by name, the world, and which of its worlds (None of a single one)."""
    saved, path = world.save(), folder / "world.npz"
    world.save(path)
    batch = world.imagine(3)
    ways = {"imagined, first": (batch, 0), "imagined, last": (batch, 2)}
    for name, other, source in (
        ("memory, empty world", nuno.World(device=device), saved),
        ("memory, another world", furnished(device), saved),
        ("file, empty world", nuno.World(device=device), path),
        ("file, another world", furnished(device), path),
    ):
        other.restore(source)
        ways[name] = (other, None)
    return saved, batch, ways


def check_copies(seed, folder, device):
    """Make a world by random operations, copy it in every way, and compare: at once, later, and after more of them.

    Returns:
        Names of operations that happened, and what differs.
    """
    # in the end something is under way
    scene = RandomWorld(seed, device=device).happen(OPERATIONS).do(push, move)
    world = scene.world
    seconds = float(scene.pick([2.0 / 60.0, 0.045, 5.0 / 60.0]))
    found = []

    def compare(what, ways, expected, extract=state_of):
        for name, (copy, k) in ways.items():
            found.extend(f"{name}, {what}: {each}" for each in differences(extract(copy, k), expected))

    here = state_of(world)
    saved, batch, ways = copies_of(world, folder, device)
    compare("at once", ways, here)
    compare("at once", {"the world itself": (world, None)}, here)
    try:
        world.run(seconds)
        later, borne = state_of(world), wrenches_of(world)
    except nuno.SimulationDiverged:
        return scene.log, found
    for copy in dict.fromkeys(copy for copy, _ in ways.values()):
        copy.run(seconds)
    compare("later", ways, later)
    compare("later", ways, borne, wrenches_of)

    # the same world, after more of everything: restored, and as one of its futures
    seeds = 100_000 + seed
    RandomWorld(seeds, world).happen(6)
    again = {"restored": (world, None)}
    world.restore(saved)
    compare("at once", again, here)
    world.run(seconds)
    compare("later", again, later)
    compare("later", again, borne, wrenches_of)
    RandomWorld(seeds, world).happen(3)
    world.adopt(batch, 1)
    adopted = {"adopted": (world, None)}
    compare("at once", adopted, later)

    # all go on alike under the same operations
    singles = {name: way for name, way in ways.items() if way[1] is None} | adopted
    logs = {name: RandomWorld(seeds, copy).happen(6).log for name, (copy, _) in singles.items()}
    assert len({tuple(log) for log in logs.values()}) == 1, logs
    try:
        world.run(seconds)
    except nuno.SimulationDiverged:
        return scene.log, found
    expected = state_of(world)
    for copy, _ in list(singles.values())[:-1]:
        copy.run(seconds)
    compare("after more operations", singles, expected)
    return scene.log, found


def check(seeds, folder, device):
    """Check many sequences; tell of all that differ, by seed."""
    wrong, happened = [], set()
    for seed in seeds:
        try:
            log, found = check_copies(seed, folder, device)
        except Exception as error:
            raise AssertionError(f"seed {seed}: {type(error).__name__}: {error}") from error
        happened |= set(log)
        if found:
            wrong.append(f"seed {seed} after {', '.join(log)}:\n    " + "\n    ".join(found[:8]))
    assert not wrong, f"{len(wrong)} of {len(seeds)} sequences\n" + "\n".join(wrong[:5])
    return happened


def test_copies_of_a_few_random_worlds(tmp_path):
    """Of the same, so many as take seconds."""
    assert "run" in check(SHORT[:2], tmp_path, "cpu")


@pytest.mark.long
def test_copies_of_random_worlds(tmp_path):
    """Imagined, adopted, restored here and elsewhere, from memory and files: equal now, later, and after more."""
    happened = check([seed for seed in SHORT[2:] if seed != LONGEST], tmp_path, "cpu")
    assert happened >= {"add", "attach", "detach", "attach_as_another", "grip", "weld", "push", "move", "locate", "run"}


@pytest.mark.slow
@pytest.mark.parametrize("seeds", [[LONGEST], *(range(start, start + 100) for start in LONG[::100])], ids=str)
def test_copies_of_many_random_worlds(seeds, tmp_path):
    """The same for thousands of sequences."""
    check(seeds, tmp_path, "cpu")


@pytest.mark.cuda
@pytest.mark.parametrize("start", range(0, 60, 5))
def test_copies_of_random_worlds_on_cuda(start, tmp_path):
    """The same on CUDA, where a world, a batch and a restored world are equal to the bit, too."""
    check(range(start, start + 5), tmp_path, "cuda:0")


@pytest.mark.cuda
@pytest.mark.slow
@pytest.mark.parametrize("start", range(LONG[0], LONG[-1], 100))
def test_copies_of_many_random_worlds_on_cuda(start, tmp_path):
    """The same for thousands of sequences on CUDA."""
    check(range(start, start + 100), tmp_path, "cuda:0")
