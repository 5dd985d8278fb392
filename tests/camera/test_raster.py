"""The rasteriser: which pixels a triangle covers, how deep, in any order and on any number of threads."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import trimesh
import warp as wp

from nuno.camera import raster
from nuno.camera.camera import Camera
from nuno.camera.image_region import Region, view
from nuno.errors import InvalidInputError

# looks along +z of the world; 256 px a metre at one metre: multiples of 1/256 m are whole pixels, exactly
PLAIN = Camera(128, 96, 256.0, 256.0, 64.0, 48.0)
MILD = (-0.21, 0.06, 0.0012, -0.0008, 0.01)


def _draw(camera, vertices, faces, *, region=None, layer=None, label=0, ids=False, near=0.01, thickness=0.0):
    region = Region.full(camera) if region is None else region
    vertices = np.asarray(vertices, dtype=np.float32)
    vertices = vertices[None] if vertices.ndim == 2 else vertices
    keys = raster.key_images(len(vertices), region, "cpu", ids=ids)
    if layer is not None:
        raster.clear(keys, layer)
    raster.draw(
        keys, wp.array(vertices, dtype=wp.vec3, device="cpu"), wp.array(faces, dtype=wp.vec3i, device="cpu"),
        view(camera, region, near=near), label, thickness=thickness,
    )  # fmt: skip
    return keys


def _square(x0, y0, x1, y1, z):
    """A square whose corners are at these pixels of PLAIN."""
    corners = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], dtype=float)
    return np.column_stack([(corners - (64.0, 48.0)) * z / 256.0, np.full(4, z)]), np.array([[0, 1, 2], [0, 2, 3]])


@pytest.mark.parametrize("z", [1.0, 2.0])
@pytest.mark.parametrize("turn", [1, -1])
def test_square_is_pixel_exact(z, turn):
    """Pixels are covered when their centre is inside, seen from either side."""
    vertices, faces = _square(20.25, 30.75, 50.5, 40.5, z)
    keys = _draw(PLAIN, vertices, faces[:, ::turn])
    expected = np.zeros((96, 128), dtype=bool)
    expected[31:41, 21:51] = True
    np.testing.assert_array_equal(raster.masks_of(keys).numpy()[0], expected)
    depth = raster.depths_of(keys).numpy()[0]
    assert (depth[~expected] == np.inf).all()
    np.testing.assert_allclose(depth[expected], z, atol=0.6 * raster.DEPTH_STEP)  # half a step, and rounding


def test_centres_on_an_edge_belong_to_the_top_and_left():
    """A square with corners on pixel centres covers its left and top edge, not the others."""
    keys = _draw(PLAIN, *_square(20, 30, 50, 40, 1.0))
    expected = np.zeros((96, 128), dtype=bool)
    expected[30:40, 20:50] = True
    np.testing.assert_array_equal(raster.masks_of(keys).numpy()[0], expected)


def test_shared_edges_neither_leave_gaps_nor_overlap():
    """Every pixel inside a jittered triangulation is covered by exactly one of its triangles."""
    rng = np.random.default_rng(3)
    nx, ny = 14, 10
    x, y = np.meshgrid(np.linspace(5, 120, nx), np.linspace(5, 90, ny))
    points = np.stack([x, y], axis=-1)
    points[1:-1, 1:-1] += rng.uniform(-3, 3, (ny - 2, nx - 2, 2))
    points[3:6, 3:6] = np.rint(points[3:6, 3:6])  # some corners on pixel centres
    z = rng.uniform(0.8, 2.0, (ny, nx))
    vertices = np.concatenate([(points - (64, 48)) * z[..., None] / 256.0, z[..., None]], axis=-1).reshape(-1, 3)
    a = (np.arange(ny - 1)[:, None] * nx + np.arange(nx - 1)).ravel()
    faces = np.concatenate([np.stack([a, a + 1, a + nx], 1), np.stack([a + 1, a + nx, a + nx + 1], 1)])
    each = raster.masks_of(_draw(PLAIN, vertices[faces], [[0, 1, 2]])).numpy()  # a world a triangle
    expected = np.zeros((96, 128), dtype=int)
    expected[5:90, 5:120] = 1
    np.testing.assert_array_equal(each.sum(axis=0), expected)


def test_sphere_has_the_area_and_depth_of_the_closed_form():
    """A sphere's silhouette on the axis is a circle of radius f R / sqrt(d^2 - R^2)."""
    camera = Camera(320, 240, 500.0, 500.0, 160.2, 119.7)
    ball, distance = trimesh.creation.icosphere(subdivisions=5, radius=0.1), 1.0
    keys = _draw(camera, ball.vertices + np.array((0, 0, distance)), ball.faces)
    # the mesh is inscribed: a face's centre lies edge^2 / 6 R inside (circumradius edge / sqrt(3))
    sag = (ball.edges_unique_length.max() / 0.1) ** 2 / 6.0
    radius = 500.0 * 0.1 / np.sqrt(distance**2 - 0.1**2)
    area = np.pi * radius**2
    # lattice points of a circle of 50 px scatter by about its radius to the power 2/3
    assert abs(raster.masks_of(keys).numpy().sum() - area) < 2.0 * sag * area + radius ** (2.0 / 3.0)

    v, u = np.mgrid[:240, :320]
    rays = camera.rays(np.stack([u, v], axis=-1))
    b, c = rays[..., 2] * distance, distance**2 - 0.1**2
    a = (rays**2).sum(axis=-1)
    expected = (b - np.sqrt(np.maximum(b * b - a * c, 0.0))) / a
    core = np.hypot(u - camera.cx, v - camera.cy) < 0.7 * radius
    # at 0.7 R the surface is tilted by 45 degrees: sag / cos, half a depth step with rounding, and corners
    # snapped by 1/512 px of 1/500 m
    limit = 1.5 * sag * 0.1 + 0.6 * raster.DEPTH_STEP + 1.0 / 512 / 500
    assert np.abs(raster.depths_of(keys).numpy()[0] - expected)[core].max() < limit


