"""The server: what it offers, and how it begins and ends."""

import json
import math
import threading
import time

import numpy as np
import pytest
from wire_with import PATIENCE, advance, angles, goal, until

from nuno.errors import ConnectionLostError, InvalidInputError, NotConnectedError, SimulationDiverged
from nuno.robot.goal import GoalStatus
from nuno.robot.wire.server import LATE, RobotServer

# What it offers


def test_goal_feedback_and_result(serve, raw, plain):
    """A goal is acknowledged by feedback, followed while time passes, and its result comes at the end."""
    client = raw(serve())
    before = angles(plain)
    client.say(goal(plain))
    feedback = client.hear(op="action_feedback", id="g")["values"]
    assert feedback["joint_names"] == plain.controller_param_table["larm_controller"][0]["joint_names"]
    np.testing.assert_array_equal(feedback["actual"]["positions"], before)
    assert advance(client, 0.5)["values"]["time"] == {"sec": 0, "nanosec": 500000000}
    np.testing.assert_allclose(angles(plain), before + 0.1, atol=1e-12)  # half way, up to rounding
    advance(client, 0.6)
    client.say(goal(plain, id="h", change=0.0))
    client.hear(op="action_feedback", id="h")
    np.testing.assert_allclose(angles(plain), before + 0.2, atol=1e-12)


def test_result_has_the_fields_of_ros(serve, raw, plain):
    """Status 4 is success, as action_msgs has it; the result says error code 0."""
    client = raw(serve())
    client.say(goal(plain))
    client.say({"op": "call_service", "service": "/simulation/advance", "args": {"duration": {"sec": 2}}})
    result = client.hear(op="action_result", id="g")
    assert result == {
        "op": "action_result", "id": "g", "action": "/larm_controller/follow_joint_trajectory", "status": 4,
        "result": True, "values": {"error_code": 0, "error_string": ""},
    }  # fmt: skip


def test_topics(serve, raw, plain):
    """Every topic that is listed as published is so when it is subscribed to, with what the robot tells."""
    client = raw(serve())
    client.say({"op": "call_service", "service": "/rosapi/topics"})
    every = client.hear(op="service_response")["values"]["topics"]
    client.say({"op": "call_service", "service": "/rosapi/node_details", "args": {"node": "/nuno"}})
    node = client.hear(op="service_response")["values"]
    listed = node["publishing"]
    assert set(every) == {*listed, *node["subscribing"]}
    assert {"/cmd_vel", "/larm_controller/joint_trajectory"} <= set(node["subscribing"])
    assert {"/clock", "/joint_states", "/odom", "/left_wrist/wrench", "/robot_description"} <= set(listed)
    assert "/imu/data" not in listed  # this robot has none
    for topic in listed:
        client.say({"op": "subscribe", "topic": topic})
        assert client.hear(op="publish", topic=topic)["msg"]
    client.say({"op": "unsubscribe", "topic": "/joint_states"})
    advance(client, 0.1)  # with all that was under way
    advance(client, 0.1, heard := [])
    topics = {message.get("topic") for message in heard}
    assert "/clock" in topics
    assert "/joint_states" not in topics


def test_joint_states_say_where_the_robot_is(serve, raw, plain):
    """Names, positions and efforts are the robot's."""
    client = raw(serve())
    client.say({"op": "subscribe", "topic": "/joint_states", "type": "sensor_msgs/msg/JointState"})
    message = client.hear(topic="/joint_states")["msg"]
    assert dict(zip(message["name"], message["position"], strict=True)) == plain.angles
    assert set(message["effort"]) == {1.5}


def test_services_and_actions_are_listed(serve, raw):
    """What rosapi and the controller manager of a real robot tell."""
    client = raw(serve())
    for service, field, expected in (
        ("/rosapi/action_servers", "action_servers", "/larm_controller/follow_joint_trajectory"),
        ("/rosapi/services", "services", "/rosapi/get_time"),
    ):
        client.say({"op": "call_service", "service": service})
        assert expected in client.hear(op="service_response", service=service)["values"][field]
    client.say({"op": "call_service", "service": "/controller_manager/list_controllers"})
    found = client.hear(op="service_response")["values"]["controller"]
    assert {"larm_controller", "torso_controller"} <= {own["name"] for own in found}


def test_throttled_subscription(serve, raw):
    """A client that asks for at most ten messages a second of real time gets no more."""
    client = raw(serve(real_time_factor=1.0))
    begin = time.monotonic()
    client.say({"op": "subscribe", "topic": "/clock", "throttle_rate": 100})
    for _ in range(4):
        client.hear(topic="/clock")
    assert time.monotonic() - begin > 0.19  # three intervals, the first of which may have begun before


def test_real_time_and_faster(serve, raw, plain):
    """Time passes by itself: as real time does, or as many times faster."""
    for factor in (1.0, 20.0):
        server = serve(real_time_factor=factor)
        begin, wall = plain.now(), time.monotonic()
        while plain.now() - begin < 0.1 * factor:  # it passes; how fast depends on the machine
            time.sleep(0.01)
        with server.lock:
            passed, wall = plain.now() - begin, time.monotonic() - wall
        server.close()
        # what the server may have been late by before, and a tick
        assert passed <= factor * (wall + LATE) + server.tick


def test_time_stands_still_unless_awaited(serve, raw, plain):
    """A stepped server lets no time pass by itself, and no more than was asked for."""
    client = raw(serve())
    time.sleep(0.05)
    assert plain.now() == 0.0
    advance(client, 0.123)
    assert plain.now() == pytest.approx(0.123, abs=1e-9)  # nanoseconds on the wire


