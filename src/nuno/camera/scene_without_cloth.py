"""The scene as it looks without the cloth: as it was before, or in the cloth's shadow."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from nuno.camera.regions import grow, shrink
from nuno.camera.surface_colours import COLOUR_VOLUME, Illumination, brightness, normal_density, palette, shaded_density

_BLUR = 0.8  # [px] both images are smoothed by this before they are compared pixel by pixel
_SHADE = (0.2, 0.93)  # a shadow leaves between these shares of the light
_LIGHT = (0.12, 1.3)  # a lifted cloth shows from this to this share of the light it had when flat
_TABLES_TINT = 0.85  # [nats] the tint of a pixel that got darker speaks for the table by more than this, or does not
_ODDS = 3.0  # [nats] 20 to 1 that coarse texture is the table's, or is not
_UNKNOWN = 0.01 / COLOUR_VOLUME  # density of something else entirely: a reflection, a cable


@dataclass(frozen=True)
class Background:
    """The image before as a model of what is seen beside the cloth in the image after.

    Attributes:
        view: (h, w, 3) float32, the image after in the light of the image before, slightly smoothed.
        scene: (h, w, 3) float32, the image before, smoothed alike; where the cloth was, the table's smooth
            colour.
        hidden: (h, w) bool, where the cloth hid the table.
        table: (h, w) bool, the table's top.
        colours: (k, 3) float32, the table's colours relative to its smooth colour.
        shares: (k,) float32, how common they are.
        noise: Standard deviation of a channel of view - scene where nothing changed [levels].
        grain: (h, w) float32, logarithm of how much better the background's fine texture explains the view
            than the cloth's does.
        cloth: (h, w) float32, the probability density of the view's colours where the cloth is.
        shades: The shares of the light that the cloth's shadows leave on the table: none where no shadow was
            found, two of two lamps.
    """

    view: np.ndarray
    scene: np.ndarray
    hidden: np.ndarray
    table: np.ndarray
    colours: np.ndarray
    shares: np.ndarray
    noise: float
    grain: np.ndarray
    cloth: np.ndarray
    shades: tuple[float, ...]

    def density(self) -> np.ndarray:
        """(h, w) float32, the probability density of the view's colours where the cloth is not."""
        grey = brightness(self.scene)
        slope2 = cv2.Sobel(grey, -1, 1, 0, scale=0.125) ** 2 + cv2.Sobel(grey, -1, 0, 1, scale=0.125) ** 2
        # Where the scene has edges, a third of a pixel of shake or rounding is no change.
        noise2 = (np.float32(self.noise**2) + np.float32(0.1) * slope2)[..., None]
        total = self._mixture(self.view, self.scene, noise2, 0.008, self.table)
        if self.hidden.any():
            view, smooth = self.view[self.hidden], self.scene[self.hidden]
            even = np.full((1, 1), self.noise**2, dtype=np.float32)
            total[self.hidden] = sum(
                share * self._mixture(view, smooth * colour, even, 0.04, np.ones(len(view), dtype=bool))
                for colour, share in zip(self.colours, self.shares, strict=True)
            )
        return total * np.exp(self.grain) + _UNKNOWN

    def _mixture(
        self, view: np.ndarray, colour: np.ndarray, noise2: np.ndarray, variation: float, table: np.ndarray
    ) -> np.ndarray:
        """Density of the view if the colour is lit, in the usual shadow on the table, or in some shadow."""
        usual, some = (0.25, 0.05) if self.shades else (0.0, 0.15)
        at = np.where(table, 1.0, 0.25).astype(np.float32)  # a shadow falls on the table first
        total = (1.0 - at * (usual + some)) * normal_density(view, colour, noise2 + (variation * colour) ** 2)
        total += at * some * shaded_density(view, colour, self.noise, *_SHADE)
        for shade in self.shades:
            shaded = np.float32(shade) * colour
            variance = noise2 + ((variation + 0.02) * shaded) ** 2
            total += at * (usual / len(self.shades)) * normal_density(view, shaded, variance)
        return total


