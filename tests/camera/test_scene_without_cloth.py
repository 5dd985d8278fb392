"""The cloth's shadow on the table, told from a cloth that is as dark."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from nuno.camera.scene_without_cloth import compare

TABLE = np.array([82.0, 86.0, 92.0])
SHADOW = 0.4  # of the light is left
CLOTH = np.array([150.0, 162.0, 162.0])
OWN_SHADE = 0.34  # a light cloth in its own shade, as bright as the table at 0.62 of its light


def scene(*, cloth: bool, texture: float = 0.05) -> tuple[np.ndarray, ...]:
    """Images before and after, the cloth's mask before, and the whole picture as the table.

    The table has streaks some 20 px wide and no finer texture. After the lift a shadow lies on it, and, if asked
    for, a larger even patch of the cloth in its own shade.
    """
    rng = np.random.default_rng(3)
    streaks = cv2.GaussianBlur(rng.normal(size=(240, 320)), (0, 0), 30.0, sigmaY=7.0)
    table = TABLE * (1.0 + texture * streaks / streaks.std())[..., None]
    mask = np.zeros((240, 320), dtype=bool)
    mask[130:200, 60:160] = True
    before, after = np.where(mask[..., None], CLOTH, table), table.copy()
    after[150:215, 175:260] *= SHADOW
    if cloth:
        after[20:140, 80:190] = OWN_SHADE * CLOTH
    images = [np.clip(np.round(x + rng.normal(0.0, 3.0, x.shape)), 0, 255).astype(np.uint8) for x in (before, after)]
    return images[0], images[1], mask, np.ones_like(mask)


@pytest.mark.parametrize("cloth", [False, True])
def test_shadow_is_told_from_a_cloth_as_dark_by_the_table_under_it(cloth: bool) -> None:
    """The table's streaks go on in a shadow, and not on a cloth in its own shade that is as dark as one."""
    before, after, mask, everywhere = scene(cloth=cloth)
    found = compare(before, after, mask, everywhere, np.zeros_like(mask) | (np.arange(320) < 280)).shades
    # The shares are counted in hundredths, and the median of a bright or dark streak is 0.01 off.
    assert found == pytest.approx((SHADOW,), abs=0.02)


def test_a_cloth_alone_is_no_shadow() -> None:
    """An even patch as dark as a shadow is none where the table's streaks do not go on in it."""
    before, after, mask, everywhere = scene(cloth=True)
    after[150:215, 175:260] = before[150:215, 175:260]
    found = compare(before, after, mask, everywhere, np.zeros_like(mask) | (np.arange(320) < 280)).shades
    assert found == ()


def test_shadow_on_an_even_table_is_told_by_its_tint() -> None:
    """Without any texture, what has the table's tint and not the cloth's is a shadow."""
    before, after, mask, everywhere = scene(cloth=False, texture=0.0)
    before[mask] = (170, 60, 50)
    found = compare(before, after, mask, everywhere, np.zeros_like(mask) | (np.arange(320) < 280)).shades
    assert found == pytest.approx((SHADOW,), abs=0.02)


def test_two_lamps_cast_two_shadows() -> None:
    """Each lamp's shadow has a darkness of its own."""
    before, after, mask, everywhere = scene(cloth=False, texture=0.0)
    before[mask] = (170, 60, 50)
    after[20:100, 175:260] = np.round(0.7 * before[20:100, 175:260].astype(float)).astype(np.uint8)
    found = compare(before, after, mask, everywhere, np.zeros_like(mask) | (np.arange(320) < 280)).shades
    assert sorted(found) == pytest.approx([SHADOW, 0.7], abs=0.02)
