"""Cloth, a soft cube and rigid bodies touch each other: a towel carries two things, a napkin falls over a stack.

Run: python examples/all_kinds.py [picture.png]
"""

import sys

import numpy as np

import nuno

world = nuno.World(device="cpu")
world.add(nuno.box((1.2, 0.8, 0.02), name="table", position=(0.2, 0, -0.01), color="#b08050"))
towel = world.add(nuno.sheet((0.45, 0.45), cells=(20, 20), position=(-0.1, 0, 0.32), color="#c03030"))
box = world.add(nuno.box((0.1, 0.1, 0.05), name="box", position=(-0.18, 0.02, 0.36), color="#4080c0"))
cube = world.add(nuno.soft_box((0.09, 0.09, 0.09), cells=(3, 3, 3), position=(0, -0.02, 0.38), color="#50a050"))
ball = world.add(nuno.sphere(0.05, position=(0.3, 0.2, 0.05), color="#e0a030"))
stack = [world.add(nuno.box((0.11, 0.11, 0.11), position=(0.45, 0, 0.056 + 0.111 * k))) for k in range(3)]
for k, each in enumerate(stack):
    each.rotate(0.25 * k, "z").color = "#8070b0"
napkin = world.add(nuno.sheet((0.36, 0.36), cells=(20, 20), position=(0.43, 0.02, 0.42), color="#f0f0f0"))

world.attach(towel, nuno.Cloth(area_density=0.25, air_drag=3.0))
for corner in np.flatnonzero((np.abs(np.abs(towel.vertices[:, :2] - (-0.1, 0)) - 0.225) < 1e-6).all(axis=1)):
    start = towel.vertices[corner]
    near = start + 0.14 * ((-0.1, 0, 0.32) - start)
    world.grip(towel, [corner], to=nuno.Path([0.0, 0.6], [start, near], interpolation="minimum_jerk"))
world.run(1.0)
world.attach(box, nuno.Rigid(mass=0.12))
world.attach(cube, nuno.Soft(density=150.0, youngs_modulus=8e3, damping=0.01))
for each in (ball, *stack):
    world.attach(each, nuno.Rigid(density=500.0))
world.run(0.5)
world.attach(napkin, nuno.Cloth(area_density=0.2, air_drag=3.0))
world.run(2.0)

print(f"box and cube lie {box.position[2]:.3f} and {cube.position[2]:.3f} m above the table, in the towel")
assert min(box.position[2], cube.position[2]) > 0.15, "the towel carries them"
assert all(abs(each.position[2] - 0.055 - 0.11 * k) < 1e-3 for k, each in enumerate(stack)), "the stack stands"
assert 0.33 < napkin.vertices[:, 2].max() < 0.345, "the napkin lies on it"

if len(sys.argv) > 1:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    import trimesh
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    light = np.array([-0.4, -0.6, 1.0]) / np.linalg.norm([-0.4, -0.6, 1.0])
    triangles, colours = [], []
    for body in world.bodies:
        corners, faces = body.skin()
        corners, faces = trimesh.remesh.subdivide_to_size(corners, faces, 0.03)
        normal = np.cross(corners[faces[:, 1]] - corners[faces[:, 0]], corners[faces[:, 2]] - corners[faces[:, 0]])
        lit = normal @ light / np.linalg.norm(normal, axis=1)
        lit = np.abs(lit) if body.shape.is_cloth else np.clip(lit, 0, 1)
        triangles.append(corners[faces])
        colours.append(np.array(matplotlib.colors.to_rgb(body.color)) * (0.35 + 0.65 * lit[:, None]))
    colours = np.concatenate(colours)
    axes = plt.figure(figsize=(9.6, 5.0)).add_axes([-0.25, -0.75, 1.5, 2.5], projection="3d", computed_zorder=False)
    axes.add_collection3d(Poly3DCollection(np.concatenate(triangles), facecolors=colours, edgecolors=colours, lw=0.3))
    axes.set(xlim=(-0.4, 0.8), ylim=(-0.5, 0.5), zlim=(0, 0.5), proj_type="persp")
    axes.set_box_aspect((1.2, 1.0, 0.5))
    axes.view_init(24, -62)
    axes.set_axis_off()
    plt.savefig(sys.argv[1], dpi=100)