def compare(
    before: np.ndarray, after: np.ndarray, mask: np.ndarray, table: np.ndarray, reach: np.ndarray
) -> Background:
    """Model the background of the image after from the image before.

    Args:
        before: (h, w, 3) uint8.
        after: (h, w, 3) uint8.
        mask: (h, w) bool, the cloth before.
        table: (h, w) bool, the table's top.
        reach: (h, w) bool, where the cloth may be after; elsewhere nothing changes but the light.
    """
    hidden = grow(mask, 3)
    first = cv2.GaussianBlur(before, (0, 0), _BLUR).astype(np.float32)
    second = cv2.GaussianBlur(after, (0, 0), _BLUR).astype(np.float32)
    still = ~(reach | hidden)
    gains, noise = _gains(first, second, still if still.mean() > 0.1 else ~hidden)
    view = second / gains
    ring = grow(hidden, 20) & ~hidden
    ring = ring & table if (ring & table).sum() > 100 else ring
    if ring.sum() < 100:
        ring = ~hidden
    every = (slice(None, None, 2), slice(None, None, 2))
    light = Illumination(first[every], ring[every].astype(float), full_shape=mask.shape, degree=1)
    field = light.field((slice(0, mask.shape[0]), slice(0, mask.shape[1])))
    colours, shares = palette(first[ring] / field[ring], 5)
    scene = np.where(hidden[..., None], field, first)
    inside = shrink(mask, 3)
    grain = _grain(first, view, scene, hidden, ring, inside if inside.any() else mask)
    cloth = _cloth(before, inside if inside.any() else mask, view, noise)
    darkest = float(colours[shares > 0.03].mean(axis=-1).min(initial=1.0))
    limit = np.where(hidden, np.float32(0.9 * darkest), np.float32(0.9))
    shades = _shades(view, scene, grain, cloth, table, noise, limit, table & ~hidden)
    return Background(view, scene, hidden, table, colours, shares, noise, grain, cloth, shades)


def _cloth(before: np.ndarray, where: np.ndarray, view: np.ndarray, noise: float) -> np.ndarray:
    """Density (h, w) of the view's colours if it shows what was ``where`` (h, w) before, in more or less light."""
    colours, shares = palette(before[where].astype(np.float32), 6)
    found = sum(
        share * shaded_density(view, colour, noise, *_LIGHT) for colour, share in zip(colours, shares, strict=True)
    )
    return np.asarray(found + np.float32(0.02 / COLOUR_VOLUME))


def _gains(first: np.ndarray, second: np.ndarray, use: np.ndarray) -> tuple[np.ndarray, float]:
    """Gains (3,) of the channels where nothing but the light changed, and the noise that is left."""
    every = (slice(None, None, 4), slice(None, None, 4))
    a, b = first[every][use[every]], second[every][use[every]]
    exposed = (a.min(axis=-1) > 15) & (a.max(axis=-1) < 245) & (b.max(axis=-1) < 250)
    a, b = a[exposed], b[exposed]
    if len(a) < 100:
        return np.ones(3, dtype=np.float32), 3.0
    ratio = b / a
    gains = np.median(ratio, axis=0)
    if not (gains > 0.0).all():  # a channel that is black in the second image: nothing tells its light
        return np.ones(3, dtype=np.float32), 3.0
    for _ in range(3):
        same = (np.abs(ratio / gains - 1.0) < 0.1).all(axis=-1)
        if same.sum() < 100:
            break
        gains = np.median(ratio[same], axis=0)
    noise = 1.48 * float(np.median(np.abs(b / gains - a)))
    return gains.astype(np.float32), float(np.clip(noise, 1.0, 8.0))


