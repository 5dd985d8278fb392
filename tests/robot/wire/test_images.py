"""Images, transforms and trajectories on topics; and what web clients ask rosapi."""

import base64

import numpy as np
import pytest
from wire_with import advance, until

import nuno
from nuno.camera.camera import Camera
from nuno.errors import MessageError, RobotModelError, UnknownNameError
from nuno.robot.head_cameras import HeadCameras
from nuno.robot.readings import ImageReading
from nuno.robot.simulated_robot import SimulatedRobot
from nuno.robot.wire import image_messages as images
from nuno.robot.wire.names import Names

CAMERA = Camera(5, 4, 10.0, 11.0, 2.0, 1.5)
RANDOM = np.random.default_rng(1)


@pytest.fixture
def seeing(still_g1):
    """A G1 that looks at a red box before a gray floor."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    world.add(nuno.box((0.3, 0.3, 0.3), name="box", color="#ff0000", position=(0.8, 0.0, 0.15)))
    links = still_g1.copy().enter(world)
    cameras = HeadCameras(links, ("head", "head_left"), size=0.25)
    return SimulatedRobot(still_g1, world, links=links, cameras=cameras)


@pytest.mark.parametrize("what", ["image", "depth", "compressed"])
def test_images_survive_the_wire(what):
    """What is read is what was sent, to the bit."""
    image = RANDOM.integers(0, 256, (4, 5, 3)).astype(np.uint8)
    if what == "depth":
        image = RANDOM.random((4, 5)).astype(np.float32)
        image[0, 0] = np.inf
    reading = ImageReading(1.25, CAMERA, image)
    if what == "compressed":
        time, found = images.read_compressed(images.compressed_fields(reading, "eye"))
    else:
        time, found = images.read_image(images.image_fields(reading, "eye"))
    assert time == 1.25
    np.testing.assert_array_equal(found, image)
    assert found.dtype == image.dtype


def test_encodings_of_real_cameras():
    """Blue first, gray, millimetres with 0 for nothing, big ends first and rows with gaps."""

    def message(values, encoding, step, **others):
        return {"encoding": encoding, "height": 1, "width": 2, "step": step, "data": base64.b64encode(values).decode(),
                **others}  # fmt: skip

    blue = images.read_image(message(bytes([1, 2, 3, 4, 5, 6]), "bgr8", 6))[1]
    np.testing.assert_array_equal(blue, [[[3, 2, 1], [6, 5, 4]]])
    gray = images.read_image(message(bytes([7, 8, 0, 0]), "mono8", 4))[1]
    np.testing.assert_array_equal(gray, [[[7] * 3, [8] * 3]])
    depth = images.read_image(message(np.array([0, 1500], ">u2").tobytes(), "16UC1", 4, is_bigendian=1))[1]
    np.testing.assert_array_equal(depth, np.array([[np.inf, 1.5]], np.float32))


@pytest.mark.parametrize(
    "wrong", [{"encoding": "yuv422"}, {"step": 5}, {"width": 0}, {"data": "?"}, {"data": [300]}, {"height": "4"}],
)  # fmt: skip
def test_bad_images(wrong):
    """An image that is none is named."""
    good = images.image_fields(ImageReading(0.0, CAMERA, np.zeros((4, 5, 3), np.uint8)), "eye")
    with pytest.raises(MessageError):
        images.read_image(good | wrong)
    with pytest.raises(MessageError):
        images.read_compressed({"format": "png", "data": "AAAA"})


def test_camera_info():
    """The matrix of ROS is the camera's own."""
    told = images.camera_info_fields(0.0, CAMERA, "eye")
    assert told["k"] == [10.0, 0.0, 2.0, 0.0, 11.0, 1.5, 0.0, 0.0, 1.0]
    other = images.read_camera_info(told, Camera(640, 480, 1.0, 1.0, 0.0, 0.0))
    assert (other.width, other.height, other.fx, other.cy, other.distortion) == (5, 4, 10.0, 1.5, None)


def test_a_robot_shows_what_its_cameras_see(seeing):
    """The box is red where the camera is calibrated to see its middle, as far as its depth says."""
    image, depth, camera = seeing.image("head"), seeing.depth("head"), seeing.camera_info("head")
    assert image.shape == (camera.height, camera.width, 3)
    assert depth.shape == image.shape[:2]
    top = np.linalg.inv(camera.camera_to_world) @ (0.8, 0.0, 0.3, 1.0)
    u = round(camera.fx * top[0] / top[2] + camera.cx)
    v = round(camera.fy * top[1] / top[2] + camera.cy)
    assert image[v, u, 0] > 2 * image[v, u, 1:].max()
    assert depth[v, u] == pytest.approx(top[2], abs=0.01)
    with pytest.raises(UnknownNameError, match="camera"):
        seeing.image("tail")


def test_cameras_on_the_wire(seeing, serve, join):
    """A program on the wire sees the same as one beside the robot, to the bit, and where its camera is."""
    server = serve(seeing)
    robot = join(server)
    assert robot.shown_cameras == seeing.camera_names
    found = robot.read_images(("head_left", "head"))
    with server.lock:
        expected = seeing.read_images(("head_left", "head"))
        depth = seeing.depth("head")
    for name, own in expected.items():
        np.testing.assert_array_equal(found[name].image, own.image)
        np.testing.assert_allclose(found[name].camera.camera_to_world, own.camera.camera_to_world, atol=1e-6)
        assert found[name].time == own.time
    np.testing.assert_array_equal(robot.depth("head"), depth)
    until(lambda: not any("image" in topic for topic in server._bridge._subscribers))


