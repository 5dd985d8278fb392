"""Body: coordinates, a shape, a colour, and dynamics while they are attached; static by default."""

from __future__ import annotations

import os
import uuid
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from nuno.bodies.body_facts import body_facts, millimetres
from nuno.bodies.checked_values import ALL_GROUPS, checked_friction, checked_mask
from nuno.bodies.quantities import Quantities
from nuno.errors import BodyStateError, InvalidInputError
from nuno.files.html_table import html_table
from nuno.materials import Cloth, Material
from nuno.shapes.color import checked_color
from nuno.shapes.coordinates import Coordinates, Pose, apply, compose, invert
from nuno.shapes.path import Path
from nuno.shapes.shape import Shape, Sheet
from nuno.shapes.soft_shape import SoftShape
from nuno.shapes.surface import SurfacePoints, closest_points, sheet_points
from nuno.validation import finite_array

if TYPE_CHECKING:
    from nuno.bodies.body_protocols import BodyDynamics, BodyWorld
    from nuno.bodies.resolution import Resolution

Color = str | tuple[float, float, float]
CLOTH_COLOR, SOFT_COLOR, PLANE_COLOR = "#4a86c8", "#e0a33c", "#c8c4bc"


class BodyOptions(TypedDict, total=False):
    """Keyword arguments that every body takes; ``Body`` says what each is."""

    name: str | None
    position: ArrayLike | None
    quaternion: ArrayLike
    color: Color | None
    friction: Any
    group: int
    collides_with: int