def test_base_by_velocity(serve, raw, plain):
    """A twist moves the base until one of zero stops it, or for a second when no other comes."""
    client = raw(serve())
    twist = {"linear": {"x": 0.2, "y": 0.1}, "angular": {"z": -0.3}}
    client.say({"op": "advertise", "topic": "/cmd_vel", "type": "geometry_msgs/msg/Twist"})
    for _ in range(3):
        client.say({"op": "publish", "topic": "/cmd_vel", "msg": twist})
        advance(client, 0.4)
    np.testing.assert_allclose(plain.place, np.array([0.2, 0.1, -0.3]) * 1.2, atol=1e-9)  # nanoseconds on the wire
    client.say({"op": "publish", "topic": "/cmd_vel", "msg": {}})
    advance(client, 1.0)
    np.testing.assert_allclose(plain.place, np.array([0.2, 0.1, -0.3]) * 1.2, atol=1e-9)
    client.say({"op": "publish", "topic": "/cmd_vel", "msg": twist})
    advance(client, 5.0)
    np.testing.assert_allclose(plain.place, np.array([0.2, 0.1, -0.3]) * 2.2, atol=1e-9)


def test_navigation_in_both_frames(serve, raw, plain):
    """A place seen from the robot, or in the frame of its odometry."""
    client = raw(serve())
    plain.place = np.array([1.0, 2.0, 0.5 * math.pi])
    there = {"position": {"x": 0.5}, "orientation": {"w": 1.0}}
    for frame in ("base_footprint", "odom"):
        plain.going = None
        client.say({
            "op": "send_action_goal", "id": frame, "action": "/navigate_to_pose", "feedback": True,
            "action_type": "nav2_msgs/action/NavigateToPose",
            "args": {"pose": {"header": {"frame_id": frame}, "pose": there}},
        })  # fmt: skip
        client.hear(op="action_feedback", id=frame)
        asked = np.array(plain.going[0].asked)
        if frame == "odom":  # from between the soles, which face y, to a place that faces x
            assert asked[2] == pytest.approx(-0.5 * math.pi)
            asked[:2] = plain.footprint().to_world(np.append(asked[:2], 0.0)[None])[0, :2]
            asked[2] = 0.0
        np.testing.assert_allclose(asked, (0.5, 0.0, 0.0), atol=1e-12)  # rounding of the turn


def test_grippers_take_metres(serve, raw, still_talos):
    """As in ROS, a gripper's position is how far its fingers are apart; 0 to 1 is this library's own."""
    from plain_robot import PlainRobot

    robot = PlainRobot(still_talos)
    width = still_talos.description.hands["left_hand"].width
    client = raw(serve(robot))
    client.say({
        "op": "send_action_goal", "id": "h", "action": "/left_hand/gripper_cmd",
        "action_type": "control_msgs/action/GripperCommand",
        "args": {"command": {"position": 0.25 * width, "max_effort": 12.0}},
    })  # fmt: skip
    result = client.hear(op="action_result", id="h")
    assert (result["status"], result["values"]["reached_goal"]) == (4, True)
    assert robot.grips == [("left_hand", pytest.approx(0.25), 12.0)]


# The server itself


def test_port_in_use(serve, plain):
    """A port that is taken is named, and the robot is free for another server."""
    server = serve()
    with pytest.raises(NotConnectedError, match=f"cannot listen at 127.0.0.1 port {server.port}"):
        RobotServer(plain, port=server.port)


@pytest.mark.parametrize(
    "options", [{"port": -1}, {"port": 70000}, {"port": "9090"}, {"real_time_factor": 0.0}, {"alive": 0.0},
                {"real_time_factor": float("nan")}, {"tick": 0.0}, {"real_time_factor": -1.0}],
)  # fmt: skip
def test_bad_options(plain, options):
    """What makes no server is named."""
    with pytest.raises(InvalidInputError):
        RobotServer(plain, **({"port": 0} | options))


def test_loopback_by_default(serve):
    """Only programs of this machine can connect unless asked otherwise."""
    server = serve()
    assert server.url == f"ws://127.0.0.1:{server.port}"
    assert {own[0] for own in server._bridge.addresses} == {"127.0.0.1"}


def test_closing(serve, join, plain):
    """A server that closes stops what clients asked for and disconnects them; closing twice does nothing."""
    server = serve(real_time_factor=1.0)
    robot = join(server)
    robot.angle_vector(robot.angle_vector() * 0.5, 30.0)
    raised = []

    def wait():
        try:
            robot.wait_interpolation()
        except ConnectionLostError as error:
            raised.append(error)

    thread = threading.Thread(target=wait)
    thread.start()
    time.sleep(0.1)
    server.close()
    thread.join(PATIENCE)
    assert "code 1001" in str(raised[0])
    assert all(own[0].status == GoalStatus.PREEMPTED for own in plain.goals.values())
    server.close()
    assert not server.alive


@pytest.mark.parametrize("factor", [None, 1.0])
def test_simulation_that_fails(serve, join, plain, factor):
    """When the simulation fails clients learn why, and whoever holds the server finds the error."""
    server = serve(real_time_factor=factor)
    robot = join(server)
    plain.failure = SimulationDiverged("towel", 1.0)
    with pytest.raises(ConnectionLostError, match=r"SimulationDiverged: the state of 'towel'"):
        robot.sleep(5.0)
    until(lambda: not server.alive)
    with pytest.raises(SimulationDiverged):
        server.join()


def test_json_is_strict(serve, raw, plain):
    """What is sent is JSON for every language: no NaN in it, even where the robot tells one."""
    plain.angles[next(iter(plain.angles))] = math.nan
    client = raw(serve())
    client.say({"op": "subscribe", "topic": "/joint_states"})
    text = client.socket.recv(timeout=PATIENCE)

    def refuse(constant):
        raise AssertionError(constant)

    assert None in json.loads(text, parse_constant=refuse)["msg"]["position"]
