"""Which joints make trees."""

import pytest

from nuno.tables.joint_trees import ANCHOR, find_trees


def carried(forest, pairs):
    """The body that each joint of a tree carries."""
    return [pairs[k][flipped] for k, flipped in zip(forest.joints, forest.flipped, strict=True)]


def check(pairs):
    """Find trees, and check that each body is a root or carried by one joint, whose carrier is its other body."""
    forest = find_trees(pairs)
    bodies = carried(forest, pairs)
    assert sorted([*forest.joints, *forest.lone]) == list(range(len(pairs)))
    assert len({*bodies, *forest.roots}) == len(bodies) + len(forest.roots)
    for t, (k, carrier) in enumerate(zip(forest.joints, forest.carriers, strict=True)):
        other = pairs[k][not forest.flipped[t]]
        if carrier < 0:
            assert other == ANCHOR
        else:
            assert other == [*bodies, *forest.roots][carrier]
            assert carrier < t or carrier >= len(bodies)  # those that carry come first
    return forest


def test_a_chain_hangs_on_what_is_static():
    """Its joints follow each other from there, in whatever order they were made."""
    forest = check([(2, 1), (1, ANCHOR), (2, 3)])
    assert forest.joints == [1, 0, 2]
    assert forest.carriers == [-1, 0, 1]
    assert forest.flipped == [False, False, True]
    assert forest.roots == forest.lone == []


def test_a_free_tree_has_the_body_with_most_joints_as_its_root():
    """A torso with two arms of two links."""
    forest = check([(1, 0), (2, 1), (3, 0), (4, 3), (5, 0)])
    assert forest.roots == [0]
    assert len(forest.joints) == 5


@pytest.mark.parametrize(
    "pairs",
    [
        [],
        [(0, ANCHOR)],
        [(0, 1)],
        [(0, 1), (0, 1)],
        [(0, 1), (1, 2), (2, 0)],
        [(0, ANCHOR), (1, 0), (1, ANCHOR)],
        [(0, ANCHOR), (0, ANCHOR)],
    ],
)
def test_loops_and_single_joints_are_in_no_tree(pairs):
    """Two ways to what is static are a loop, too."""
    assert find_trees(pairs).lone == list(range(len(pairs)))


def test_trees_and_loops_beside_each_other():
    """Each is what it is alone; a tree's joints keep their order."""
    forest = check([(0, ANCHOR), (4, 5), (1, 0), (5, 6), (7, 8), (6, 4), (9, 8)])
    assert forest.lone == [1, 3, 5]
    assert forest.joints == [0, 2, 4, 6]
    assert forest.roots == [8]
