"""Which body is a child of which."""

import numpy as np

import nuno
from nuno.scenes.describe_world import describe_world
from nuno.scenes.scene_tree import joint_tree


def row_of_boxes(count):
    """Return a world with boxes in a row, all of which move."""
    world = nuno.World(device="cpu")
    boxes = [world.add(nuno.box((0.1, 0.1, 0.1), name=f"b{k}", position=(0.2 * k, 0, 1))) for k in range(count)]
    for each in boxes:
        world.attach(each)
    return world, boxes


def test_a_chain_begins_at_what_stands_still():
    """Whichever way round its joints are."""
    world, (a, b, c) = row_of_boxes(3)
    nuno.hinge(b, a, point=(0.1, 0, 1), axis=(0, 1, 0))
    nuno.hinge(b, c, point=(0.3, 0, 1), axis=(0, 1, 0))
    nuno.hinge(c, None, point=(0.5, 0, 1), axis=(0, 1, 0))
    scene = describe_world(world)
    tree = joint_tree(scene)
    assert tree.parent == {"b2": None, "b1": "b2", "b0": "b1"} and not tree.loops
    assert tree.turned == {joint.name for joint in scene.joints if joint.body == "b1" and joint.other == "b0"}


def test_a_loop_is_closed_by_a_constraint():
    """One of the joints of a ring of four is left; what is free begins at the first body."""
    world, boxes = row_of_boxes(4)
    for k in range(4):
        nuno.ball_joint(
            boxes[k], boxes[(k + 1) % 4], point=np.mean([boxes[k].position, boxes[(k + 1) % 4].position], axis=0)
        )
    tree = joint_tree(describe_world(world))
    assert tree.parent["b0"] is None and len(tree.joint) == 3 and len(tree.loops) == 1
