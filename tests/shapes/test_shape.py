"""Shapes by formula: their numbers against their triangles, and that nothing else lists their kinds."""

import numpy as np
import pytest

from nuno.contact.particle.distances import FORMULAS
from nuno.shapes.shape import Box, Capsule, Cylinder, Hull, Plane, Shape, Sheet, Sphere
from nuno.shapes.soft_shape import SoftBox
from nuno.world.snapshot_file import TYPES

BOUNDED = (Box((0.3, 0.2, 0.1)), Sphere(0.1), Cylinder(0.1, 0.3), Capsule(0.1, 0.3))


def kinds_of(root):
    """Return all classes below one."""
    return {each for kind in root.__subclasses__() for each in (kind, *kinds_of(kind))}


@pytest.mark.parametrize("shape", BOUNDED, ids=lambda shape: shape.kind)
def test_a_formula_reaches_as_far_as_the_farthest_vertex(shape):
    """The outermost vertices of each of these meshes lie on the shape itself, and so at the reach but for rounding."""
    assert shape.formula.reach == pytest.approx(np.linalg.norm(shape.mesh()[0], axis=1).max(), rel=1e-12)
    assert shape.mesh()[0] is shape.mesh()[0]
    assert not shape.mesh()[0].flags.writeable


def test_contacts_have_the_formula_of_each_shape_with_numbers_for_one():
    """Each kind that has numbers has a formula, and only those."""
    assert set(FORMULAS) == {shape.kind for shape in (*BOUNDED, Plane())}
    assert {kind.kind for kind in kinds_of(Shape) if kind.formula is not Shape.formula} == set(FORMULAS)
    assert Sheet((0.1, 0.1), (2, 2)).formula is None
    assert Hull.of(np.eye(4, 3)).formula is None
    assert SoftBox((0.1, 0.1, 0.1), (2, 2, 2)).formula is None


def test_files_of_worlds_know_every_shape():
    """A saved world may have any kind of body: its class is found by name."""
    own = {kind for kind in kinds_of(Shape) if kind.__module__.startswith("nuno.")}
    assert {kind.__name__ for kind in own} <= set(TYPES)