@pytest.mark.parametrize("ids", [False, True])
def test_depth_of_nothing_is_infinite(ids):
    """Of masks' keys and of bodies', and by a kernel that was declared: another would compile the module again."""
    before = dict(raster._to_depths.overloads)
    keys = raster.key_images(1, Region(0, 0, 4, 3), "cpu", ids=ids)
    assert np.isposinf(raster.depths_of(keys).numpy()).all()
    assert raster._to_depths.overloads == before


def test_depth_is_perspective_correct():
    """A tilted plane has the depth at which rays meet it, everywhere."""
    vertices = np.array([(-1.0, -1.0, 0.8), (1.0, -1.0, 1.4), (1.0, 1.0, 3.4), (-1.0, 1.0, 2.8)])
    depth = raster.depths_of(_draw(PLAIN, vertices, [[0, 1, 2], [0, 2, 3]])).numpy()[0]
    normal = np.cross(vertices[1] - vertices[0], vertices[3] - vertices[0])
    v, u = np.mgrid[:96, :128]
    expected = vertices[0] @ normal / (PLAIN.rays(np.stack([u, v], axis=-1)) @ normal)
    seen = np.isfinite(depth)
    assert seen.sum() > 5000
    # corners are snapped by 1/512 px at most: times the slope of the depth, here below 0.03 m a pixel
    assert np.abs(depth - expected)[seen].max() < 0.6 * raster.DEPTH_STEP + 0.03 / 512.0