def _grain(
    first: np.ndarray,
    view: np.ndarray,
    scene: np.ndarray,
    hidden: np.ndarray,
    ring: np.ndarray,
    cloth: np.ndarray,
) -> np.ndarray:
    """Evidence (h, w) of fine texture for the background.

    A shadow darkens a table's speckles but leaves them; a cloth covers them. Where the table was hidden, only
    how strong its texture is can be compared, not the texture itself.
    """
    now = brightness(view)
    smooth_now = cv2.blur(now, (7, 7))
    detail_now = now - smooth_now
    old = brightness(first)
    smooth_old = cv2.blur(old, (7, 7))
    detail_old = old - smooth_old
    level = np.where(hidden, cv2.blur(brightness(scene), (7, 7)), smooth_old)
    share = np.clip(smooth_now / np.maximum(level, 8.0), 0.15, 1.3)
    noise2 = np.float32(max(1.48 * float(np.median(np.abs(detail_now - detail_old)[~hidden])), 0.5) ** 2)
    table2, cloth2 = float(detail_old[ring].var()), float(detail_old[cloth].var())
    expected = share * detail_old
    width2 = noise2 + (0.1 * expected) ** 2
    cloth_width2 = noise2 + share * share * cloth2
    evidence = np.log(_heavy_tailed(detail_now - expected, width2) / _heavy_tailed(detail_now, cloth_width2))
    roughness = [np.abs(detail_old[where]) / np.maximum(smooth_old[where], 8.0) for where in (ring, cloth)]
    found = np.abs(detail_now[hidden]) / np.maximum(smooth_now[hidden], 8.0)
    noise = np.sqrt(noise2) / np.maximum(smooth_now[hidden], 8.0)
    evidence[hidden] = _roughness_ratio(found, noise, *roughness)
    # At an outline, of the cloth or of a shadow, the step is neither surface's texture.
    outline = np.abs(detail_now) > 4.0 * np.sqrt(np.maximum(cloth_width2, noise2 + share * share * table2))
    evidence[cv2.dilate(outline.astype(np.uint8), np.ones((5, 5), np.uint8)).astype(bool)] = 0.0
    return np.clip(evidence, -2.5, 2.5)