def test_images_come_at_their_rate(seeing, serve, raw):
    """Whoever looks through a camera gets ten images a second of simulated time, others none."""
    client = raw(serve(seeing, image_rate=5.0))
    client.say({"op": "subscribe", "topic": "/head/image_raw/compressed"})
    assert client.hear(op="publish")["msg"]["format"] == "rgb8; png compressed bgr8"
    advance(client, 1.0, heard := [])
    assert len(heard) == 5


def test_a_robot_without_images(plain, serve, join):
    """What is not shown is not listed, and asked for by name."""
    robot = join(serve())
    assert robot.shown_cameras == ()
    with pytest.raises(RobotModelError, match="image"):
        robot.image("head")
    with pytest.raises(RobotModelError, match="shows no images"):
        plain.image("head")


def test_transforms(seeing, serve, raw):
    """The tree leads from the odometry to every link, where the robot has it, and to the cameras."""
    client = raw(serve(seeing))
    client.say({"op": "subscribe", "topic": "/tf"})
    found = client.hear(topic="/tf")["msg"]["transforms"]
    parents = {own["child_frame_id"]: own for own in found}
    assert len(parents) == len(found)

    def pose(frame):
        if frame == "odom":
            return nuno.Coordinates()
        own = parents[frame]["transform"]
        place = [own["translation"][axis] for axis in "xyz"]
        turn = [own["rotation"][axis] for axis in "wxyz"]
        return pose(parents[frame]["header"]["frame_id"]).transform(nuno.Coordinates(place, turn))

    for link in ("left_rubber_hand", "right_ankle_roll_link", "pelvis"):
        np.testing.assert_allclose(pose(link).position, seeing.robot.frame_pose(link).position, atol=1e-9)
    eye = pose("head_optical_frame")
    np.testing.assert_allclose(eye.position, seeing.camera_info("head").camera_to_world[:3, 3], atol=1e-9)


def test_trajectories_on_a_topic(plain, serve, raw):
    """A trajectory that is published on a controller's topic is followed; one that is refused is complained of."""
    client = raw(serve())
    joints = plain.controller_param_table["larm_controller"][0]["joint_names"]
    point = {"positions": [plain.angles[joint] + 0.1 for joint in joints], "time_from_start": {"sec": 1}}
    message = {"op": "publish", "topic": "/larm_controller/joint_trajectory",
               "msg": {"joint_names": joints, "points": [point]}}  # fmt: skip
    before = plain.angles[joints[0]]
    client.say(message)
    advance(client, 1.1)
    assert plain.angles[joints[0]] == pytest.approx(before + 0.1)
    client.say(message | {"msg": {"joint_names": joints, "points": []}})
    assert "at least one point" in client.hear(op="status")["msg"]
    client.say({"op": "advertise", "topic": "/larm_controller/joint_trajectory", "type": "std_msgs/String"})
    assert "takes trajectory_msgs/msg/JointTrajectory" in client.hear(op="status")["msg"]


def test_trajectory_of_a_client_that_goes(plain, serve, raw):
    """What a client published stops when it goes, as its goals do."""
    server = serve()
    client, other = raw(server), raw(server)
    joints = plain.controller_param_table["larm_controller"][0]["joint_names"]
    point = {"positions": [plain.angles[joint] + 0.1 for joint in joints], "time_from_start": {"sec": 10}}
    client.say({"op": "publish", "topic": "/larm_controller/joint_trajectory",
                "msg": {"joint_names": joints, "points": [point]}})  # fmt: skip
    advance(client, 1.0)
    client.socket.close()
    advance(other, 0.1)
    here = plain.angles[joints[0]]
    advance(other, 1.0)
    assert plain.angles[joints[0]] == here


@pytest.mark.parametrize("slash", ["", "/"])
def test_rosapi(plain, serve, raw, slash):
    """Web clients ask without a slash; what they ask has the fields that they read."""
    client = raw(serve())

    def ask(service, **args):
        client.say({"op": "call_service", "service": f"{slash}rosapi/{service}", "args": args})
        return client.hear(op="service_response")["values"]

    listed = ask("topics")
    raw_types = ask("topics_and_raw_types")
    assert raw_types["topics"] == listed["topics"]
    assert len(raw_types["typedefs_full_text"]) == len(listed["types"]) == len(listed["topics"])
    assert {"/tf", "/cmd_vel", "/larm_controller/joint_trajectory"} <= set(listed["topics"])
    assert ask("topics_for_type", type="sensor_msgs/JointState")["topics"] == ["/joint_states"]
    assert ask("topic_type", topic="joint_states")["type"] == "sensor_msgs/msg/JointState"
    assert ask("nodes") == {"nodes": ["/nuno"]}
    details = ask("node_details", node="/nuno")
    assert "/cmd_vel" in details["subscribing"] and "/odom" in details["publishing"]
    assert "/larm_controller/follow_joint_trajectory" in ask("action_servers")["action_servers"]
    assert "<robot" in ask("get_param", name="/robot_state_publisher:robot_description")["value"]
    assert ask("get_param", name="x", default="3") == {"value": "3"}
    assert ask("has_param", name="x") == {"exists": False}
    assert ask("publishers", topic="/odom") == {"publishers": ["/nuno"]}


def test_names_of_images():
    """Topics are named after the camera, within the namespace."""
    assert Names("left").full(Names().image, camera="head") == "/left/head/image_raw"
