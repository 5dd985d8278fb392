"""Reading a world: contacts, states on the device, and what cameras see."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.bodies.body import Body
from nuno.dynamics.dynamics import ParticleDynamics, dynamics_of
from nuno.errors import BodyStateError, InvalidInputError
from nuno.materials import Rigid
from nuno.validation import flag
from nuno.world.copying import Copying

if TYPE_CHECKING:
    from nuno.camera.camera import Camera
    from nuno.numbers.device_array import DeviceArray
    from nuno.world.contact_points import ContactPoints


class Reading(Copying):
    """A simulation with the verbs that read it."""

    def contacts(self, body: Body | str, *, itself: bool = False) -> ContactPoints:
        """Return where a dynamic body touches others: points, normals and forces.

        Those with static bodies are what the next substep would make of them, for cloth and soft bodies; all others
        are those of the last substep.

        Args:
            body: The body.
            itself: Whether contacts of a cloth or soft body with itself are told too, under its own name. Both sides of
                each are, so that their forces add up to nothing. Of a cloth they are what the next substep would make
                of them, vertex by vertex, which takes the time of two substeps.

        Raises:
            BodyStateError: the body is static.
        """
        from nuno.world.contact_points import contact_points

        with self._call():
            own, _ = self._own_dynamics(body, "ask for the contacts of what touches it")
            return contact_points(self, own, flag("itself", itself))

    def contact_force(self, body: Body | str) -> DeviceArray:
        """Return the sum of the forces that contacts exert on a dynamic body [N], a Warp array (worlds,) of vec3.

        It lies on the world's device. The forces are those of ``contacts``, summed up on the host.

        Raises:
            BodyStateError: the body is static.
        """
        import warp as wp

        with self._call():
            found = self.contacts(body)
            total = np.zeros((self.world_count, 3), dtype=np.float32)
            np.add.at(total, found.worlds, found.forces)
            force: Any = wp.array(total, dtype=wp.vec3, device=self.device)
            return force

    def rigid_motion(self, bodies: Sequence[Body | str]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return where dynamic rigid bodies are and how they move, read at once: (worlds, bodies, 3 or 4) each.

        Positions [m] and quaternions (w, x, y, z) are those of ``body.pose()``, the velocities [m/s] those of that
        position, beside angular velocities [rad/s] in the world's frame.

        Raises:
            BodyStateError: a body is static.
            InvalidInputError: a body deforms, or none that can be gone through is given.
        """
        with self._call():
            if isinstance(bodies, str | Body) or not isinstance(bodies, Iterable):
                raise InvalidInputError(f"bodies must be several, a list or tuple, got {type(bodies).__name__}")
            own = [self._own(body) for body in bodies]
            if not own:
                raise InvalidInputError("bodies must be at least one")
            for body in own:
                if not body.is_dynamic:
                    raise BodyStateError(f"{body.name!r} is static; its pose() and path say where it is")
                if not isinstance(body.material, Rigid):
                    raise InvalidInputError(f"{body.name!r} deforms; state() tells its vertices")
            return self._engine.rigid_motions(own)

    def state(self, body: Body | str, copy: bool = True) -> dict[str, DeviceArray]:
        """Return "positions" [m] and "velocities" [m/s] of a dynamic body, Warp arrays (worlds, n) of vec3.

        They lie on the world's device, in the layout that other libraries expect (``__dlpack__``,
        ``__cuda_array_interface__``). Those of cloth and soft bodies do not pass through the host; those of a rigid
        body's vertices do.

        Args:
            body: The body.
            copy: Whether the arrays are new ones. With False they belong to the world, which fills them anew at each
                such call: views of them (``wp.to_torch``, ``torch.from_dlpack``) are made once, and nothing is
                allocated from step to step.

        Raises:
            BodyStateError: the body is static.
        """
        import warp as wp

        with self._call():
            own = self._own(body)
            dynamics = dynamics_of(own)
            if dynamics is None:
                raise BodyStateError(f"{own.name!r} is static and has no state on a device; see its vertices")
            names = ("positions", "velocities")
            kept = {} if flag("copy", copy) else self._views.get(dynamics, {})
            if isinstance(dynamics, ParticleDynamics):
                made = (dynamics.solver.positions_on_device, dynamics.solver.velocities_on_device)
                arrays = {name: make(kept.get(name)) for name, make in zip(names, made, strict=True)}
            else:
                values = (dynamics.vertices(own), dynamics.velocities(own))
                arrays = {n: wp.array(v, dtype=wp.vec3, device=self.device) for n, v in zip(names, values, strict=True)}
                for name, array in kept.items():
                    wp.copy(array, arrays[name])
                arrays = kept or arrays
            if not copy:
                self._views[dynamics] = arrays
            return dict(arrays)

    # Cameras

    def masks(self, camera: Camera, body: Body | str) -> DeviceArray:
        """Return where ``body`` is seen: bool (h, w) or (worlds, h, w), on the device."""
        from nuno.camera import render

        with self._call():
            return render.render_masks(self, camera, self._own(body))

    def segment(self, camera: Camera, *bodies: Body | str) -> dict[str, DeviceArray]:
        """Return where each of some bodies, or of all, is seen; everything is drawn once.

        Args:
            camera: The camera.
            bodies: Bodies or names; none named is all.

        Returns:
            By the bodies' names, Warp arrays bool (h, w) or (worlds, h, w), on the device.

        Raises:
            UnknownNameError: a body that is not in the world.
        """
        from nuno.camera import body_masks

        with self._call():
            return body_masks.segment(self, camera, [self._own(body) for body in bodies])

    def depth(self, camera: Camera) -> DeviceArray:
        """Return the depth along the camera's axis [m]: float (h, w) or (worlds, h, w), on the device."""
        from nuno.camera import render

        with self._call():
            return render.render_depth(self, camera)

    def ids(self, camera: Camera) -> DeviceArray:
        """Return which body is seen, its index in ``bodies`` or -1: int (h, w) or (worlds, h, w)."""
        from nuno.camera import render

        with self._call():
            return render.render_ids(self, camera)
