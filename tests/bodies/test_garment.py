"""Garments: what they are topologically, their measures, their symmetries, and how they hang."""

import numpy as np
import pytest
import trimesh

import nuno
from nuno import InvalidInputError, UnknownNameError
from nuno.mesh.crossings import crossing_faces
from nuno.mesh.garment_patterns import OPEN, PATTERNS, SEAM
from nuno.mesh.polygon import signed_area
from nuno.mesh.sewn import BACK, BOTH, FRONT, outline

# a sphere with h holes has 2 - h: neck, hem and two cuffs; waist and two legs; waist and hem; a leg; one layer: a disc
EULER = {"t-shirt": -2, "pullover": -2, "trousers": -1, "skirt": 0, "sock": 1, "apron": 1, "towel": 1}
LAYERS = {"apron": 1, "towel": 1}


@pytest.fixture(scope="module", params=list(PATTERNS))
def made(request):
    """A garment with coarse cells."""
    return nuno.garment(request.param, cell=0.04 if request.param != "sock" else 0.02)


def test_holes_are_those_of_the_garment(made):
    """Euler's characteristic; no edge has three faces; every vertex is used."""
    assert trimesh.Trimesh(made.vertices, made.faces, process=False).euler_number == EULER[made.name]
    edges = np.sort(np.concatenate([made.faces[:, [0, 1]], made.faces[:, [1, 2]], made.faces[:, [2, 0]]]), axis=1)
    assert np.unique(edges, axis=0, return_counts=True)[1].max() == 2
    assert len(np.unique(made.faces)) == len(made.vertices)
    assert made.layers == LAYERS.get(made.name, 2)


def test_cloth_is_as_large_as_its_panels(made):
    """Each layer's area is its outline's; where sides are round, that of chords: less than 2 % off at these cells."""
    draw, _ = PATTERNS[made.name]
    pattern = draw(made.measures)
    for layer, sides in enumerate(pattern.panels):
        corners = made.rest[made.faces[made.face_layer == layer]][..., :2]
        area = sum(abs(signed_area(corner)) for corner in corners)
        round_sides = any(len(line) > 2 for line, _ in sides)
        wanted = abs(signed_area(outline(sides, pattern.mirrored)))
        assert area == pytest.approx(wanted, rel=0.02 if round_sides else 1e-9)


def test_seams_are_as_long_on_both_layers(made):
    """What is sewn is shared: a seam's edges are in a front and a back face, and as long as the pattern's lines."""
    if made.layers == 1:
        assert (made.layer == FRONT).all()
        return
    sides = {FRONT: set(), BACK: set()}
    for layer, edges in sides.items():
        for face in made.faces[made.face_layer == layer]:
            edges |= {tuple(sorted((int(face[k]), int(face[k - 1])))) for k in range(3)}
    sewn = sides[FRONT] & sides[BACK]
    length = sum(np.linalg.norm(made.rest[a] - made.rest[b]) for a, b in sewn)
    draw, _ = PATTERNS[made.name]
    pattern = draw(made.measures)
    for panel in pattern.panels:
        lines = [line for line, kind in panel if kind == SEAM]
        wanted = sum(np.linalg.norm(np.diff(line, axis=0), axis=1).sum() for line in lines)
        wanted *= 2 if pattern.mirrored else 1
        # round heels and toes: chords of cells this size are up to 3 % shorter
        assert length == pytest.approx(wanted, rel=0.03 if any(len(line) > 2 for line in lines) else 1e-9)
        assert any(kind == OPEN for _, kind in panel)
    assert set(np.flatnonzero(made.layer == BOTH)) == {v for edge in sewn for v in edge}


def test_symmetries_map_the_garment_onto_itself(made):
    """Each permutation keeps the set of faces, but for the direction they look in, and lengths, to rounding."""
    faces = {tuple(sorted(face)) for face in made.faces.tolist()}
    for one in made.symmetries:
        assert sorted(one) == list(range(len(made.vertices)))
        assert {tuple(sorted(int(one[v]) for v in face)) for face in made.faces} == faces
        np.testing.assert_allclose(np.abs(made.rest[one, 0]), np.abs(made.rest[:, 0]), atol=1e-9)
        np.testing.assert_allclose(made.rest[one, 1], made.rest[:, 1], atol=1e-9)
    wanted = {"t-shirt": 2, "pullover": 2, "trousers": 4, "skirt": 4, "sock": 2, "apron": 2, "towel": 2}
    assert len(made.symmetries) == wanted[made.name]


