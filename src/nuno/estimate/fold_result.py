"""A replayed fold: the cloth at every frame of the video, and how it lies in the end."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.camera.camera import Camera
from nuno.camera.rectangle import ClothRectangle
from nuno.estimate.fold_view import CLOTH_COLOUR, hand_spheres
from nuno.estimate.hand_path import HandPath
from nuno.estimate.imagined_fold import ImaginedFold
from nuno.estimate.layers import Layers, find_layers
from nuno.files.html_table import html_table
from nuno.files.whole_file import made_folder, replacing, write_figure, write_whole
from nuno.materials import Cloth
from nuno.world.recording import RecordedBody, Recording

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from nuno.world.world import World


@dataclass(eq=False)
class FoldResult:
    """A folded cloth: its vertices at every frame, and how it lies in the end.

    Attributes:
        times: (k,) float [s], the video's frames.
        vertices: (k, n, 3) float [m], the cloth at each.
        faces: (m, 3) int.
        masks: (k, h, w) bool, where the camera would see the cloth; what hands or the table's edge hide is left out.
        real: The cloth in the video by frame, (h, w) bool: as given, or as found in the image.
        agreement: Overlap (intersection over union) of both by frame, without pixels at the hands.
        given: The frames whose real mask was given.
        material_name: The material that was kept.
        material: Its values.
        scores: Mean agreement by material; NaN where there was nothing to compare.
        rectangle: The cloth as it lay before.
        camera: The camera.
        hands: The hands' paths.
        hands_at: (k, hands, 3) float [m], where they are at each frame.
        hands_seen: (k, hands) bool, whether they are there to hide the cloth.
        hand_radius: [m].
        seconds: Wall time by stage [s].
        warnings: What a reader should know.
        fold: All worlds of the batch, and what the hands held.
        best_index: The world that was kept.
        images: The images by frame, (h, w, 3) uint8.
    """

    times: np.ndarray
    vertices: np.ndarray = field(repr=False)
    faces: np.ndarray = field(repr=False)
    masks: np.ndarray = field(repr=False)
    real: dict[int, np.ndarray] = field(repr=False)
    agreement: dict[int, float]
    given: frozenset[int]
    material_name: str
    material: Cloth
    scores: dict[str, float]
    rectangle: ClothRectangle
    camera: Camera
    hands: tuple[HandPath, ...] = field(repr=False)
    hands_at: np.ndarray = field(repr=False)
    hands_seen: np.ndarray = field(repr=False)
    hand_radius: float
    seconds: dict[str, float]
    warnings: list[str]
    fold: ImaginedFold = field(repr=False)
    best_index: int
    images: dict[int, np.ndarray] = field(repr=False)
    first_image: np.ndarray | None = field(default=None, repr=False)

    def __repr__(self) -> str:
        agreement = list(self.agreement.values())
        rated = f", agreement {np.mean(agreement):.3f}" if agreement else ""
        odd = f", {len(self.warnings)} warnings" if self.warnings else ""
        return f"<FoldResult: {len(self.times)} frames as {self.material_name}{rated}{odd}>"

    def _repr_html_(self) -> str:
        rows = [(name, f"{score:.3f}") for name, score in self.scores.items()]
        title = f"FoldResult: {len(self.times)} frames as {self.material_name}"
        columns = ("material", "mean overlap") if rows else ()
        return html_table(title, rows, columns=columns, notes=self.warnings, figure=self.figure())

    @property
    def final(self) -> np.ndarray:
        """(n, 3) float [m], the cloth at the last frame."""
        return self.vertices[-1]

    @property
    def world(self) -> World:
        """The world that the fold was imagined from: table, floor and the cloth as it lay before."""
        return self.fold.origin

    def adopt(self) -> World:
        """Make the end of the kept replay the state of ``world``, and return it: the cloth lies folded."""
        self.world.adopt(self.fold.world, self.best_index)
        return self.world

    @cached_property
    def fractions(self) -> np.ndarray:
        """(n, 2) float, each vertex's place on the cloth as fractions of its sides from corner C00."""
        return self.rectangle.fractions(self.fold.states[0, self.best_index])

    @cached_property
    def layers(self) -> Layers:
        """Return which parts lie under which at the last frame."""
        return find_layers(self.final, self.faces, self.fractions)

    def recording(self) -> Recording:
        """Return the replay with table and hands, frame by frame, to be saved (.npz) or exported (.glb)."""
        table = self.world.find("table")
        cloth = self.fold.body
        spheres, triangles = hand_spheres(self.hands_at, np.ones_like(self.hands_seen), max(self.hand_radius, 1e-4))
        bodies = [
            RecordedBody(cloth.name, CLOTH_COLOUR, np.array(self.vertices, dtype=float), self.faces),
            RecordedBody("hands", "black", spheres, triangles),
        ]
        if table.shape.kind != "plane":
            bodies.append(RecordedBody("table", table.color, np.asarray(table.vertices)[None], table.faces))
        return Recording.from_frames(self.times, bodies)

    def to_dict(self) -> dict[str, Any]:
        """The answer as plain data, as it is written to result.json."""
        layers = self.layers
        agreements = list(self.agreement.values())
        return {
            "format": 1,
            "material": {"name": self.material_name, **_values(self.material)},
            "scores": {name: _number(value) for name, value in self.scores.items()},
            "agreement": {
                "mean": _number(float(np.mean(agreements)) if agreements else np.nan),
                "last": _number(self.agreement[max(self.agreement)] if agreements else np.nan),
            },
            "frames": [
                {
                    "frame": k,
                    "t": float(t),
                    "agreement": _number(self.agreement.get(k, np.nan)),
                    "compared_with": "mask" if k in self.given else "image" if k in self.agreement else None,
                }
                for k, t in enumerate(self.times)
            ],
            "holds": [
                {"hand": hold.hand, "begin": hold.begin, "end": _number(hold.end), "away_m": hold.away,
                 "touched": hold.held_cloth}
                for hold in self.fold.holds
            ],
            "layers": {"most": int(layers.count.max()), "area_m2": layers.area},
            "cloth": {
                "long_m": self.rectangle.long_m,
                "short_m": self.rectangle.short_m,
                "corners": self.rectangle.corners.tolist(),
            },
            "warnings": self.warnings,
            "seconds": {name: round(value, 4) for name, value in self.seconds.items()},
        }  # fmt: skip

    def figure(self, count: int = 8) -> Figure:
        """A strip of up to ``count`` frames: the video above, what was imagined below."""
        from nuno.estimate.fold_strip import fold_strip

        return fold_strip(self, count)

    def hands_figure(self) -> Figure:
        """The hands' paths, from above and in height over time (the paper's Fig. 11)."""
        from nuno.estimate.hands_figure import hands_figure

        return hands_figure(self)

    def save(
        self, folder: str | os.PathLike[str], *, names: Mapping[int, str] | None = None, pictures: bool = True
    ) -> None:
        """Write the answer into a folder that is made if need be.

        result.json; mask_NNN.png of every frame in ``names``; final.npz with vertices (n, 3) and faces (m, 3);
        replay.npz (for ``nuno.Recording.load``) and replay.glb; where ``pictures`` is set, strip.png, layers.png and
        hands.png.

        Args:
            folder: Where.
            names: What stands for NNN by frame; None names all frames by their number.
            pictures: Whether to draw pictures.

        Raises:
            FileWriteError: the folder or a file in it cannot be written.
        """
        import cv2

        folder = made_folder(folder)
        chosen = {k: f"{k:03d}" for k in range(len(self.times))} if names is None else names
        for k, name in chosen.items():
            encoded = cv2.imencode(".png", self.masks[k].astype(np.uint8) * 255)[1]
            write_whole(folder / f"mask_{name}.png", encoded.tobytes())
        with replacing(folder / "final.npz") as partial, open(partial, "wb") as stream:
            np.savez_compressed(stream, vertices=self.final, faces=self.faces)
        recording = self.recording()
        recording.save(folder / "replay.npz")
        recording.export(folder / "replay.glb")
        if pictures:
            write_figure(folder / "strip.png", self.figure())
            write_figure(folder / "layers.png", self.layers.figure())
            write_figure(folder / "hands.png", self.hands_figure())
        text = json.dumps(self.to_dict(), indent=1, allow_nan=False)
        write_whole(folder / "result.json", text + "\n")


def _number(value: float) -> float | None:
    """JSON has neither NaN nor infinity."""
    return float(value) if np.isfinite(value) else None


def _values(material: Cloth) -> dict[str, Any]:
    return {
        item.name: [float(part) for part in value] if isinstance(value, tuple) else float(value)
        for item in fields(material)
        for value in (getattr(material, item.name),)
        if np.ndim(value) == 0 or isinstance(value, tuple)
    }
