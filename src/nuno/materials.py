"""Materials: physical parameters as small frozen dataclasses in SI units, with named presets.

Air is at rest. In all kinds ``air_drag`` [1/s] is the rate at which it takes the velocity of every point of a body
away: left alone, v decays as exp(-air_drag t) and so does the spin, and what falls comes to g / air_drag. A body of
mass m and area A that faces the air at speed v has about 1/2 rho c v A / m, with rho c = 1.4 kg/m3. At 1 m/s that is
3.6 1/s for a cloth of 0.2 kg/m2, 0.07 1/s for a foam cube of 200 kg/m3 and 5 cm, and 0.01 1/s for one of water. Hence
the defaults: 1 1/s for ``Cloth``, which moves partly edge on, and 0 for ``Soft`` and ``Rigid``.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import InvalidInputError, UnknownNameError
from nuno.validation import GREATEST, checked, count, finite_array, flag, index_array

Value = Any  # a number, or an array (worlds,), (elements,) or (worlds, elements)
Directed = Any  # a Value for all directions, or a tuple (warp, weft) of two


@dataclass(frozen=True, eq=False)
class Material:
    """Root of all materials: checked values, each a number or an array.

    Every value may be an array: (worlds,) for one value a world; those in ``PER_ELEMENT`` also (elements,) or
    (worlds, elements). An array whose length is both is taken by world.

    Raises:
        InvalidInputError: a value is not finite, negative, or zero where it must be positive.
    """

    PER_ELEMENT: ClassVar[tuple[str, ...]] = ()
    DIRECTED: ClassVar[tuple[str, ...]] = ()  # one value or (warp, weft)
    MAY_BE_ZERO: ClassVar[tuple[str, ...]] = ("friction", "damping", "air_drag")
    OF_BODY: ClassVar[tuple[str, ...]] = ()  # vectors and tensors, the same in all worlds
    PRESETS: ClassVar[dict[str, dict[str, Any]]] = {}

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if item.name in self.DIRECTED and isinstance(value, tuple | list):
                if len(value) != 2:
                    raise InvalidInputError(f"{item.name} takes one value or (warp, weft), got {len(value)} values")
                checked: Any = tuple(self._checked(item.name, part) for part in value)
            else:
                checked = self._checked(item.name, value)
            object.__setattr__(self, item.name, checked)

    @classmethod
    def preset(cls, name: str) -> Self:
        """Return a named material.

        Raises:
            UnknownNameError: there is no such preset.
        """
        if not isinstance(name, str) or name not in cls.PRESETS:
            raise UnknownNameError(f"{cls.__name__.lower()} preset", name, list(cls.PRESETS))
        return cls(**cls.PRESETS[name])

    def resolved(self, world_count: int, element_count: int) -> dict[str, np.ndarray]:
        """Return float32 arrays (worlds, elements), or (worlds, 1) where all elements share a value.

        The keys are the attributes' names, those of ``DIRECTED`` with ``_warp`` and ``_weft`` after them.

        Raises:
            InvalidInputError: an array fits neither the worlds nor the elements.
        """
        worlds, elements = count("world_count", world_count), count("element_count", element_count)
        result: dict[str, np.ndarray] = {}
        for item in fields(self):
            value = getattr(self, item.name)
            own = elements if item.name in self.PER_ELEMENT else None
            if item.name not in self.DIRECTED:
                result[item.name] = _by_world(item.name, value, worlds, own)
                continue
            pair = value if isinstance(value, tuple) else (value, value)
            for side, part in zip(("warp", "weft"), pair, strict=True):
                result[f"{item.name}_{side}"] = _by_world(item.name, part, worlds, own)
        return result

    @checked
    def of_world(self, world: ArrayLike, world_count: int) -> Self:
        """Return the material of one world of a batch of ``world_count``, or of a batch of some, (k,).

        Raises:
            InvalidInputError: no whole numbers, or worlds that there are not.
        """
        own = index_array("world", world, (), ("k",), low=0, high=world_count)

        def pick(value: Any) -> Any:
            if isinstance(value, tuple):
                return tuple(pick(part) for part in value)
            if isinstance(value, np.ndarray) and value.shape[0] == world_count and world_count > 1:
                return value[own]
            return value[0] if isinstance(value, np.ndarray) and value.ndim == 2 else value

        return replace(
            self, **{f.name: pick(getattr(self, f.name)) for f in fields(self) if f.name not in self.OF_BODY}
        )

    def same_as(self, other: Any) -> bool:
        """Return True if another material is of the same kind and has exactly the same values."""

        def same(a: Any, b: Any) -> bool:
            if isinstance(a, tuple) and isinstance(b, tuple):
                return all(same(x, y) for x, y in zip(a, b, strict=True))
            return isinstance(a, tuple) == isinstance(b, tuple) and np.array_equal(a, b)

        if type(other) is not type(self):
            return False
        return all(same(getattr(self, item.name), getattr(other, item.name)) for item in fields(self))

    def _checked(self, name: str, value: Any) -> Any:
        deepest = 2 if name in self.PER_ELEMENT else 1
        return _checked(name, value, zero=name in self.MAY_BE_ZERO, deepest=deepest)


def _bending(warp: float, weft: float) -> tuple[float, float]:
    return (warp * 1e-6, weft * 1e-6)


@dataclass(frozen=True, eq=False)
class Cloth(Material):
    """Cloth; the defaults are a generic towel.

    Every value may be an array: (worlds,) for one value a world; the first four also (elements,) or
    (worlds, elements), where the elements of a sheet are its cells and those of a cloth mesh its faces.
    An array whose length is both is taken by world.

    ``Cloth.preset(name)``: ``denim``, ``interlock``, ``tablecloth`` (polyester), ``blanket`` and ``trousers`` have the
    area density and bending rigidity that Wang, Ramamoorthi and O'Brien measured ("Data-Driven Elastic Models for
    Cloth: Modeling and Measurement", SIGGRAPH 2011), whose three directions are read here as 0 (warp), 45 and 90
    (weft) degrees, the middle one unused. Their other values, and all of ``towel``, ``napkin`` and ``canvas``, are
    nominal: a starting point for a fit, not a measurement.

    Attributes:
        area_density: Mass per area [kg/m2].
        stretch_stiffness: Force per width and strain [N/m], or (warp, weft); warp runs along the sheet's x.
        shear_stiffness: Force per width and shear angle [N/m].
        bending_rigidity: Moment per width and curvature [N m], or (warp, weft).
        thickness: Contact diameter [m]: at rest on a table the middle surface lies thickness / 2 above it.
        friction: Coulomb's coefficient, against other bodies by the geometric mean with theirs.
        damping: Time constant of the internal damping [s].
        air_drag: Rate at which still air takes the velocity away [1/s].
        max_tension: Tension [N/m] that a sheet is to bear: where ``World(substeps=None)`` chooses its substeps, as many
            as this needs. With 0 it bears that of 30 % of strain, up to 900 N/m. Cloth meshes have no such bound.

    Raises:
        InvalidInputError: a value is not finite, negative, or zero where it must be positive.
    """

    area_density: Value = 0.2
    stretch_stiffness: Directed = 1000.0
    shear_stiffness: Value = 300.0
    bending_rigidity: Directed = 5e-5
    thickness: Value = 0.004
    friction: Value = 0.5
    damping: Value = 0.0
    air_drag: Value = 1.0
    max_tension: Value = 0.0

    PER_ELEMENT = ("area_density", "stretch_stiffness", "shear_stiffness", "bending_rigidity")
    DIRECTED = ("stretch_stiffness", "bending_rigidity")
    MAY_BE_ZERO = ("bending_rigidity", "friction", "damping", "air_drag", "max_tension")
    PRESETS = {  # noqa: RUF012 (the base declares it a ClassVar)
        "towel": {},
        "napkin": {"area_density": 0.15, "bending_rigidity": 8e-6, "thickness": 0.001},
        "canvas": {"area_density": 0.35, "bending_rigidity": 2e-4, "thickness": 0.001},
        "denim": {"area_density": 0.324, "bending_rigidity": _bending(64.0, 97.0), "thickness": 0.001},
        "interlock": {"area_density": 0.187, "bending_rigidity": _bending(23.0, 14.0), "thickness": 0.001},
        "tablecloth": {"area_density": 0.128, "bending_rigidity": _bending(52.0, 31.0), "thickness": 0.001},
        "blanket": {"area_density": 0.228, "bending_rigidity": _bending(117.0, 60.0), "thickness": 0.002},
        "trousers": {"area_density": 0.220, "bending_rigidity": _bending(125.0, 125.0), "thickness": 0.001},
    }


@dataclass(frozen=True, eq=False)
class Soft(Material):
    """A soft solid, neo-Hookean; the defaults are a soft rubber foam.

    Every value may be an array: (worlds,) for one value a world; the first three also (elements,) or
    (worlds, elements), where the elements are the tetrahedra.

    ``Soft.preset(name)``: ``sponge`` (open-cell polyurethane) and ``foam_mat`` (closed-cell EVA) are nominal, from the
    ranges that Gibson and Ashby give for such foams ("Cellular Solids", 2nd edition 1997): a starting point for a fit,
    not a measurement. ``gel`` is a silicone of about Shore 00-30, likewise nominal.

    Attributes:
        density: Mass per volume [kg/m3].
        youngs_modulus: Stress per strain [Pa] of a bar that is pulled a little.
        poisson_ratio: Narrowing per strain of that bar, below 0.5.
        friction: Coulomb's coefficient, against other bodies by the geometric mean with theirs.
        damping: Time constant of the internal damping [s].
        air_drag: Rate at which still air takes the velocity away [1/s].
        self_contact: Whether parts of the body touch each other; one value for all worlds. It takes the body through
            its frames by parts of substeps, which costs time also while nothing touches.

    Raises:
        InvalidInputError: a value is not finite, negative, zero where it must be positive, a Poisson ratio of 0.5
            or more, or a ``self_contact`` that is neither true nor false.
    """

    density: Value = 200.0
    youngs_modulus: Value = 5e4
    poisson_ratio: Value = 0.3
    friction: Value = 0.5
    damping: Value = 0.0
    air_drag: Value = 0.0
    self_contact: bool = False

    PER_ELEMENT = ("density", "youngs_modulus", "poisson_ratio")
    MAY_BE_ZERO = ("poisson_ratio", "friction", "damping", "air_drag", "self_contact")
    PRESETS = {  # noqa: RUF012 (the base declares it a ClassVar)
        "sponge": {"density": 30.0, "youngs_modulus": 3e4, "poisson_ratio": 0.25, "damping": 0.01},
        "foam_mat": {"density": 100.0, "youngs_modulus": 5e5, "poisson_ratio": 0.2, "damping": 0.01},
        "gel": {"density": 1050.0, "youngs_modulus": 6e4, "poisson_ratio": 0.45, "damping": 0.005},
    }

    def __post_init__(self) -> None:
        touching = flag("self_contact", self.self_contact)
        object.__setattr__(self, "self_contact", float(touching))  # a value as all others, while they are checked
        super().__post_init__()
        object.__setattr__(self, "self_contact", touching)
        if np.max(self.poisson_ratio) >= 0.5:
            raise InvalidInputError(f"poisson_ratio must be at least 0 and below 0.5, got {self.poisson_ratio!r}")


@dataclass(frozen=True, eq=False)
class Rigid(Material):
    """A rigid solid. Its mass is that of its volume at ``density``, or ``mass`` where it is given.

    Every value but ``inertia`` and ``centre_of_mass`` may be an array (worlds,), one value a world.

    Attributes:
        density: Mass per volume [kg/m3]; of a cloth or an open mesh, of its faces' area times its thickness.
        mass: The whole mass [kg], or None for that of the density.
        inertia: (3, 3) [kg m2] about the centre of mass along the body's axes, or None for that of the mass spread
            evenly over the volume.
        friction: Coulomb's coefficient, against other bodies by the geometric mean with theirs.
        restitution: Speed after a bounce over the speed before it, from 0 to 1.
        air_drag: Rate at which still air takes velocity and spin away [1/s].
        centre_of_mass: (3,) [m] in the body's frame, or None for that of the volume.

    Raises:
        InvalidInputError: a value is not finite, negative, zero where it must be positive, a restitution above 1, an
            inertia that no mass has, or a mass besides another density than the default.
    """

    density: Value = 1000.0
    mass: Value | None = None
    inertia: Any = None
    friction: Value = 0.5
    restitution: Value = 0.0
    air_drag: Value = 0.0
    centre_of_mass: Any = None

    MAY_BE_ZERO = ("friction", "restitution", "air_drag")
    OF_BODY = ("inertia", "centre_of_mass")

    def __post_init__(self) -> None:
        super().__post_init__()
        if np.max(self.restitution) > 1.0:
            raise InvalidInputError(f"restitution must be at most 1, got {self.restitution!r}")
        if self.mass is not None and np.any(np.asarray(self.density) != type(self).density):
            raise InvalidInputError(
                f"mass and density say the same thing, got mass={self.mass!r} and density={self.density!r}: give one, "
                "the mass of the whole body or the density of its volume"
            )

    def _checked(self, name: str, value: Any) -> Any:
        if value is None and name in ("mass", "inertia", "centre_of_mass"):
            return None
        if name == "centre_of_mass":
            return _checked_centre(value)
        return _checked_inertia(value) if name == "inertia" else super()._checked(name, value)

    def resolved(self, world_count: int, element_count: int = 1) -> dict[str, np.ndarray]:
        """Return float32 arrays (worlds, 1); ``mass``, ``inertia`` and ``centre_of_mass`` are left out."""
        worlds = count("world_count", world_count)
        if self.mass is not None:
            _by_world("mass", self.mass, worlds, None)
        names = ("density", "friction", "restitution", "air_drag")
        return {name: _by_world(name, getattr(self, name), worlds, None) for name in names}


def _checked_inertia(value: Any) -> np.ndarray:
    inertia = finite_array("inertia", value, (3, 3))
    moments = np.linalg.eigvalsh(inertia)
    # each moment is at most the sum of the others, with room for rounding (a disc reaches it)
    if not np.allclose(inertia, inertia.T) or moments[0] <= 0.0 or moments[2] > (moments[0] + moments[1]) * (1 + 1e-6):
        raise InvalidInputError(
            "inertia must be symmetric with positive moments, none above the sum of the other two, got moments "
            f"{moments.tolist()}"
        )
    inertia.setflags(write=False)
    return inertia


def _checked_centre(value: Any) -> np.ndarray:
    centre = finite_array("centre_of_mass", value, (3,))
    centre.setflags(write=False)
    return centre


def _checked(name: str, value: Any, *, zero: bool, deepest: int) -> Any:
    valid = "finite and at least 0" if zero else "finite and greater than 0"
    try:
        array = np.array(value)
        if array.dtype.kind not in "iufO":
            raise TypeError(f"{array.dtype} is no real number")
        array = array.astype(np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidInputError(f"{name} must be {valid}, got {value!r}") from error
    if array.ndim > deepest or array.size == 0:
        raise InvalidInputError(f"{name} must be a number or an array of at most {deepest} axes, got {array.shape}")
    if not np.isfinite(array).all() or (array < 0.0).any() or (not zero and (array == 0.0).any()):
        raise InvalidInputError(f"{name} must be {valid}, got {value!r}")
    if array.max() > GREATEST:
        raise InvalidInputError(f"{name} must be at most {GREATEST:.3g}, the greatest float, got {array.max():.3g}")
    array.setflags(write=False)
    return float(array) if array.ndim == 0 else array


def _by_world(name: str, value: Any, worlds: int, elements: int | None) -> np.ndarray:
    array = np.asarray(value, dtype=np.float32)
    shapes = {(): (1, 1), (worlds,): (worlds, 1)}
    if elements is not None:
        shapes |= {(1, elements): (1, elements), (worlds, elements): (worlds, elements)}
        if elements != worlds:
            shapes[(elements,)] = (1, elements)
    if array.shape not in shapes:
        valid = " or ".join(["a number", *(str(s) for s in shapes if s)])
        raise InvalidInputError(f"{name} must be {valid} here, got an array of shape {array.shape}")
    array = array.reshape(shapes[array.shape])
    return np.ascontiguousarray(np.broadcast_to(array, (worlds, array.shape[1])))