def test_cells_are_good(made):
    """The mean ratio of the worst triangle is that of angles above about 25 degrees."""
    assert made.quality.min() > 0.5 and np.median(made.quality) > 0.85


def test_ways_lead_over_the_cloth():
    """Down a skirt's middle it is its length; to the same place behind, over the nearer of the waist's seams.

    A skirt as wide at the hem as at the waist is a flattened tube: from the middle of its front half round to the back.
    Ways along edges are longer than straight ones, by less than 15 %.
    """
    skirt = nuno.garment("skirt", length=0.5, waist=0.4, hem=0.4, cell=0.025)
    top, below = skirt.nearest((0.0, 0.25), "front"), skirt.nearest((0.0, -0.25), "front")
    behind = skirt.nearest((0.0, 0.25), "back")
    away = skirt.distances(top)
    assert 0.5 - 1e-9 <= away[below] < 0.5 * 1.15
    assert 0.4 - 1e-9 <= away[behind] < 0.4 * 1.15
    assert away[top] == 0.0 and skirt.layer[behind] == BACK
    np.testing.assert_allclose(skirt.distances([top, below])[0], away)


def test_names_and_measures_are_checked():
    """A wrong name is answered with those that there are; measures that make no outline are refused by name."""
    with pytest.raises(UnknownNameError, match=r"sock.*did you mean 't-shirt'"):
        nuno.garment("tshirt")
    with pytest.raises(UnknownNameError, match="sleeve_width"):
        nuno.garment("t-shirt", sleve=0.2)
    with pytest.raises(InvalidInputError, match="make no"):
        nuno.garment("t-shirt", front_neck=1.0)  # below the hem
    for wrong in ({"length": -1.0}, {"length": np.nan}, {"cell": 0.0}, {"cell": 1e-5}, {"gap": -1.0}):
        with pytest.raises(InvalidInputError):
            nuno.garment("skirt", **wrong)
    sock = nuno.garment("sock", cell=0.03)
    for wrong in (-1, len(sock.vertices), 1.5, []):
        with pytest.raises(InvalidInputError):
            sock.distances(wrong)
    with pytest.raises(InvalidInputError, match="one layer"):
        nuno.garment("towel", cell=0.05).nearest((0, 0), "back")
    with pytest.raises(InvalidInputError, match="layer must be"):
        sock.nearest((0, 0), "inside")


@pytest.mark.long
@pytest.mark.parametrize("name", ["t-shirt", "trousers", "sock"])
def test_hung_garments_do_not_cross_themselves(name):
    """From points of the front, a seam and the back: at rest after 4 s, no triangle passes through another.

    The exact count of crossing faces is 0. Nothing tears: edges are no longer than the cloth's stiffness explains
    beside the one vertex that bears all, which is less than a third with so few steps.
    """
    garment = nuno.garment(name, cell=0.02 if name == "sock" else 0.05)
    held = [int(np.flatnonzero(garment.layer == layer)[0]) for layer in (FRONT, BOTH, BACK)]
    holds = nuno.imagine_holds(garment, candidates=held, guesses=[nuno.HoldGuess(5e-5)], device="cpu", progress=False)
    assert holds.finite.all()
    edges = np.concatenate([garment.faces[:, [0, 1]], garment.faces[:, [1, 2]]])
    rest = np.linalg.norm(np.diff(garment.rest[edges], axis=1)[:, 0], axis=1)
    for k, vertex in enumerate(held):
        hanging = holds.positions[0, k].astype(float)
        assert len(crossing_faces(hanging, garment.faces)) == 0
        np.testing.assert_allclose(hanging[vertex], 0.0, atol=1e-5)
        # it hangs: its middle is straight below the hand, to a cell, for nothing else holds it
        assert np.linalg.norm(hanging.mean(axis=0)[:2]) < 0.05 and hanging[:, 2].mean() < -0.05
        strain = np.linalg.norm(np.diff(hanging[edges], axis=1)[:, 0], axis=1) / rest - 1.0
        assert np.quantile(strain, 0.99) < 0.1 and strain.max() < 0.35
