"""USD files of other programs: units, axes, UsdPhysics' masses, joints and filters, and what is left out by name."""

import numpy as np
import pytest

import nuno

pxr = pytest.importorskip("pxr")

HEAD = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = {unit}
    kilogramsPerUnit = {mass}
    upAxis = "{up}"
)
"""
# a crate of 20 cm x 40 cm x 60 cm, the last upwards, on a door's hinge of 90 degrees
CRATE = """
def Xform "World" {
    def PhysicsScene "scene" { vector3f physics:gravityDirection = (0, -1, 0)
        float physics:gravityMagnitude = 981 }
    def Xform "crate" ( prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"] ) {
        double3 xformOp:translate = (100, 50, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        float physics:mass = 3000
        vector3f physics:velocity = (0, 100, 0)
        vector3f physics:angularVelocity = (0, 180, 0)
        def Cube "shape" ( prepend apiSchemas = ["PhysicsCollisionAPI"] ) {
            double size = 2
            color3f[] primvars:displayColor = [(1, 0.5, 0)]
            float3 xformOp:scale = (10, 30, 20)
            uniform token[] xformOpOrder = ["xformOp:scale"]
        }
    }
    def PhysicsRevoluteJoint "hinge" ( prepend apiSchemas = ["PhysicsDriveAPI:angular"] ) {
        rel physics:body1 = </World/crate>
        uniform token physics:axis = "Y"
        point3f physics:localPos0 = (90, 50, 0)
        point3f physics:localPos1 = (-10, 0, 0)
        float physics:lowerLimit = -90
        float physics:upperLimit = 45
        float drive:angular:physics:stiffness = 100000
        float drive:angular:physics:targetPosition = 30
        uniform token drive:angular:physics:type = "force"
    }
}
"""


def load(tmp_path, text, unit=1.0, mass=1.0, up="Z"):
    """Return the scene of a text."""
    lines = text.replace("{", "{\n").replace("}", "\n}\n")  # USD ends statements by lines
    (tmp_path / "scene.usda").write_text(HEAD.format(unit=unit, mass=mass, up=up) + lines)
    world = nuno.World(device="cpu", gravity=(0.0, 0.0, -9.81))
    return nuno.load_scene(tmp_path / "scene.usda", world)


def test_centimetres_grams_and_y_up_become_metres_kilograms_and_z_up(tmp_path):
    """Places, sizes, masses, velocities, limits and gains, each by its own power of the units."""
    scene = load(tmp_path, CRATE, 0.01, 0.001, "Y")
    crate = scene.bodies["crate"]
    np.testing.assert_allclose(crate.position, (1.0, 0.0, 0.5), atol=1e-12)
    low, high = crate.vertices.min(axis=0), crate.vertices.max(axis=0)
    np.testing.assert_allclose(high - low, (0.2, 0.4, 0.6), atol=1e-7)
    assert crate.mass == pytest.approx(3.0)
    # a box's: m / 12 (b^2 + c^2)
    np.testing.assert_allclose(np.diag(crate.inertia), 3.0 / 12.0 * np.array([0.52, 0.4, 0.2]), rtol=1e-6)
    np.testing.assert_allclose(crate.velocity, (0, 0, 1.0), atol=1e-7)
    np.testing.assert_allclose(crate.angular_velocity, (0, 0, np.pi), atol=1e-6)
    assert crate.color == pytest.approx((1, 0.5, 0))
    assert "the world keeps its own gravity" not in scene.report.notes
    joint = scene.joints["hinge"]
    np.testing.assert_allclose(joint.limits, (-np.pi / 2, np.pi / 4), atol=1e-7)
    # 1e5 g cm2/s2 a degree are 1e-2 N m a degree
    assert joint.motor.stiffness == pytest.approx(0.01 * 180.0 / np.pi)
    assert joint.motor.position == pytest.approx(np.pi / 6)
    spec = scene.world.save().grips[0].spec
    np.testing.assert_allclose(spec.other_place, [[0.9, 0.0, 0.5]], atol=1e-7)


def test_the_other_end_of_a_joint_counts_the_same_way(tmp_path):
    """body0 moves and the world is body1: the axis is turned about, the position stays."""
    swapped = CRATE.replace("rel physics:body1", "rel physics:body0")
    swapped = swapped.replace("localPos0 = (90, 50, 0)", "localPos0 = (-10, 0, 0)")
    swapped = swapped.replace("localPos1 = (-10, 0, 0)\n        float", "localPos1 = (90, 50, 0)\n        float")
    swapped = swapped.replace(
        "float physics:lowerLimit",
        "quatf physics:localRot1 = (0.70710678, 0, 0.70710678, 0)\n float physics:lowerLimit",
    )
    swapped = swapped.replace("lowerLimit = -90", "lowerLimit = -9").replace("upperLimit = 45", "upperLimit = 120")
    joint = load(tmp_path, swapped, 0.01, 0.001, "Y").joints["hinge"]
    # the frame in body1 (the world) is 90 degrees on, about the axis
    assert joint.position == pytest.approx(np.pi / 2, abs=1e-6)
    scene_axis = joint.spec.other_turn[0]
    np.testing.assert_allclose(
        nuno.Coordinates((0, 0, 0), scene_axis).to_world([(0, 0, 1.0)])[0], (0, 0, -1), atol=1e-6
    )


def test_density_and_open_masses(tmp_path):
    """A collider's density, a material's, and 1000 kg/m3 of what says none."""
    body = """
    def Xform "{name}" ( prepend apiSchemas = ["PhysicsRigidBodyAPI"] ) {{
        def Sphere "s" ( prepend apiSchemas = ["PhysicsCollisionAPI", "PhysicsMassAPI", "MaterialBindingAPI"] ) {{
            double radius = 0.1
            {what}
        }}
    }}"""
    material = """
    def Material "steel" ( prepend apiSchemas = ["PhysicsMaterialAPI"] ) { float physics:density = 7800
        float physics:dynamicFriction = 0.3 }"""
    bound = "rel material:binding:physics = </World/steel>"
    bodies = [body.format(name=n, what=w) for n, w in (("a", ""), ("b", "float physics:density = 500"), ("c", bound))]
    scene = load(tmp_path, 'def Xform "World" {' + "".join(bodies) + material + "}")
    volume = 4.0 / 3.0 * np.pi * 0.1**3
    masses = [scene.bodies[name].mass for name in "abc"]
    np.testing.assert_allclose(masses, np.array([1000.0, 500.0, 7800.0]) * volume, rtol=1e-6)
    assert scene.bodies["c"].friction == pytest.approx(0.3)


def test_shapes_that_are_stretched_mirrored_or_none(tmp_path):
    """An ellipsoid is a hull, a mirrored mesh still looks outwards, a cone is a hull; curves are left out by name."""
    text = """def Xform "World" {
    def Sphere "egg" ( prepend apiSchemas = ["PhysicsCollisionAPI"] ) { double radius = 0.1
        float3 xformOp:scale = (1, 2, 3)
        uniform token[] xformOpOrder = ["xformOp:scale"] }
    def Cone "hat" ( prepend apiSchemas = ["PhysicsCollisionAPI"] ) { double radius = 0.1
        double height = 0.3
        uniform token axis = "Y" }
    def Capsule "pill" ( prepend apiSchemas = ["PhysicsCollisionAPI"] ) { double radius = 0.1
        double height = 0.5
        uniform token axis = "X" }
    def Mesh "wedge" ( prepend apiSchemas = ["PhysicsCollisionAPI"] ) {
        point3f[] points = [(0,0,0), (1,0,0), (0,1,0), (0,0,1)]
        int[] faceVertexCounts = [3, 3, 3, 3]
        int[] faceVertexIndices = [0,2,1, 0,1,3, 0,3,2, 1,2,3]
        float3 xformOp:scale = (-1, 1, 1)
        uniform token[] xformOpOrder = ["xformOp:scale"] }
    def BasisCurves "hair" { }
    }"""
    scene = load(tmp_path, text)
    egg = scene.bodies["egg"].vertices
    np.testing.assert_allclose(egg.max(axis=0), (0.1, 0.2, 0.3), rtol=1e-2)  # a round shape's corners
    np.testing.assert_allclose(scene.bodies["hat"].vertices.max(axis=0)[1], 0.15, rtol=1e-6)
    assert isinstance(scene.bodies["pill"].shape, nuno.Capsule)
    pill = scene.bodies["pill"].vertices
    np.testing.assert_allclose(pill.max(axis=0) - pill.min(axis=0), (0.7, 0.2, 0.2), rtol=1e-6)
    assert scene.bodies["wedge"].is_solid and scene.bodies["wedge"].vertices[:, 0].min() == pytest.approx(-1.0)
    assert scene.report.notes["curves are left out"] == ("hair",)
    assert set(scene.report.notes["an ellipsoid is a hull"]) == {"egg"}


def test_filters_and_groups(tmp_path):
    """Filtered pairs, and collision groups that pass through each other."""
    text = """def Xform "World" {
    def Cube "a" ( prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsCollisionAPI", "PhysicsFilteredPairsAPI"] ) {
        rel physics:filteredPairs = </World/b> }
    def Cube "b" ( prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsCollisionAPI"] ) { }
    def Cube "c" ( prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsCollisionAPI"] ) { }
    def PhysicsCollisionGroup "one" { rel collection:colliders:includes = </World/b>
        rel physics:filteredGroups = </World/two> }
    def PhysicsCollisionGroup "two" { rel collection:colliders:includes = </World/c> }
    }"""
    scene = load(tmp_path, text)
    a, b, c = (scene.bodies[name] for name in "abc")

    def touch(one, other):
        return bool(one.group & other.collides_with) and bool(other.group & one.collides_with)

    assert (touch(a, b), touch(a, c), touch(b, c)) == (True, True, False)
    names = {body.key: body.name for body in scene.world.bodies}
    assert [{names[k] for k in pair} for pair in scene.world.save().ignored] == [{"a", "b"}]


def test_a_joint_of_two_directions_is_a_chain(tmp_path):
    """A universal joint: two hinges with their own limits, and a small body in between."""
    locked = "".join(
        f"float limit:{d}:physics:low = 1\n float limit:{d}:physics:high = -1\n"
        for d in ("transX", "transY", "transZ", "rotX")
    )
    schemas = ", ".join(f'"PhysicsLimitAPI:{d}"' for d in ("transX", "transY", "transZ", "rotX", "rotY", "rotZ"))
    text = f"""def Xform "World" {{
    def Cube "a" ( prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsCollisionAPI"] ) {{ double size = 0.1 }}
    def PhysicsJoint "cross" ( prepend apiSchemas = [{schemas}] ) {{ rel physics:body1 = </World/a>
        {locked}
        float limit:rotY:physics:low = -10
        float limit:rotY:physics:high = 20 }}
    }}"""
    scene = load(tmp_path, text)
    assert list(scene.joints) == ["cross rotY", "cross rotZ"]
    np.testing.assert_allclose(scene.joints["cross rotY"].limits, np.radians([-10.0, 20.0]), atol=1e-7)
    assert sum(body.mass for body in scene.bodies.values()) == pytest.approx(1.0, rel=1e-6), "1000 kg/m3 of 0.1 m"


def test_deformables_have_their_materials(tmp_path):
    """Young's modulus, Poisson's ratio and density of tetrahedra, in the stage's units."""
    text = """def Xform "World" {
    def TetMesh "jelly" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {
        point3f[] points = [(0,0,0), (10,0,0), (0,10,0), (0,0,10)]
        int4[] tetVertexIndices = [(0,1,2,3)]
        rel material:binding:physics = </World/gel> }
    def Material "gel" ( prepend apiSchemas = ["PhysicsMaterialAPI"] ) {
        float physics:density = 0.001
        custom float physics:youngsModulus = 300
        custom float physics:poissonsRatio = 0.4 }
    }"""
    jelly = load(tmp_path, text, 0.01, 1.0).bodies["jelly"]
    # 0.001 kg/cm3; 300 kg/(cm s2) = 300 / 0.01 Pa; a corner of a cube of 10 cm
    assert (jelly.material.density, jelly.material.youngs_modulus) == pytest.approx((1000.0, 3e4))
    assert jelly.material.poisson_ratio == pytest.approx(0.4)
    assert jelly.mass == pytest.approx(1000.0 * 0.1**3 / 6.0, rel=1e-5)


def test_geometry_alone_is_static(tmp_path):
    """A stage without physics: static bodies, and that is told."""
    scene = load(tmp_path, 'def Xform "World" { def Cube "block" { double size = 0.5 } }')
    assert not scene.bodies["block"].is_dynamic and "a stage without physics is static bodies" in scene.report.notes


@pytest.mark.parametrize(
    ("unit", "mass", "said"),
    [
        (0.0, 1.0, "metersPerUnit"),
        (-1.0, 1.0, "metersPerUnit"),
        (1.0, 0.0, "kilogramsPerUnit"),
        ("inf", 1, "metersPer"),
    ],
)
def test_units_that_are_none_are_refused(tmp_path, unit, mass, said):
    """Zero, negative and endless units."""
    with pytest.raises(nuno.FileFormatError, match=said):
        load(tmp_path, 'def Xform "World" { def Cube "block" { } }', unit, mass)


@pytest.mark.parametrize("text", ["hello", "", "#usda 1.0\ndef Xform"])
def test_damaged_files_are_named_errors(tmp_path, text):
    """No USD, an empty file, one that ends in the middle."""
    (tmp_path / "bad.usda").write_text(text)
    with pytest.raises(nuno.FileFormatError, match=r"USD cannot read|holds no body"):
        nuno.load_scene(tmp_path / "bad.usda", nuno.World(device="cpu"))