@pytest.mark.parametrize("pitch", [0.3, 0.9])
def test_triangles_are_cut_at_the_near_plane(pitch):
    """A floor that reaches from behind the camera to the front is seen wherever a ray meets it."""
    pose = np.eye(4)
    c, s = np.cos(pitch), np.sin(pitch)
    pose[:3, :3] = np.column_stack([(0, -1, 0), (-s, 0, -c), (c, 0, -s)])
    pose[2, 3] = 0.6
    camera = Camera(160, 120, 90.0, 90.0, 79.5, 59.5, camera_to_world=pose)
    floor = np.array([(-3.1, -2.07, 0), (4.3, -2.07, 0), (4.3, 1.93, 0), (-3.1, 1.93, 0)], dtype=float)
    for faces in ([[0, 1, 2], [0, 2, 3]], [[3, 0, 1], [1, 2, 3]], [[1, 2, 0], [3, 0, 2]]):
        keys = _draw(camera, floor, faces)
        v, u = np.mgrid[:120, :160]
        rays = camera.rays(np.stack([u, v], axis=-1))
        with np.errstate(divide="ignore"):
            depth = np.where(rays[..., 2] < 0.0, -0.6 / rays[..., 2], np.inf)
        with np.errstate(invalid="ignore"):
            x, y = rays[..., 0] * depth, rays[..., 1] * depth
        expected = (np.abs(x - 0.6) < 3.7) & (np.abs(y + 0.07) < 2.0)
        mask = raster.masks_of(keys).numpy()[0]
        assert expected.sum() > 5000
        assert (mask ^ expected).sum() <= 3  # a pixel's centre may lie within the snapping of the outline
        both = mask & expected
        relative = np.abs(raster.depths_of(keys).numpy()[0][both] / depth[both] - 1.0)
        # snapping (1/512 px) moves the horizon-near rows most: a row there is up to 20 % of the depth
        assert relative.max() < 0.2 / 512.0 + 1e-5


def test_what_is_behind_or_not_finite_is_not_drawn():
    """Triangles behind the camera, and vertices that are NaN or infinite, leave the image as it was."""
    vertices, faces = _square(20, 30, 50, 40, 1.0)
    for broken in (
        vertices * (1, 1, -1),
        np.full((4, 3), np.nan),
        np.where(vertices == 1.0, np.inf, vertices),
    ):
        assert not raster.masks_of(_draw(PLAIN, broken, faces)).numpy().any()


def test_thickness_widens_a_sheet_seen_edge_on():
    """A sheet along the line of sight is seen as wide as it is thick."""
    sheet = np.array([(-0.1, 0.001, 1.0), (0.1, 0.001, 1.0), (0.1, 0.001, 1.2), (-0.1, 0.001, 1.2)])
    faces = [[0, 1, 2], [0, 2, 3]]
    thin = raster.masks_of(_draw(PLAIN, sheet, faces)).numpy()[0]
    thick = raster.masks_of(_draw(PLAIN, sheet, faces, thickness=0.04)).numpy()[0]
    rows = np.flatnonzero(thick[:, 64])
    assert not thin.any()
    # from y = -19 to 21 mm at 1 m: rows 48 - 4.9 to 48 + 5.4
    np.testing.assert_array_equal(rows, np.arange(44, 54))


def _wrinkled(worlds, n=17, seed=5):
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(-0.2, 0.2, n), np.linspace(-0.15, 0.15, n))
    flat = np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3)
    a = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate([np.stack([a, a + 1, a + n], 1), np.stack([a + 1, a + n, a + n + 1], 1)])
    return (flat + rng.normal(scale=0.02, size=(worlds, n * n, 3))).astype(np.float32), faces.astype(np.int32)


@pytest.mark.parametrize("ids", [False, True])
def test_batch_has_the_bits_of_single_worlds(ids):
    """World k of a batch is, bit for bit, what it is alone, and the order of triangles does not matter."""
    positions, faces = _wrinkled(7)
    together = _draw(PLAIN, positions, faces, ids=ids).numpy()
    shuffled = np.random.default_rng(0).permutation(faces)
    for k in range(7):
        assert (_draw(PLAIN, positions[k], shuffled, ids=ids).numpy()[0] == together[k]).all()


