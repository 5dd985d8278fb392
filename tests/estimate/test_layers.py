"""Layers of folded sheets whose shape is known."""

import numpy as np
import pytest

from nuno import InvalidInputError, find_layers

STEP = 0.01  # [m] of the grid


def folded(times):
    """A sheet of 1 x 0.6 m folded in half along x, several times, 1 mm a layer: vertices, faces, (u, v)."""
    nx, ny = 40, 12
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, nx + 1), np.linspace(0, 1, ny + 1)))
    x, z, length = u.copy(), np.zeros_like(u), 1.0
    for turn in range(times):
        length /= 2
        over = x > length + 1e-9
        # the upper half is mirrored, its layers in the opposite order
        z = np.where(over, 1e-3 * 2 ** (turn + 1) - 1e-3 - z, z)
        x = np.where(over, 2 * length - x, x)
    corner = (np.arange(ny)[:, None] * (nx + 1) + np.arange(nx)).ravel()
    a, b, c, d = corner, corner + 1, corner + nx + 1, corner + nx + 2
    faces = np.concatenate([np.stack([a, b, d], 1), np.stack([a, d, c], 1)])
    return np.stack([x, 0.6 * v, z], axis=1), faces, np.stack([u, v], axis=1)


@pytest.mark.parametrize(("times", "layers"), [(0, 1), (1, 2), (2, 4)])
def test_areas_of_folds_in_half(times, layers):
    """Folded n times, 2^n layers lie over 1 / 2^n of the area; off by at most a grid step along the border."""
    found = find_layers(*folded(times), step=STEP)
    assert found.count.max() == layers
    length = 1.0 / layers
    assert found.area[-1] == pytest.approx(0.6 * length, abs=2 * STEP * (0.6 + length))
    assert sum(found.area[:-1]) < 2 * STEP * 0.6 * layers  # single layers at the folds only


def test_what_lies_over_a_point():
    """Over (u, v) of a sheet folded in half lies (1 - u, v), turned over, to the grid's step."""
    found = find_layers(*folded(1), step=STEP)
    (over,) = found.over(0.3, 0.5)
    np.testing.assert_allclose(over, (0.7, 0.5), atol=2 * STEP)
    assert found.over(0.7, 0.5) == []  # the upper layer
    two = found.count == 2
    assert not found.upward[two, 0].any() and found.upward[two, 1].all()
    np.testing.assert_allclose(found.height[two], np.broadcast_to((1e-3, 0.0), (two.sum(), 2)), atol=1e-3)


def test_the_order_of_four_layers():
    """Folded twice, the quarters lie, from the top, in the order 2, 3, 4, 1, as paper does."""
    found = find_layers(*folded(2), step=STEP)
    row, column = np.argwhere(found.count == 4)[len(np.argwhere(found.count == 4)) // 2]
    quarters = np.floor(found.material[row, column, :, 0] * 4).astype(int) + 1
    np.testing.assert_array_equal(quarters, (2, 3, 4, 1))


def test_the_picture():
    """It can be drawn, without a display."""
    figure = find_layers(*folded(1), step=0.02).figure()
    figure.canvas.draw()
    assert len(figure.axes) == 3  # two maps and a colour bar


def test_the_picture_of_the_cloth():
    """Folded twice, its quarters have the colours of their layers; no other part is as large as a tenth of it."""
    right = find_layers(*folded(2), step=STEP).figure().axes[1]
    shades = {text.get_text(): patch.get_facecolor()[:3] for text, patch in
              zip(right.get_legend().get_texts(), right.get_legend().get_patches(), strict=True)}  # fmt: skip
    picture = np.asarray(right.images[0].get_array())
    quarters = ("under 3", "seen from above, turned over", "under 1", "under 2, turned over")
    for k, name in enumerate(quarters):
        alike = (np.abs(picture - shades[name]) < 0.01).all(axis=-1)
        middle = alike[:, (2 * k + 1) * alike.shape[1] // 8]
        assert middle.all() and 0.2 < alike.mean() < 0.3, name


@pytest.mark.parametrize("step", [0.0, -1.0, np.nan, 1e-6])
def test_a_bad_step(step):
    """Not positive, or so fine that the grid would not fit into memory."""
    with pytest.raises(InvalidInputError, match="step"):
        find_layers(*folded(1), step=step)


def test_bad_vertices():
    """A vertex that is not finite is named."""
    vertices, faces, uv = folded(0)
    vertices[3] = np.nan
    with pytest.raises(InvalidInputError, match="finite"):
        find_layers(vertices, faces, uv)
