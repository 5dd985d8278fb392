"""Make pictures of the README and the docs anew by running the examples that draw them.

Run: python docs/make_pictures.py [EXAMPLE ...]    (those that are named; without names, all: some minutes)

The tests run the examples too, and compare what they draw with what lies in docs/images: a picture that is no longer
what its example draws fails them.
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

ROOT = Path(__file__).parents[1]
IMAGES = ROOT / "docs" / "images"
LARGE = 120_000  # bytes of a PNG
# By example, for each run: what it is asked for beside --out, and its files by the picture's name.
PICTURES: dict[str, list[tuple[list[str], dict[str, str]]]] = {
    "all_kinds": [(["--film"], {"kinds.png": "all_kinds.png", "film.webp": "all_kinds.webp"})],
    "carry_mat": [
        (["--all"], {"carry-best.webp": "best.png", "carry-failed.webp": "failed.png", "carry-plot.png": "plot.png"})
    ],
    "closed_loop": [
        ([], {"closed-loop.webp": "closed_loop.png"}),
        (["--point", "2", "2"], {"closed-loop-inside.webp": "closed_loop.png"}),
    ],
    "hold_garment": [([], {"hold-garment.png": "hold_garment.png"})],
    "learn_fold": [([], {"learn_fold.png": "learn_fold.png"})],
    "pick_estimate": [([], {"pick.webp": "result.png"})],
    "pick_outline": [([], {"pick-outline.webp": "result.png"})],
    "replay_fold": [([], {"fold.webp": "strip.png", "layers.png": "layers.png", "hands.png": "hands.png"})],
    "talos_fold": [([], {"talos-fold.png": "talos-fold.png", "talos-fold-layers.png": "talos-fold-layers.png"})],
    "talos_walk": [([], {"walk.png": "talos_walk.png"})],
    "viewer_page": [([], {"viewer.webp": "viewer_page.png"})],
} | {
    name: [([], {f"examples/{name}.webp": f"{name}.png"})]  # for the gallery alone
    for name in (
        "box_on_towel", "drop_on_table", "fit_material", "fold_towel", "follow_cloth", "follow_in_hand", "hang_cloth",
        "hold_by_friction", "imagine_futures", "lift_soft_cube", "load_scene", "save_and_restore", "show_world",
        "soft_cube", "sweep_towel", "talos_reach",
    )
}  # fmt: skip


def difference(picture: Path, other: Path) -> float:
    """Return how far two pictures are apart: the mean over fields of 8 x 8 pixels, of the last frames [levels of 255].

    Fields leave out what edges and fonts do on another machine; another size is as far apart as can be.
    """
    fields = []
    for path in (picture, other):
        image = Image.open(path)
        image.seek(getattr(image, "n_frames", 1) - 1)
        pixels = np.asarray(image.convert("RGB"))
        height, width = pixels.shape[:2]
        fields.append(cv2.resize(pixels, (width // 8, height // 8), interpolation=cv2.INTER_AREA).astype(float))
    return float(np.abs(fields[0] - fields[1]).mean()) if fields[0].shape == fields[1].shape else 255.0


def main() -> None:
    """Run the examples, and put what they draw into docs/images."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("examples", nargs="*", metavar="EXAMPLE", help=f"of {', '.join(PICTURES)}; default: all")
    names = parser.parse_args().examples or list(PICTURES)
    if unknown := set(names) - set(PICTURES):
        parser.error(f"no pictures are made of {sorted(unknown)[0]}; of these are: {', '.join(PICTURES)}")
    for name in names:
        for more, files in PICTURES[name]:
            with tempfile.TemporaryDirectory() as folder:
                subprocess.run([sys.executable, str(script(name)), "--out", folder, *more], check=True)
                for picture, file in files.items():
                    keep(Path(folder) / file, IMAGES / picture)


def script(name: str) -> Path:
    """Return the program that draws: an example, or the one that takes pictures of the viewer's page in Chromium."""
    return ROOT / ("tests/viewer" if name == "viewer_page" else "examples") / f"{name}.py"


def keep(drawn: Path, picture: Path) -> None:
    """Put what an example drew into docs/images, packed: a large PNG in 256 colours, other formats by quality 85."""
    picture.parent.mkdir(parents=True, exist_ok=True)
    if drawn.suffix == ".webp":  # a film
        shutil.copyfile(drawn, picture)
    elif picture.suffix == ".png":
        image = Image.open(drawn).convert("RGB")
        image.save(picture, optimize=True)
        if picture.stat().st_size > LARGE:
            image.quantize(256, dither=Image.Dither.NONE).save(picture, optimize=True)
    else:
        Image.open(drawn).convert("RGB").save(picture, quality=85, method=6)


if __name__ == "__main__":
    main()
