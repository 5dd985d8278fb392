"""Two robots in one world: links that stand inside each other are told when the second comes."""

import numpy as np
import pytest
from lifter import lifter_in

import nuno
from nuno.robot.overlapping_robots import overlapping_links


def lifters(folder, aside, **options):
    """Return two lifters, the second ``aside`` (3,) [m]: their palms are 0.04 x 0.2 x 0.02 m, their pads 0.03 wide."""
    world = nuno.World(device="cpu")
    first = lifter_in(folder, world, **options)
    model = nuno.Humanoid("lifter", robots=folder / "robots.toml")
    model.translate(np.add((0.0, 0.0, 1.0), aside))
    return first, nuno.SimulatedRobot(model, world, **options)


@pytest.mark.parametrize("dynamics", [False, True])
@pytest.mark.parametrize(
    ("aside", "links"),
    [
        ((0.0295, 0.0, 0.0), {"palm", "a", "b"}), ((0.0305, 0.0, 0.0), {"palm"}), ((0.0405, 0.0, 0.0), set()),
        ((0.0, 0.0, 0.5), set()),
    ],
)  # fmt: skip
def test_links_inside_each_other_are_told_once_by_name(tmp_path, caplog, aside, links, dynamics):
    """Boxes overlap as far as they are wide, half a millimetre more or less; what is apart is not told."""
    first, second = lifters(tmp_path, aside, dynamics=dynamics)
    pairs = overlapping_links(second.links, first.links)
    assert {(b.name, a.name) for a, b in pairs} == {(f"lifter/{name}", f"lifter/{name}_1") for name in links}
    told = [record.getMessage() for record in caplog.records]
    assert len(told) == (1 if links else 0)
    if links:
        assert f"{len(links)} pair" in told[0] and "'lifter/palm_1' in 'lifter/palm'" in told[0] and "set_up" in told[0]


def test_links_that_cannot_touch_are_not_told(tmp_path):
    """Groups that exclude each other let robots stand in one place on purpose."""
    first, second = lifters(tmp_path, (0.01, 0.0, 0.0))
    for body in second.links.bodies:
        body.group, body.collides_with = 2, 2
    assert overlapping_links(second.links, first.links) == []


def test_copies_of_several_robots_are_reached_by_drivers(tmp_path):
    """`futures.robot` is refused by name; `drivers` has the copies in the order in which the robots came."""
    first, second = lifters(tmp_path, (1.0, 0.0, 0.0))
    world = first.world
    futures = world.imagine(2)
    with pytest.raises(nuno.BodyStateError, match=r"drivers\[k\]"):
        _ = futures.robot
    futures.drivers[1].angle_vector({"lift": [0.1, 0.2]}, 0.5)
    futures.run(0.6)
    world.adopt(futures, 1)
    lift = second.actual.joint_index("lift")
    assert second.actual.angle_vector()[lift] == pytest.approx(0.2, abs=1e-6)
    assert first.actual.angle_vector()[lift] == 0.0