class Body(Quantities, Coordinates):
    """A thing in the world. Its position is the shape's centre.

    Args:
        shape: What it looks like in its own frame.
        name: A name; the world numbers a name that is taken ("box", "box_1" ...). None is the shape's kind.
        position: (3,) or (worlds, 3) [m]; None leaves a mesh where its vertices are, others at the origin.
        quaternion: (4,) or (worlds, 4), (w, x, y, z).
        color: A name ("gray", "#4080c0") or (r, g, b) in [0, 1]; None: blue for cloth, amber for soft bodies, light
            gray for planes, gray for all else.
        friction: Coulomb's coefficient, a number or (worlds,); a pair takes the geometric mean.
        group: Bit mask of the collision groups that the body is in.
        collides_with: Bit mask of the groups that it touches; both bodies of a pair must agree.

    Raises:
        InvalidInputError: a value that is not finite, of another shape, or out of range.
    """

    def __init__(
        self, shape: Shape, *, name: str | None = None, position: ArrayLike | None = None,
        quaternion: ArrayLike = (1.0, 0.0, 0.0, 0.0), color: Color | None = None, friction: Any = 0.5,
        group: int = 1, collides_with: int = ALL_GROUPS,
    ) -> None:  # fmt: skip
        if not isinstance(shape, Shape):
            raise InvalidInputError(f"a body needs a shape such as Box or Sheet, got {type(shape).__name__}")
        super().__init__(shape.centre if position is None else position, quaternion)
        if name is not None and (not isinstance(name, str) or not name):
            raise InvalidInputError(f"a name is a string that is not empty, got {name!r}")
        self.key = uuid.uuid4().hex  # the same for copies of the body in imagined worlds and in files
        self._shape = shape
        self._name = name or shape.kind
        self._world: BodyWorld | None = None
        self._dynamics: BodyDynamics | None = None
        self._links: Any = None  # the robot's links that it is one of
        self._path: Path | None = None  # that the static body follows, whose pose is always that of the world's time
        # Vertices (worlds, n, 3) of a static body that dynamics have deformed, and the pose they belong to.
        self._deformed: tuple[np.ndarray, Pose] | None = None
        self._friction = checked_friction(friction)
        self._thickness = float(Cloth.thickness) if shape.is_cloth else 0.0
        self._group, self._collides_with = checked_mask("group", group), checked_mask("collides_with", collides_with)
        self.color = _default_color(shape) if color is None else color

    def __repr__(self) -> str:
        state = "dynamic" if self.is_dynamic else "static"
        place = np.asarray(self.position)
        where = f"at {millimetres(place)} m" if place.ndim == 1 else f"in {len(place)} worlds"
        return f"<{self._shape.kind} {self._name!r} {where}, {state}>"

    def __copy__(self, memo: Any = None) -> Body:
        """Return another body of the same shape, for a world of its own or the same one.

        Raises:
            BodyStateError: it is in a world, or moves with another frame.
        """
        if self._world is not None or self._parent is not None:
            raise BodyStateError(f"{self._name!r} is in a world or follows a frame: copy it before, or make another")
        copied = self._as_static()
        copied.__dict__.update(key=uuid.uuid4().hex, _children=[])
        return copied

    __deepcopy__ = __copy__  # shapes are never written to

    def _repr_html_(self) -> str:
        return html_table(f"Body {self._name!r}", body_facts(self))

    @property
    def name(self) -> str:
        """The name, unique in its world."""
        return self._name

    @property
    def shape(self) -> Shape:
        """The shape in the body's own frame, before anything deformed it."""
        return self._shape

    @property
    def material(self) -> Material | None:
        """The material of its dynamics, None while it is static."""
        return None if self._dynamics is None else self._dynamics.material

    @property
    def is_dynamic(self) -> bool:
        """Return True if dynamics are attached."""
        return self._dynamics is not None

    @property
    def is_deformed(self) -> bool:
        """Return True if the body is static in another shape than ``shape``."""
        return self._deformed is not None

    @property
    def thickness(self) -> float:
        """Contact thickness [m] of a cloth, its last material's (in a batch the largest); 0 for solids."""
        material = self.material
        return float(np.max(material.thickness)) if isinstance(material, Cloth) else self._thickness

    @property
    def is_solid(self) -> bool:
        """Return True if it has an inside: all shapes but cloths and meshes that are open or inside out."""
        return self._shape.is_solid

    @property
    def missed_contacts(self) -> Any:
        """Return True if contacts of a cloth with itself were missed; in a batch (worlds,).

        Memory ran out, or it passed through itself in spite of all substeps; a warning told which.
        """
        solver = getattr(self._dynamics, "solver", None)
        missed = np.array(getattr(solver, "missed", np.zeros(1, dtype=bool)))
        return missed if len(missed) > 1 else bool(missed[0])

    @property
    def resolution(self) -> Resolution | None:
        """Return how a cloth's or soft body's substeps resolve its material, None for a static or rigid body."""
        return None if self._dynamics is None else self._dynamics.resolution

    @property
    def color(self) -> Color:
        """A name or (r, g, b) in [0, 1], as it was given."""
        return self._color

    @color.setter
    def color(self, value: Color) -> None:
        self._color = checked_color(value)

    @property
    def friction(self) -> Any:
        """Coulomb's coefficient, a number or (worlds,); ``attach`` takes the material's over."""
        return self._friction

    @friction.setter
    def friction(self, value: Any) -> None:
        self._change("_friction", checked_friction(value))

    @property
    def group(self) -> int:
        """Bit mask of the collision groups that the body is in."""
        return self._group

    @group.setter
    def group(self, value: int) -> None:
        self._change("_group", checked_mask("group", value))

    @property
    def collides_with(self) -> int:
        """Bit mask of the collision groups that the body touches."""
        return self._collides_with

    @collides_with.setter
    def collides_with(self, value: int) -> None:
        self._change("_collides_with", checked_mask("collides_with", value))

    @property
    def faces(self) -> np.ndarray:
        """(m, 3) int32, a copy."""
        return self._shape.mesh()[1].copy()

    @property
    def vertices(self) -> np.ndarray:
        """(n, 3), in a batch (worlds, n, 3), float64 [m]: a copy, in the world frame."""
        with self._guard():
            vertices = self._vertices()
            count = 1 if self._world is None else self._world.world_count
            if self._dynamics is not None and self._dynamics.copies_vertices:  # nobody else has this array
                return vertices if count > 1 else vertices[0]
        if count > 1:
            return np.array(np.broadcast_to(vertices, (count, *vertices.shape[-2:])))
        return np.array(vertices[0] if len(vertices) == 1 and vertices.ndim == 3 else vertices)

    def surface(self) -> tuple[np.ndarray, np.ndarray]:
        """Return vertices, (n, 3) where all worlds share them, else (worlds, n, 3), and faces: read-only."""
        with self._guard():
            return self._vertices(), self._shape.mesh()[1]

    def skin(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the surface that is drawn: vertices (k, 3), in a batch (worlds, k, 3) [m], and faces (m, 3) int32.

        Of a soft body made from a surface, this is that surface, which is embedded in it; of any other body, its
        ``vertices`` and ``faces``.
        """
        vertices = self.vertices
        if not isinstance(self._shape, SoftShape):
            return vertices, self.faces
        made = self._shape.tetrahedra()
        return made.skin_vertices(vertices), made.faces.copy()

    def to_trimesh(self, world: int | None = None) -> Any:
        """Return the surface as it is now, a ``trimesh.Trimesh`` in the world frame with vertex colours.

        Args:
            world: Which world of a batch; None for a single world.

        Raises:
            InvalidInputError: a batch without ``world``, or out of range.
        """
        from nuno.bodies.surface_file import to_trimesh

        return to_trimesh(self, world)

    def export(self, path: str | os.PathLike[str], world: int | None = None) -> None:
        """Write the surface as it is now to a .obj, .ply or .glb file; see ``nuno.export_body``."""
        from nuno.bodies.surface_file import write_surface

        write_surface(path, self, world)

    @property
    def velocities(self) -> np.ndarray:
        """(n, 3), in a batch (worlds, n, 3), float64 [m/s]: a copy; zero while the body is static."""
        with self._guard():
            if self._dynamics is None:
                return np.zeros_like(self.vertices)
            velocities = self._dynamics.velocities(self)
        return velocities if len(velocities) > 1 else velocities[0]

    def at(self, u: ArrayLike, v: ArrayLike) -> SurfacePoints:
        """Return the points of a sheet at u (along its x) and v (along its y), each in [0, 1].

        Args:
            u: A number, (k,), or (worlds, k).
            v: Likewise.

        Raises:
            InvalidInputError: the body is no sheet, or a value is outside [0, 1].
        """
        if not isinstance(self._shape, Sheet):
            raise InvalidInputError(f"only a sheet has points (u, v); {self._name!r} is a {self._shape.kind}")
        shapes = ((), ("k",), ("worlds", "k"))
        try:
            us, vs = np.broadcast_arrays(finite_array("u", u, *shapes), finite_array("v", v, *shapes))
        except ValueError as error:
            raise InvalidInputError(f"u and v must fit each other: {error}") from error
        if min(us.min(), vs.min()) < 0.0 or max(us.max(), vs.max()) > 1.0:
            raise InvalidInputError(f"u and v must lie in [0, 1], got u = {u!r}, v = {v!r}")
        return sheet_points(self._shape.cells, np.atleast_1d(us), np.atleast_1d(vs))

    def closest(self, points: ArrayLike) -> SurfacePoints:
        """Return the surface points closest to ``points`` (3,), (k, 3) or (worlds, k, 3) [m] of the world.

        Raises:
            InvalidInputError: points that are not finite, or of another shape.
        """
        asked = finite_array("points", points, (3,), ("k", 3), ("worlds", "k", 3))
        asked = asked[None] if asked.ndim == 1 else asked
        vertices, faces = self.vertices, self._shape.mesh()[1]
        if asked.ndim == 2 and vertices.ndim == 2:
            return closest_points(asked, vertices, faces)
        count = len(vertices) if vertices.ndim == 3 else 1
        if asked.ndim == 3 and len(asked) != count:
            raise InvalidInputError(f"points by world must be (k, 3) or ({count}, k, 3), got {asked.shape}")
        asked = np.broadcast_to(asked, (count, *asked.shape[-2:]))
        found = [closest_points(p, v, faces) for p, v in zip(asked, vertices.reshape(count, -1, 3), strict=True)]
        return SurfacePoints(np.stack([f.faces for f in found]), np.stack([f.barycentric for f in found]))

    def _guard(self) -> AbstractContextManager[Any]:
        return nullcontext() if self._world is None else self._world.lock

    def _change(self, attribute: str, value: Any) -> None:
        with self._guard():
            if self._world is not None:
                self._world._check_between_frames(f"a change of {attribute.strip('_')}")
                self._world._check_worlds(attribute.strip("_"), np.shape(value))
            setattr(self, attribute, value)
            if self._world is not None:
                self._world._body_changed(self.key)

    def _vertices(self) -> np.ndarray:
        """Return (n, 3) or (worlds, n, 3), not to be written to."""
        return self._rigid_vertices(self.pose()) if self._dynamics is None else self._dynamics.vertices(self)

    def _rigid_vertices(self, pose: Pose) -> np.ndarray:
        """Return (n, 3) or (worlds, n, 3) of the body as it is when static, at a pose."""
        if self._deformed is None:
            return apply(pose, self._shape.mesh()[0])
        vertices, base = self._deformed
        stays = np.logical_and(*((a == b).all(axis=-1) for a, b in zip(pose, base, strict=True)))
        if stays.all():
            return vertices
        # where only some worlds' bodies were moved, the others' vertices are not rounded
        return np.where(stays[..., None, None], vertices, apply(compose(pose, invert(base)), vertices))

    def local_vertices(self) -> np.ndarray:
        """Return the vertices of the static body in its own frame, (n, 3) or (worlds, n, 3) [m], read-only."""
        if self._deformed is None:
            return self._shape.mesh()[0]
        vertices, base = self._deformed
        return apply(invert(base), vertices)

    def pose(self) -> Pose:
        """Return position [m] and quaternion in the world frame, of a dynamic body as its solver has it."""
        if self._dynamics is None:
            return super().pose()
        with self._guard():
            return self._dynamics.pose(self)

    def _place(self, position: np.ndarray, quaternion: np.ndarray) -> None:
        with self._guard():
            if self._world is not None:
                self._world._check_between_frames("a change of the pose")
                self._world._check_worlds("position", position.shape[:-1])
                self._world._check_worlds("quaternion", quaternion.shape[:-1])
            if self._dynamics is None:
                self._path = None
                super()._place(position, quaternion)
                return
            self._dynamics.place(self, position, quaternion)
            self._quaternion = quaternion
            self._moved()

    def _follow(self, parent: Coordinates) -> None:
        if self._dynamics is not None:
            raise BodyStateError(f"{self._name!r} is dynamic and cannot follow a frame; grip it instead")
        if self._path is not None:
            raise BodyStateError(f"{self._name!r} follows a path; end that with world.move(body, None) first")
        with self._guard():
            super()._follow(parent)

    def _moved(self) -> None:
        if self._world is not None:
            self._world._body_changed(self.key)
        super()._moved()

    def _as_static(self) -> Body:
        """Return a copy that is static in the present place and shape; this body stays what it is."""
        copied = object.__new__(type(self))
        copied.__dict__.update(self.__dict__)
        if copied._dynamics is not None:
            copied._thickness = self.thickness
            copied._freeze()
        return copied

    def _freeze(self) -> None:
        """Become static, in the present place and shape."""
        assert self._dynamics is not None
        pose, vertices = self._dynamics.pose(self), None if self._dynamics.is_rigid else self._vertices()
        self._dynamics = None
        self._position, self._quaternion = pose
        if vertices is None:
            return
        self._position = _centre(vertices)
        self._deformed = (vertices, (self._position, self._quaternion))


def _default_color(shape: Shape) -> Color:
    """Return a colour by kind: what lies on another kind of body is seen."""
    if shape.is_cloth:
        return CLOTH_COLOR
    if shape.is_soft:
        return SOFT_COLOR
    return PLANE_COLOR if shape.kind == "plane" else "gray"


def _centre(vertices: np.ndarray) -> np.ndarray:
    centre = vertices.mean(axis=-2)
    return centre[0] if centre.ndim == 2 and len(centre) == 1 else centre
