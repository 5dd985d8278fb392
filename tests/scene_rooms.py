"""Worlds that tests of scenes save and load: a hinged door with a box and a towel, and one of every shape and joint."""

import numpy as np

import nuno


def door_room(device="cpu"):
    """A door on a frame, a box that flies, and a towel held at a corner."""
    world = nuno.World(device=device)
    world.add(nuno.plane(name="floor"))
    frame = world.add(nuno.box((0.04, 0.04, 1.0), name="frame", position=(-0.42, 0, 0.5)))
    door = world.add(nuno.box((0.8, 0.03, 0.9), name="door", position=(0, 0, 0.5), color="#a07040"))
    crate = world.add(nuno.box((0.1, 0.12, 0.14), name="crate", position=(0.1, 0.4, 0.3), friction=0.4))
    towel = world.add(nuno.sheet((0.4, 0.3), (8, 6), name="towel", position=(0.1, 0.5, 0.8)))
    world.attach(door, nuno.Rigid(density=300.0))
    world.attach(crate, nuno.Rigid(mass=0.5, friction=0.4), velocity=(0.1, 0, 0.2), angular_velocity=(0, 1, 0))
    world.attach(towel, nuno.Cloth.preset("denim"))
    nuno.hinge(
        door, frame, point=(-0.4, 0, 0.5), axis=(0, 0, 1), limits=(-1.5, 1.5), friction=0.01, position=0.3,
        motor=nuno.Motor(position=1.0, stiffness=5.0, damping=1.0, max_effort=3.0),
    )  # fmt: skip
    world.grip(towel, [0], to=towel.vertices[0])
    return world


def every_kind(device="cpu"):
    """One body of every shape that formats have, and one joint of every kind; nothing touches, and nothing falls."""
    world = nuno.World(device=device, gravity=(0.0, 0.0, 0.0))
    rng = np.random.default_rng(3)
    cube = [[x, y, z] for x in (0.0, 0.1) for y in (0.0, 0.2) for z in (0.0, 0.3)]
    hull = nuno.Hull.of(np.array([*cube, [0.2, 0.1, 0.1]]))
    shapes = {
        "box": nuno.Box((0.1, 0.2, 0.3)), "ball": nuno.Sphere(0.1), "can": nuno.Cylinder(0.05, 0.2),
        "pill": nuno.Capsule(0.05, 0.2), "hull": hull, "mesh": nuno.TriangleMesh(hull.vertices, hull.faces),
        "hammer": nuno.Compound(
            ((nuno.Box((0.3, 0.03, 0.03)),), (nuno.Cylinder(0.04, 0.1), (0.15, 0.0, 0.0), (0.6, 0.8, 0.0, 0.0)))
        ),
    }  # fmt: skip
    for k, (name, shape) in enumerate(shapes.items()):
        for j, kind in enumerate(("static", "moving")):
            turn = rng.normal(size=4)
            body = world.add(nuno.Body(shape, name=f"{kind} {name}", position=(k, j, 1.0), quaternion=turn))
            if kind == "moving":
                world.attach(body, nuno.Rigid(density=500.0 + 10.0 * k, air_drag=0.1, restitution=0.2))
    anchor = world.add(nuno.box((0.1, 0.1, 0.1), name="anchor", position=(0, 3, 1)))
    bars = [world.add(nuno.box((0.3, 0.05, 0.04), name=f"bar {k}", position=(0.4 + 0.4 * k, 3, 1))) for k in range(4)]
    for bar in bars:
        world.attach(bar, nuno.Rigid(density=800.0))
    nuno.hinge(
        bars[0], anchor, point=(0.2, 3, 1), axis=(0, 1, 1), limits=(-0.5, 1.0), position=0.25,
        spring=nuno.Spring(2.0, 0.1, 0.3),
    )  # fmt: skip
    nuno.slider(bars[1], bars[0], axis=(1, 0, 0.5), limits=(-0.1, 0.2), position=0.05, friction=0.4)
    nuno.ball_joint(bars[2], bars[1], point=(1.0, 3, 1), limit=0.8, spring=nuno.Spring(0.2, damping=0.01))
    nuno.fixed_joint(bars[3], bars[2])
    pendulum = world.add(nuno.capsule(0.03, 0.2, name="pendulum", position=(2.5, 3, 1)))
    world.attach(pendulum, nuno.Rigid(mass=0.3))
    nuno.hinge(pendulum, None, point=(2.5, 3, 1.1), axis=(0, 1, 0), motor=nuno.Motor(0.5, damping=2.0, max_effort=4.0))
    sheet = world.add(nuno.sheet((0.3, 0.2), (5, 4), name="sheet", position=(0, 5, 1)))
    world.attach(sheet, nuno.Cloth(stretch_stiffness=(900.0, 700.0), area_density=0.3, thickness=0.002, friction=0.3))
    points, faces = sheet.vertices, sheet.faces
    cut = world.add(nuno.cloth_mesh(points + np.array((1.0, 0, 0)), faces, rest=points * (1.02, 1.0, 1.0), name="cut"))
    world.attach(cut, nuno.Cloth(area_density=0.15))
    cube = world.add(nuno.soft_box((0.1, 0.1, 0.1), (2, 2, 2), name="soft", position=(2, 5, 1)))
    world.attach(cube, nuno.Soft.preset("gel"))
    still = world.add(nuno.sheet((0.2, 0.2), (2, 2), name="still", position=(3, 5, 1)))
    world.attach(still)
    world.set_vertices(still, still.vertices + 0.05 * np.sin(9.0 * still.vertices[:, :1]) * (0, 0, 1))
    world.detach(still)
    world.ignore_contact("moving box", "moving ball")
    world.set_friction("moving box", "static box", 0.9)
    return world
