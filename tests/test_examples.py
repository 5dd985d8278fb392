"""Every example runs headless and passes its own check."""

import importlib.util
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("*.py"))
IMAGES = Path(__file__).parents[1] / "docs" / "images"
SLOW = ("carry_mat", "hold_garment", "talos_fold")
"""Those that take 20 to 40 s, and whose steps the long tests of `tests/tasks` and `tests/estimate` go through."""


def _pictures_of():
    """Load docs/make_pictures.py, which is in no package."""
    spec = importlib.util.spec_from_file_location("make_pictures", IMAGES.parent / "make_pictures.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


pictures_of = _pictures_of()


@pytest.mark.parametrize(
    "path",
    [pytest.param(path, marks=pytest.mark.slow if path.stem in SLOW else pytest.mark.long) for path in EXAMPLES],
    ids=lambda path: path.stem,
)
def test_example(path, tmp_path, run_warm):
    """In a process of its own, without a display: its check holds, and a picture is all that it leaves."""
    folder = tmp_path / "here"
    folder.mkdir()
    out = folder / "out"
    done = run_warm([str(path), "--out", str(out)], folder, tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert list(folder.iterdir()) == [out], "it leaves nothing behind that was not asked for"
    pictures = [cv2.imread(str(picture)) for picture in out.glob("*.png")]
    assert any(min(picture.shape[:2]) >= 240 and picture.std() > 10.0 for picture in pictures), "something is seen"
    for name, file in pictures_of.PICTURES[path.stem][0][1].items():
        if path.stem != "carry_mat" and (out / file).exists():  # of few ways here; films are made on demand only
            off = pictures_of.difference(out / file, IMAGES / name)
            assert off < 2.0, f"docs/images/{name} is stale: python docs/make_pictures.py {path.stem}"
    if path.stem == "pick_estimate":
        assert "log evidence" in done.stdout and "px" not in done.stdout, "each number under its own name"


def test_there_are_examples():
    """The folder was found."""
    assert len(EXAMPLES) >= 19


def test_the_film_ends_as_the_picture():
    """The README's film is made by the same run as a picture that is compared anew, and is short."""
    with Image.open(IMAGES / "film.webp") as film:
        assert film.n_frames > 40 and film.size == (640, 360)
        film.seek(film.n_frames - 1)
        last = np.asarray(film.convert("RGB"), dtype=float)
    picture = cv2.imread(str(IMAGES / "kinds.png"))[..., ::-1]
    same = cv2.resize(picture, (640, 360), interpolation=cv2.INTER_AREA)
    assert np.abs(last - same).mean() < 4.0, "WebP is lossy"
    assert (IMAGES / "film.webp").stat().st_size < 1e6


def test_a_change_of_the_picture_is_seen(tmp_path):
    """Another size, another scene, and a body that lies elsewhere are far off; the same picture is not."""
    kinds = IMAGES / "kinds.png"
    image = cv2.imread(str(kinds))
    cv2.imwrite(str(tmp_path / "moved.png"), np.roll(image, 40, axis=1))
    cv2.imwrite(str(tmp_path / "small.png"), image[::2, ::2])
    assert pictures_of.difference(kinds, kinds) == 0.0
    assert pictures_of.difference(kinds, tmp_path / "moved.png") > 4.0
    assert pictures_of.difference(kinds, tmp_path / "small.png") == 255.0
