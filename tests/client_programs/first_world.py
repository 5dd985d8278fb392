"""A cloth on a table, held by a corner: what a first program calls, with lists where lists are natural."""

import numpy as np

import nuno


def room() -> tuple[nuno.World, nuno.Body]:
    """Return a world and the cloth in it."""
    world = nuno.World(device="cpu", substeps=5)
    world.add(nuno.plane(name="floor"))
    world.add(nuno.box((0.3, 0.3, 0.02), color="brown", position=[0, 0, 0.1]))
    cloth = world.add(nuno.sheet((0.2, 0.2), cells=(3, 3), name="cloth", position=(0, 0, 0.12)))
    world.attach(cloth, nuno.Cloth.preset("towel"), velocity=(0, 0, 0.1))
    return world, cloth


def lift(world: nuno.World, cloth: nuno.Body) -> np.ndarray:
    """Lift a corner, and return where the vertices are then."""
    path = nuno.Path([0, 0.2], [[0, 0, 0.12], (0.1, 0, 0.2)], [(1, 0, 0, 0), (1, 0, 0, 0)], "minimum_jerk")
    grip: nuno.Grip = world.grip(cloth, cloth.at(0.0, 1.0), to=path)
    times: list[float] = []
    world.run(0.2, each_frame=times.append)
    force: np.ndarray = grip.wrench[0]
    grip.release()
    film = world.trace(cloth, world.time + np.array([0.05, 0.1]))
    assert len(times) == 12 and force.shape[-1] == 3 and film.shape == (2, 16, 3)
    found = world.contacts(cloth)
    assert len(found.forces) == len(found.others)
    return cloth.vertices


def look(world: nuno.World) -> nuno.Picture:
    """Take a picture, with a camera that looks at the cloth and one of numbers alone."""
    camera = nuno.Camera.look_at((0.3, -0.4, 0.5), (0, 0, 0.1), np.pi / 3, width=16, height=12)
    down = nuno.Camera(16, 12, 20, 20, 7.5, 5.5, [[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 1], [0, 0, 0, 1]])
    share: float = world.segment(down, "cloth")["cloth"].numpy().mean()
    assert 0.0 < share < 1.0 < world.depth(camera).numpy().min() + 1.0
    return nuno.take_picture(world, camera, lamp=nuno.Lamp(position=(0.0, 0.0, 2.0)))


def main() -> None:
    """Run it."""
    world, cloth = room()
    highest: float = lift(world, cloth)[:, 2].max()
    assert highest > 0.12
    look(world)


if __name__ == "__main__":
    main()
