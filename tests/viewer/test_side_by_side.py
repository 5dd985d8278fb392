"""Films side by side."""

import numpy as np
import pytest

import nuno
from nuno.viewer.side_by_side import side_by_side


def falling(seconds=0.1, floor=True):
    """Return a film of a ball that falls beside a still box."""
    world = nuno.World(device="cpu")
    if floor:
        world.add(nuno.plane(name="floor"))
    world.add(nuno.box((0.2, 0.2, 0.2), name="box", position=(0.4, 0, 0.1)))
    world.attach(world.add(nuno.sphere(0.1, name="ball", position=(0, 0, 0.5))))
    return nuno.Film.of(nuno.Recording.of(world, seconds))


def test_the_second_film_stands_beside_the_first():
    """All of it is moved along x by the width and a quarter, and nothing overlaps; the floor is drawn once."""
    films = [falling(), falling()]
    whole = side_by_side(films, ("left", "right"))
    assert len(whole) == len(films[0]) and whole.duration == pytest.approx(0.1)
    tracks = {track.obj.path: track for track in whole._tracks.values()}
    assert set(tracks) == {("left", "floor"), ("left", "box"), ("left", "ball"), ("right", "box"), ("right", "ball")}
    right, left = (tracks[side, "box"].poses[0][:3] for side in ("right", "left"))
    step = right - left
    width = 0.5 + 0.1  # from the box's far side to the ball's, 0.1 m about the origin
    assert step == pytest.approx([1.25 * width, 0, 0], abs=0.1 * width)  # a ball's bounds are taken by its radius


def test_films_of_different_lengths_are_refused():
    """There would be frames in which one of them has nothing to show."""
    with pytest.raises(nuno.InvalidInputError, match="one length"):
        side_by_side([falling(), falling(0.2)], ("a", "b"))
    with pytest.raises(nuno.InvalidInputError, match="a name for each"):
        side_by_side([falling()], ("a", "b"))


def test_a_film_side_by_side_is_saved(tmp_path):
    """The page of the whole is one file."""
    film = side_by_side([falling(), falling()], ("a", "b"))
    film.save(tmp_path / "both.html", title="a | b")
    assert "a | b" in (tmp_path / "both.html").read_text(encoding="utf-8")
    assert np.isfinite(film.times).all()