def test_threads_have_the_bits_of_one():
    """Slices of worlds drawn by several threads at once give the same keys."""
    positions, faces = _wrinkled(12)
    expected = _draw(PLAIN, positions, faces).numpy()
    raster.load("cpu")
    seen = view(PLAIN)
    keys = raster.key_images(12, Region.full(PLAIN), "cpu")
    points = wp.array(positions, dtype=wp.vec3, device="cpu")
    triangles = wp.array(faces, dtype=wp.vec3i, device="cpu")
    with ThreadPoolExecutor(4) as pool:
        jobs = [
            pool.submit(raster.draw, keys[k : k + 3], points[k : k + 3], triangles, seen, 0) for k in range(0, 12, 3)
        ]
        for job in jobs:
            job.result()
    assert (keys.numpy() == expected).all()


@pytest.mark.cuda
@pytest.mark.skipif(not wp.is_cuda_available(), reason="needs a CUDA device")
@pytest.mark.parametrize("ids", [False, True])
def test_cuda_repeats_its_bits_and_agrees_with_the_cpu(ids):
    """On CUDA every run and every batch position gives the same bits; the CPU differs by rounding only."""
    positions, faces = _wrinkled(64)
    region = Region.full(PLAIN)

    def drawn(batch):
        keys = raster.key_images(len(batch), region, "cuda", ids=ids)
        triangles = wp.array(faces, dtype=wp.vec3i, device="cuda")
        raster.draw(keys, wp.array(batch, dtype=wp.vec3, device="cuda"), triangles, view(PLAIN), 0)
        return keys

    first = drawn(positions)
    assert (drawn(positions).numpy() == first.numpy()).all()
    assert (drawn(positions[5:6]).numpy()[0] == first.numpy()[5]).all()
    here = np.nan_to_num(raster.depths_of(_draw(PLAIN, positions, faces, ids=ids)).numpy(), posinf=0.0)
    there = np.nan_to_num(raster.depths_of(first).numpy(), posinf=0.0)
    # fused multiply-adds may snap a corner to the next 1/256 px: few pixels change at folds and outlines
    assert (np.abs(here - there) > 1e-3).sum() < 1e-3 * here.size


def test_region_is_a_cutout_of_the_whole_image():
    """Drawing a region gives the same pixels as cutting them out."""
    positions, faces = _wrinkled(2)
    region = Region(37, 21, 50, 33)
    whole = _draw(PLAIN, positions, faces).numpy()
    part = _draw(PLAIN, positions, faces, region=region).numpy()
    assert (part == whole[:, 21:54, 37:87]).all()


def test_layers_hide_and_are_hidden():
    """What is drawn over a layer is seen where it is nearer; at equal depth the wanted body is."""
    layer = _draw(PLAIN, *_square(10, 10, 60, 60, 1.0), label=1)
    nearer = raster.masks_of(_draw(PLAIN, *_square(20, 20, 90, 30, 0.5), layer=layer)).numpy()[0]
    farther = raster.masks_of(_draw(PLAIN, *_square(20, 20, 90, 30, 1.5), layer=layer)).numpy()[0]
    equal = raster.masks_of(_draw(PLAIN, *_square(20, 20, 90, 30, 1.0), layer=layer)).numpy()[0]
    assert nearer.sum() == equal.sum() == 70 * 10
    assert farther.sum() == 30 * 10 and not farther[:, :60].any()


