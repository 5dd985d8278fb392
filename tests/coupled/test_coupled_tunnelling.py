"""Nothing passes through another body that moves, however fast."""

import numpy as np

import nuno


def test_a_sheet_at_5_metres_a_second_stays_on_a_box():
    """A sheet moves 8 cm a frame, eight times the box's height, and ends on top of it."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane())
    box = world.add(nuno.box((0.3, 0.3, 0.01), position=(0.0, 0.0, 0.0051)))
    sheet = world.add(nuno.sheet((0.12, 0.12), (8, 8), position=(0.0, 0.0, 0.3)))
    world.attach(box, nuno.Rigid(mass=0.5))
    world.attach(sheet, nuno.Cloth(area_density=0.2, air_drag=0.0))
    world.push(sheet, (0.0, 0.0, -0.2 * 0.12**2 * 150.0), duration=1.0 / 30.0)  # to 5 m/s in two frames
    world.run(1.0 / 30.0)
    assert sheet.velocities[:, 2].mean() < -5.0
    world.run(0.5)
    low = box.position[2] + 0.005
    # half the thickness of 4 mm, less a quarter millimetre where the box's edge is bent around
    assert sheet.vertices[:, 2].min() > low + 0.00175
    assert sheet.vertices[:, 2].max() < low + 0.06


def test_a_fast_ball_does_not_pass_a_hanging_cloth():
    """A ball of 2 m/s hits a cloth that is held at its upper edge: the cloth bulges and stays on its side."""
    world = nuno.World(device="cpu", gravity=(0.0, 0.0, -9.81))
    cloth = world.add(nuno.sheet((0.4, 0.4), (16, 16), position=(0.0, 0.0, 0.6)).rotate(np.pi / 2, "x"))
    world.attach(cloth, nuno.Cloth(area_density=0.3))
    top = np.flatnonzero(cloth.vertices[:, 2] > 0.6 + 0.2 - 1e-6)
    for each in top:
        world.grip(cloth, [each], to=cloth.vertices[each])
    ball = world.add(nuno.sphere(0.05, position=(0.0, -0.12, 0.62)))
    world.attach(ball, nuno.Rigid(mass=0.2))
    world.push(ball, (0.0, 0.2 * 60.0, 0.0), duration=1.0 / 30.0)
    world.run(1.0 / 30.0)
    assert np.linalg.norm(ball._dynamics.solver.velocity(ball._dynamics.slot)[0]) > 1.9
    hit = 0.0
    for _ in range(10):
        world.step()
        away = np.linalg.norm(cloth.vertices - ball.position, axis=1)
        assert away.min() > 0.05 + 0.75 * 0.002  # half the thickness, less a quarter for the passes of one substep
        hit = max(hit, cloth.vertices[:, 1].max())
    assert hit > 0.03  # it was hit
