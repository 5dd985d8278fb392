"""Planning: pushes are tried in imagined worlds, silhouettes compared, the best adopted, single worlds reset."""

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

import nuno
from nuno import BodyStateError, NunoError

Score = Callable[[nuno.World, nuno.Body], npt.NDArray[np.float64]]


def try_pushes(world: nuno.World, body: nuno.Body, speeds: Sequence[float], score: Score) -> int:
    """Give each imagined world a speed, and become the one with the best score."""
    futures = world.imagine(len(speeds))
    start: nuno.Snapshot = futures.save()
    velocity = np.array([(speed, 0.0, 0.0) for speed in speeds])
    futures.set_velocity(body, velocity)
    futures.run(0.1)
    best = int(score(futures, body).argmax())
    futures.reset([best], start)
    futures.reset(np.arange(len(speeds)) == 0, start)
    futures.set_pose(body, (0, 0, 0.3), worlds=[1])
    positions = np.from_dlpack(futures.state(body, copy=False)["positions"])
    assert positions.shape[0] == len(speeds) == len(futures.clock)
    world.adopt(futures, best)
    return best


def seen_alike(camera: nuno.Camera, real: npt.NDArray[np.bool_]) -> Score:
    """Return a score by the likeness to a mask."""

    def score(futures: nuno.World, body: nuno.Body) -> npt.NDArray[np.float64]:
        alike: npt.NDArray[np.float64] = nuno.similarity(futures.masks(camera, body), real)
        return alike

    return score


def main() -> None:
    """Run it."""
    world = nuno.World(device="cpu", gravity=(0, 0, 0))
    ball = world.add(nuno.sphere(0.05, position=(0, 0, 0.3)))
    try:
        world.detach(ball)
    except BodyStateError as error:
        assert isinstance(error, NunoError)
    world.attach(ball, nuno.Rigid(mass=0.1, restitution=0.5))
    camera = nuno.Camera.look_at((0, -1, 0.3), (0, 0, 0.3), 0.5, width=32, height=24)
    score = seen_alike(camera, world.masks(camera, ball).numpy())
    assert try_pushes(world, ball, [0.5, 0.0, -0.5], score) == 1


if __name__ == "__main__":
    main()