@pytest.mark.parametrize("distortion", [MILD, (0.1, -0.02, 0.001, 0.002), (0.3, 0.1, 0, 0, 0, 0.2, 0.05, 0.01)])
def test_distortion_is_opencvs(distortion):
    """A finely divided square covers the pixels whose undistorted rays meet it."""
    camera = Camera(320, 240, 250.0, 250.0, 161.0, 118.0, distortion=distortion)
    sheet = trimesh.Trimesh(
        [(-0.5, -0.4, 1), (0.45, -0.4, 1), (0.45, 0.38, 1), (-0.5, 0.38, 1)], [[0, 1, 2], [0, 2, 3]]
    )
    for _ in range(5):
        sheet = sheet.subdivide()
    mask = raster.masks_of(_draw(camera, sheet.vertices, sheet.faces)).numpy()[0]
    v, u = np.mgrid[:240, :320].astype(float)
    x, y, _ = np.moveaxis(camera.rays(np.stack([u, v], axis=-1)), -1, 0)
    expected = (x > -0.5) & (x < 0.45) & (y > -0.4) & (y < 0.38)
    # cv2's inverse is good to 0.01 px and edges are straight over 8 px: of an outline of 800 px, few centres
    assert (mask ^ expected).sum() <= 16


def test_points_far_outside_a_distorted_view_do_not_come_back():
    """A polynomial that turns back far off the axis draws nothing into the image."""
    camera = Camera(320, 240, 250.0, 250.0, 161.0, 118.0, distortion=(-0.3, 0.0, 0.0, 0.0))
    triangle = np.array([(1.7, 0.0, 1.0), (1.9, 0.0, 1.0), (1.8, 0.1, 1.0)])  # r (1 - 0.3 r^2) is 0.2 there
    assert not raster.masks_of(_draw(camera, triangle, [[0, 1, 2]])).numpy().any()


def test_bad_arguments_are_refused():
    """Shapes, labels and regions that do not fit are named."""
    vertices, faces = _square(20, 30, 50, 40, 1.0)
    with pytest.raises(InvalidInputError, match="inside an image of 128 x 96"):
        view(PLAIN, Region(100, 0, 40, 10))
    with pytest.raises(InvalidInputError, match="near"):
        view(PLAIN, near=0.0)
    with pytest.raises(InvalidInputError, match="labels 0 to 1, got 2"):
        _draw(PLAIN, vertices, faces, label=2)
    with pytest.raises(InvalidInputError, match="thickness"):
        _draw(PLAIN, vertices, faces, thickness=-1.0)
    with pytest.raises(InvalidInputError, match="14 coefficients"):
        view(Camera(10, 10, 5.0, 5.0, 5.0, 5.0, distortion=np.ones(14)))
    keys = raster.key_images(2, Region.full(PLAIN), "cpu")
    points = wp.array(vertices[None], dtype=wp.vec3, device="cpu")
    triangles = wp.array(faces, dtype=wp.vec3i, device="cpu")
    with pytest.raises(InvalidInputError, match="2 key images"):
        raster.draw(keys, points, triangles, view(PLAIN), 0)
    with pytest.raises(InvalidInputError, match="view of"):
        raster.draw(keys[:1], points, triangles, view(PLAIN, Region(0, 0, 8, 8)), 0)
    with pytest.raises(InvalidInputError, match="does not fit"):
        raster.clear(keys, raster.key_images(1, Region(0, 0, 8, 8), "cpu"))
    with pytest.raises(InvalidInputError, match="world"):
        raster.key_images(0, Region.full(PLAIN), "cpu")


def test_faces_by_their_own_index():
    """With label None a key names the face in front: the nearer of two squares, by its two triangles."""
    far, faces = _square(8, 8, 40, 40, 2.0)
    near, _ = _square(24, 8, 40, 40, 1.0)
    keys = _draw(PLAIN, np.concatenate([far, near]), np.concatenate([faces, faces + 4]), label=None, ids=True)
    ids = raster.ids_of(keys).numpy()[0]
    assert set(np.unique(ids[9:39, 9:23])) == {0, 1} and set(np.unique(ids[9:39, 25:39])) == {2, 3}
    assert (ids[50:] == -1).all()
    with pytest.raises(InvalidInputError, match="int32 keys take labels 0 to 1, got 3"):
        _draw(PLAIN, np.concatenate([far, near]), np.concatenate([faces, faces + 4]), label=None)
