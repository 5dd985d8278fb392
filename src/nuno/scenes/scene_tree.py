"""Joints as trees: formats in which a body is a child of the one that it is joined to."""

from __future__ import annotations

from dataclasses import dataclass, field

from nuno.scenes.build_world import is_rigid
from nuno.scenes.scene_description import SceneDescription, SceneJoint


@dataclass(eq=False)
class JointTree:
    """A tree of bodies: each one's parent, and what is left for constraints.

    Attributes:
        parent: By the name of each rigid body its parent's, None: the world.
        joint: By the name of each child the joint that moves it; bodies without one are free.
        turned: Names of joints whose first body is the parent: they are the other way round.
        loops: Joints that close loops, and fixed ones.
    """

    parent: dict[str, str | None] = field(default_factory=dict)
    joint: dict[str, SceneJoint] = field(default_factory=dict)
    turned: set[str] = field(default_factory=set)
    loops: list[SceneJoint] = field(default_factory=list)

    def children(self, name: str | None) -> list[str]:
        """Return the names of a body's children, or of the world's, in the scene's order."""
        return [child for child, parent in self.parent.items() if parent == name]


def joint_tree(scene: SceneDescription) -> JointTree:
    """Return the trees of a scene's rigid bodies, which begin at what is static or at the first body of each island."""
    tree = JointTree()
    moving = {body.name for body in scene.bodies if is_rigid(body)}
    # ball joints last: those that close loops can be constraints, which hinges and sliders cannot
    left = sorted((joint for joint in scene.joints if joint.kind != "fixed"), key=lambda joint: joint.kind == "ball")
    tree.loops = [joint for joint in scene.joints if joint.kind == "fixed"]
    reached: set[str] = set()

    def grow() -> None:
        """Take joints from what is reached to what is not, until there are none."""
        grown = True
        while grown:
            grown = False
            for joint in list(left):
                ends = [joint.body, joint.other]
                inside = [end is None or end not in moving or end in reached for end in ends]
                if all(inside):
                    tree.loops.append(joint)
                elif any(inside):
                    child, parent = (ends[0], ends[1]) if inside[1] else (ends[1], ends[0])
                    assert child is not None
                    tree.parent[child], tree.joint[child] = parent, joint
                    if inside[0]:
                        tree.turned.add(joint.name)
                    reached.add(child)
                    grown = True
                else:
                    continue
                left.remove(joint)

    grow()
    for body in scene.bodies:
        if body.name in moving and body.name not in reached:
            tree.parent[body.name] = None
            reached.add(body.name)
            grow()
    return tree