def _heavy_tailed(offset: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """Density of an offset: normal, with a tenth spread over 60 levels."""
    return 0.9 * np.exp(-0.5 * offset * offset / variance) / np.sqrt(2 * np.pi * variance) + np.float32(0.1 / 60.0)


def _roughness_ratio(found: np.ndarray, noise: np.ndarray, table: np.ndarray, cloth: np.ndarray) -> np.ndarray:
    """Logarithm (k,) of how much likelier a relative roughness is for the table than for the cloth.

    Args:
        found: (k,) float, fine texture relative to brightness.
        noise: (k,) float, the part of it that noise makes up; it grows in the shade.
        table: (m,) float, samples of the table's, in full light.
        cloth: (n,) float, samples of the cloth's, in full light.
    """
    bins = np.concatenate([np.linspace(0.0, 0.06, 13), [0.075, 0.1, 0.14, 0.2, 0.3, np.inf]])
    evidence = np.zeros(len(found), dtype=np.float32)
    lowest = float(noise.min(initial=np.inf))
    for low, high in ((0.0, 0.014), (0.014, 0.025), (0.025, np.inf)):
        at = (noise >= low) & (noise < high)
        if not at.any():
            continue
        more = max(float(np.median(noise[at])) ** 2 - lowest**2, 0.0) * 0.5
        counts = [np.histogram(np.sqrt(x * x + more), bins)[0] for x in (table, cloth)]
        shares = [np.convolve(c, [0.25, 0.5, 0.25], "same") / max(c.sum(), 1) + 0.01 for c in counts]
        ratio = np.log(shares[0] / shares[1])
        evidence[at] = ratio[np.clip(np.searchsorted(bins, found[at], "right") - 1, 0, len(bins) - 2)]
    return evidence


def _shades(
    view: np.ndarray, scene: np.ndarray, grain: np.ndarray, cloth: np.ndarray, where: np.ndarray, noise: float,
    limit: np.ndarray, seen: np.ndarray,
) -> tuple[float, ...]:  # fmt: skip
    """The shares of light in the cloth's shadows on the table, two at most.

    A lamp's shadow is equally dark all over an even table and leaves its tint and its texture; a cloth has its own
    colour and shading, and not the table's texture. So the ratios of the pixels that got darker are counted for a
    shadow where tint and fine texture are the table's, and against it where they are not. Only ratios under ``limit``
    (h, w) count: a speckle of the table is no shadow. Coarse texture, of the size of wood's grain, decides where the
    table was ``seen`` (h, w) before: a share that it speaks against is no shadow's, and one that it speaks for needs
    neither tint nor fine texture.
    """
    grey, dimmed = brightness(scene), brightness(view)
    where = where & (grey > 15) & (dimmed < (limit + 0.05) * grey) & (dimmed > 0.9 * _SHADE[0] * grey)
    first, second = scene[where], view[where]
    length2 = (first * first).sum(axis=-1)
    share = (first * second).sum(axis=-1) / np.maximum(length2, 1.0)
    across = (second * second).sum(axis=-1) - share * share * length2
    dark = (share > _SHADE[0]) & (share < limit[where]) & (across < (3 * noise) ** 2 + 0.03**2 * length2)
    if dark.sum() < 60:
        return ()
    shares = share[dark]
    tint = np.log(shaded_density(second[dark], first[dark], noise, *_SHADE) + 1e-12) - np.log(cloth[where][dark])
    weights = np.clip(cv2.blur(grain, (7, 7))[where][dark], -1.0, 1.0) + np.clip(2.0 * (tint - _TABLES_TINT), -1.0, 1.0)
    # Texture is compared where most pixels count: others as dark show a cloth of another tint.
    counted = np.zeros(where.shape, dtype=np.float32)
    counted[where] = dark
    seen = (seen & (cv2.blur(counted, (5, 5)) > 0.5))[::2, ::2]
    old, now = (cv2.blur(image, (5, 5))[::2, ::2] for image in (grey, dimmed))
    found: list[float] = []
    # Both thresholds are a few square centimetres of table.
    for weight, lowest, needed in ((weights, 150.0, -_ODDS), (np.ones_like(shares), 300.0, _ODDS)):
        counts, edges = np.histogram(shares, bins=70, range=(0.2, 0.9), weights=weight)
        smoothed = np.convolve(counts, np.ones(5), "same")
        for _ in range(4):
            best = int(smoothed.argmax())
            if smoothed[best] < lowest or len(found) == 2:
                break
            peak = 0.5 * (edges[best] + edges[best + 1])
            if _goes_on(old, now, peak, seen, noise) > needed:
                found.append(float(np.median(shares[np.abs(shares - peak) < 0.03])))
                lowest = max(lowest, 0.25 * float(smoothed[best]))  # a second lamp's is much like the first's
            smoothed[max(best - 5, 0) : best + 6] = -np.inf
        if found:
            break
    return tuple(found)


def _goes_on(old: np.ndarray, now: np.ndarray, share: float, seen: np.ndarray, noise: float) -> float:
    """Logarithm of the odds that the table's coarse texture goes on where a share of its light is seen.

    Within a shadow the logarithm of the view follows that of the table one to one; on a cloth it does not
    follow it at all.

    Args:
        old: (h, w) float32, brightness of the scene, the mean of 5 x 5 px.
        now: (h, w) float32, that of the view.
        share: The share of the light.
        seen: (h, w) bool, where the scene was seen, not guessed, and the view has its tint.
        noise: Standard deviation of a channel [levels].

    Returns:
        Positive for a shadow, negative for a cloth, 0 where too little is seen or the table is too even.
    """
    # A wide range about the share: a narrow one would choose pixels that follow the table.
    region = shrink((np.abs(now / np.maximum(old, 1.0) - share) < 0.25 * share) & seen & (old > 15), 2)
    if region.sum() < 150:
        return 0.0
    inside, size = region.astype(np.float32), (15, 15)
    weight = np.maximum(cv2.blur(inside, size), np.float32(1e-3))
    logs = [np.log(np.maximum(image, 1.0)) * inside for image in (old, now)]
    x, y = ((log - cv2.blur(log, size) / weight)[region] for log in logs)
    # 0.6 of the noise is left after a mean over 5 x 5 of pixels that are smoothed already, and 1 / sqrt(6) of that in
    # one image's mean of three channels: it belongs to no texture.
    own = float(((0.6 / np.sqrt(6.0) * noise / old[region]) ** 2).mean())
    variation = float((x * x).mean()) - own
    if variation < own:
        return 0.0
    slope = float((x * y).mean()) / variation
    left = max(float(((y - slope * x) ** 2).mean()), own)
    # Neighbours are not independent: one in 25 counts. The likelihood of slope 1 against that of slope 0.
    return (slope - 0.5) * variation / left * len(x) / 25.0
