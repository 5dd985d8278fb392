"""Particles in one or many worlds: their arrays on the device, and what is read from and written to them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from nuno.numbers.doubles import double_lane, float64
from nuno.numbers.lanes import LANES, lane, lane_int
from nuno.solvers.array_memory import HOST_COPIES, array_bytes
from nuno.state.cloth_state import FASTEST, NOTES, ORIGIN, PARTICLE_ARRAYS, SPEED, TRAVEL
from nuno.state.double_positions import DoublePositions

if TYPE_CHECKING:
    from nuno.solvers.shape_tables import FrameSums

KEPT = ("x", "y", "z", "vx", "vy", "vz", "notes")
"""Arrays that a run changes and that the next one depends on."""
Kept = tuple[np.ndarray, list[Any], list[Any]]
"""The worlds' origins, the arrays above, and coordinates that are doubles; arrays of NumPy on the CPU, else Warp's."""


def _copied(array: wp.array) -> np.ndarray:
    """Return a copy of an array on the CPU, in a third of the time that Warp's ``clone`` takes."""
    return np.array(array.numpy())


class ParticleState:
    """The state of one body's particles in a batch of worlds.

    A class under it makes the arrays in its constructor, after `_prepare`.

    Attributes:
        device: "cpu" or "cuda:0" ...
        world_count: Worlds in the batch.
        particle_count: Particles of each world.
        frame_rate: Frames a second.
        gravity: (3,) [m/s2].
        plan: How kernels are launched.
        lanes: Worlds in a vector, 16 in a batch on the CPU and else 1.
        mass: (worlds, n) [kg].
        missed: (worlds,) bool, where contacts of the body with itself were ever passed over for want of memory.
    """

    plan: str
    mass: np.ndarray
    state: Any
    _size: Any
    device_topology: Any
    _surface: Any
    scalars: np.ndarray
    _inverse_mass: np.ndarray
    doubles: DoublePositions

    def _prepare(
        self, positions: np.ndarray, device: str, gravity: Sequence[float], frame_rate: float, lanes: bool = True
    ) -> None:
        """Take what shapes all arrays; ``lanes=False`` keeps worlds one after the other on the CPU too."""
        self.device, self.frame_rate = str(device), float(frame_rate)
        self.world_count, self.particle_count = positions.shape[:2]
        self.gravity = np.asarray(gravity, dtype=float)
        self._cuda = self.device.startswith("cuda")
        self.lanes = LANES if not self._cuda and self.world_count > 1 and lanes else 1
        self.group_count = -(-self.world_count // self.lanes)
        self._number: Any = lane if self.lanes > 1 else float
        self._integer: Any = lane_int if self.lanes > 1 else int
        self.missed = np.zeros(self.world_count, dtype=bool)
        self.sums: FrameSums | None = None
        self._counts: wp.array | None = None  # read on CUDA along with `finite`, so that nobody waits twice
        self._counted: np.ndarray | None = None

    def _set_masses(self, mass: np.ndarray) -> None:
        """Take the particles' masses (worlds, n) [kg], or (1, n) where all worlds have the same."""
        shape = (self.world_count, self.particle_count)
        self.mass = np.broadcast_to(mass, shape)
        self._inverse_mass = np.broadcast_to((1.0 / mass).astype(np.float32), shape)

    def _put(self, values: np.ndarray, integer: bool = False) -> wp.array:
        """A device array of (worlds, k) numbers, k elements per world or per group of lanes."""
        values = np.asarray(values, dtype=np.int32 if integer else np.float32)
        dtype = self._integer if integer else self._number
        return wp.array(self._arranged(values), dtype=dtype, device=self.device)

    def fill(self, into: wp.array, values: np.ndarray) -> None:
        """Write (worlds, ...) numbers to a device array; of worlds that are alike (stride 0) one is sent there."""
        if self.world_count == 1 or values.strides[0] != 0:
            kind = np.float64 if into.dtype in (float64, double_lane) else np.float32
            into.assign(self._arranged(np.asarray(values, dtype=kind)))
            return
        one = np.asarray(values[0]).reshape(-1)
        if self._cuda:
            row: Any = wp.array(one, dtype=into.dtype, device=self.device)
            shape = (self.world_count, len(one))
            alike: Any = wp.array(
                ptr=row.ptr, shape=shape, strides=(0, row.strides[0]), dtype=into.dtype, device=self.device
            )
            wp.copy(into.reshape(shape), alike)
        else:
            into.numpy().reshape(self.group_count, -1, self.lanes)[...] = one[:, None]

    def _arranged(self, values: np.ndarray) -> np.ndarray:
        """(worlds, k) numbers in a device array's order."""
        values = np.ascontiguousarray(values.reshape(self.world_count, -1))
        if self.lanes == 1:
            return values.ravel()
        pad = self.group_count * self.lanes - self.world_count
        # lanes beyond the last world repeat it: they cost nothing more and stay finite
        values = np.concatenate([values, np.repeat(values[-1:], pad, axis=0)])
        values = values.reshape(self.group_count, self.lanes, -1).transpose(0, 2, 1)
        return np.ascontiguousarray(values).reshape(-1, self.lanes)

    def download(self, array: wp.array | np.ndarray, count: int) -> np.ndarray:
        """The (worlds, count) numbers of a device array, or of one that `keep` kept."""
        values = array if isinstance(array, np.ndarray) else array.numpy()
        if self.lanes > 1:
            values = values.reshape(self.group_count, count, self.lanes).transpose(0, 2, 1)
        return values.reshape(-1, count)[: self.world_count]

    def _empty(self, count: int, dtype: Any) -> wp.array:
        """Zeros, ``count`` a world or group of lanes."""
        return wp.zeros(self.group_count * count, dtype=dtype, device=self.device)

    @property
    def _whole(self) -> int:
        """Numbers in a world's array, up to a whole vector where particles are taken by sixteen."""
        n = self.particle_count
        return -(-n // LANES) * LANES if self.plan == "vector" else n

    def _allocate_particles(self) -> None:
        """Room for the arrays that all particles have."""
        state, n = self.state, self.particle_count
        for name in PARTICLE_ARRAYS:
            setattr(state, name, self._empty(self._whole, self._number)[: self.group_count * n])
        state.notes = self._empty(NOTES, self._number)
        state.box = self._empty(6, self._number)
        self._size.feature_list = len(self._surface.side) + len(self._surface.face)
        state.feature_mark = self._empty(n, self._integer)
        state.feature_due = self._empty(self._size.feature_list + 2, self._number)
        state.feature_list = state.feature_asleep = self._empty(self._size.feature_list, int)
        if self.lanes > 1:  # one world by itself is awake where an element is
            state.feature_asleep = self._empty(self._size.feature_list, int)
        state.worlds = self.world_count

    def positions(self, some: np.ndarray | None = None) -> np.ndarray:
        """(worlds, n, 3) float64, a copy [m], of all particles or of ``some``, (worlds, n) int."""
        if self._cuda:
            from nuno.state.pack import places_of_worlds

            return places_of_worlds(self.doubles.arrays, self.origin, self.particle_count, some, self.device)
        rows = np.arange(self.world_count)[:, None]
        places = np.empty((self.world_count, self.particle_count if some is None else some.shape[1], 3))
        for k, array in enumerate(self.doubles.arrays):
            own = self.download(array, self.particle_count)
            np.add(own if some is None else own[rows, some], self.origin[:, k : k + 1], out=places[..., k])
        return places

    def local_positions(self) -> np.ndarray:
        """(worlds, n, 3) relative to each world's ``origin`` [m]: the solver's own digits, float32 or float64."""
        return np.stack([self.download(a, self.particle_count) for a in self.doubles.arrays], axis=-1)

    @property
    def origin(self) -> np.ndarray:
        """(worlds, 3) float64, what ``local_positions`` are relative to [m]."""
        return self.scalars[:, ORIGIN : ORIGIN + 3].astype(np.float64)

    def velocities(self) -> np.ndarray:
        """(worlds, n, 3) float32, a copy [m/s]."""
        return np.stack(self.velocities_apart(), axis=-1)

    def velocities_apart(self, kept: Kept | None = None) -> tuple[np.ndarray, ...]:
        """The velocities' x, y and z, (worlds, n) float32 each [m/s], as they are or as `keep` kept them."""
        arrays = [getattr(self.state, name) for name in KEPT] if kept is None else kept[1]
        return tuple(self.download(arrays[KEPT.index(name)], self.particle_count) for name in ("vx", "vy", "vz"))

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """(worlds, 3) float64 each, the lowest and the highest coordinates of all particles [m]."""
        own = [self.download(array, self.particle_count) for array in self.doubles.arrays]
        low, high = (np.stack([find(each, axis=1) for each in own], axis=-1) for find in (np.min, np.max))
        return low + self.origin, high + self.origin

    def speeds(self) -> tuple[np.ndarray, np.ndarray]:
        """(worlds,) float32, of the fastest particle [m/s], and (worlds, 3), how far velocities are apart by axis."""
        own = self.velocities_apart()
        fastest = np.sqrt((own[0] * own[0] + own[1] * own[1] + own[2] * own[2]).max(axis=1))
        return fastest, np.stack([np.ptp(each, axis=1) for each in own], axis=-1)

    def set_state(self, positions: np.ndarray, velocities: np.ndarray) -> None:
        """Set positions [m] and velocities [m/s], (worlds, n, 3) each."""
        self.load_state(state_from(positions, velocities))

    def save_state(self) -> dict[str, np.ndarray]:
        """Return all that the next step depends on, each array (worlds, ...): what `load_state` takes, bit for bit."""
        notes = self.download(self.state.notes, NOTES)[:, :FASTEST].copy()
        # the list of candidate pairs is not part of the state: it is made anew, which changes no result
        notes[:, TRAVEL] = 1.0e9
        return dict(
            local=self.local_positions(), origin=self.scalars[:, ORIGIN : ORIGIN + 3].copy(),
            velocities=self.velocities(), notes=notes,
        )  # fmt: skip

    def load_state(self, state: dict[str, np.ndarray]) -> None:
        """Set the state that `save_state` gave; leading axes of 1 are spread over the worlds."""
        s, worlds, n = self.state, self.world_count, self.particle_count
        local = np.broadcast_to(state["local"], (worlds, n, 3))
        velocities = np.broadcast_to(state["velocities"], (worlds, n, 3))
        for k, (a, b, c) in enumerate((("x", "px", "vx"), ("y", "py", "vy"), ("z", "pz", "vz"))):
            self.fill(getattr(s, a), local[..., k])
            wp.copy(getattr(s, b), getattr(s, a))
            self.fill(getattr(s, c), velocities[..., k])
        self.doubles.count = False
        if local.dtype == np.float64:
            self.doubles.put(local)
        notes = np.broadcast_to(state["notes"], (worlds, FASTEST))
        self.fill(s.notes, np.pad(notes, ((0, 0), (0, NOTES - FASTEST))))
        self.scalars[:, ORIGIN : ORIGIN + 3] = state["origin"]
        s.scalars = self._put(self.scalars)

    def keep(self) -> Kept:
        """Return what `put_back` takes: the present state, copied on the device, which nobody waits for."""
        copied = wp.clone if self._cuda else _copied
        own = [copied(getattr(self.state, name)) for name in KEPT]
        doubles = [copied(array) for array in self.doubles.arrays] if self.doubles.count else []
        return self.scalars[:, ORIGIN : ORIGIN + 3].copy(), own, doubles

    def put_back(self, kept: Kept) -> None:
        """Set the state that `keep` kept, as `load_state` does what `save_state` gave then."""
        self.doubles.count = bool(kept[2])
        targets = [*(getattr(self.state, name) for name in KEPT), *(self.doubles.arrays if kept[2] else [])]
        for target, array in zip(targets, [*kept[1], *kept[2]], strict=True):
            if self._cuda:
                wp.copy(target, array)
            else:
                np.copyto(target.numpy(), array)
        self.load_state({**self.save_state(), "origin": kept[0]})

    def finite(self) -> np.ndarray:
        """(worlds,) bool: whether every position and velocity is a finite number."""
        from nuno.state.pack import finite_worlds

        s, n = self.state, self.particle_count
        if self._cuda:
            finite, self._counted = finite_worlds(s, self.world_count, n, self.device, self._counts)
            return finite
        arrays = (s.x, s.y, s.z, s.vx, s.vy, s.vz)
        if all(np.isfinite(a.numpy()).all() for a in arrays):  # lanes beyond the last world repeat it
            return np.ones(self.world_count, dtype=bool)
        return np.all([np.isfinite(self.download(a, n)).all(axis=1) for a in arrays], axis=0)

    def make_room(self) -> bool:
        """Make room for what did not fit in the run before, which must then be gone through again."""
        return False

    def positions_on_device(self, out: wp.array | None = None) -> wp.array:
        """(worlds, n) array of vec3 [m] on the solver's device, for the renderer; a copy, into ``out`` if given."""
        from nuno.state.pack import pack_positions

        worlds, n, places = self.world_count, self.particle_count, self.doubles.arrays
        return pack_positions(self.state, worlds, n, self.lanes, self.device, out, places)

    def velocities_on_device(self, out: wp.array | None = None) -> wp.array:
        """(worlds, n) array of vec3 [m/s] on the solver's device; a copy, into ``out`` if given."""
        from nuno.state.pack import pack_velocities

        return pack_velocities(self.state, self.world_count, self.particle_count, self.lanes, self.device, out)

    @property
    def arrays(self) -> dict[str, wp.array]:
        """The solver's own arrays x, y, z [m] and vx, vy, vz [m/s].

        On CUDA and for one world on the CPU each is (worlds * n,) float32; in a batch on the CPU it is
        (groups * n,) vectors of 16 worlds.
        """
        return {name: getattr(self.state, name) for name in ("x", "y", "z", "vx", "vy", "vz")}

    @property
    def memory_bytes(self) -> int:
        """Bytes of device memory that this body holds, elements shared by all worlds included."""
        return array_bytes(self.state, self.device_topology, self._surface)

    def world_bytes(self) -> tuple[int, int]:
        """Return what each world takes on the device, and what making a copy of it takes on the host [bytes]."""
        return array_bytes(self.state) // self.world_count, HOST_COPIES * 8 * 6 * self.particle_count


def state_from(positions: np.ndarray, velocities: np.ndarray) -> dict[str, np.ndarray]:
    """Return positions [m] and velocities [m/s], (worlds, n, 3) each, as what `ParticleSolver.load_state` takes."""
    positions = np.asarray(positions, dtype=np.float64)
    velocities = np.asarray(velocities)
    if positions.strides[0] == 0 and velocities.strides[0] == 0:  # of worlds that are all alike one will do
        positions, velocities = positions[:1], velocities[:1]
    # each world's own origin, in steps of 1/1024 m so that adding it loses nothing
    origin = np.round(np.nan_to_num(positions.mean(axis=1)) * 1024.0) / 1024.0
    notes = np.zeros((len(positions), FASTEST), dtype=np.float32)
    notes[:, TRAVEL] = 1.0e9
    speed = np.linalg.norm(np.asarray(velocities, dtype=float), axis=-1).max(axis=-1)
    notes[:, SPEED] = np.nan_to_num(speed, nan=0.0) ** 2
    local, origin = (positions - origin[:, None]).astype(np.float32), origin.astype(np.float32)
    return dict(local=local, origin=origin, velocities=velocities.astype(np.float32), notes=notes)
