"""An independent client of the protocol, roslibpy, finds what it expects of rosbridge."""

import threading

import pytest
from wire_with import PATIENCE

roslibpy = pytest.importorskip("roslibpy")


@pytest.fixture
def ros(serve):
    """A connection of roslibpy to a server in real time."""
    server = serve(real_time_factor=1.0)
    client = roslibpy.Ros(host="127.0.0.1", port=server.port, transport="asyncio")
    client.run(timeout=PATIENCE)
    yield client
    client.close()


class Heard:
    """What callbacks were called with."""

    def __init__(self):
        """Nothing yet."""
        self.event, self.values = threading.Event(), []

    def __call__(self, value):
        """Keep it."""
        self.values.append(value)
        self.event.set()

    def wait(self):
        """Return the first."""
        assert self.event.wait(PATIENCE)
        return self.values[0]


def test_topics_and_services(ros, plain):
    """Joint states come, topics are listed, and the time is told."""
    heard = Heard()
    topic = roslibpy.Topic(ros, "/joint_states", "sensor_msgs/msg/JointState")
    topic.subscribe(heard)
    message = heard.wait()
    assert message["name"] == list(plain.robot.joint_names)
    topic.unsubscribe()
    assert "/joint_states" in ros.get_topics()
    service = roslibpy.Service(ros, "/rosapi/get_time", "rosapi_msgs/srv/GetTime")
    assert service.call(roslibpy.ServiceRequest(), timeout=PATIENCE)["time"]["sec"] >= 0


def goal_of(plain, seconds=0, nanosec=200000000, change=0.1):
    """A goal of the left arm."""
    joints = plain.controller_param_table["larm_controller"][0]["joint_names"]
    point = {
        "positions": [plain.angles[joint] + change for joint in joints],
        "time_from_start": {"sec": seconds, "nanosec": nanosec},
    }
    return roslibpy.Goal({"trajectory": {"joint_names": joints, "points": [point]}})


def test_action(ros, plain):
    """A goal is followed, with feedback, and its result says that it succeeded; another is cancelled."""
    before = dict(plain.angles)
    client = roslibpy.ActionClient(
        ros, "/larm_controller/follow_joint_trajectory", "control_msgs/action/FollowJointTrajectory"
    )
    result, feedback, failure = Heard(), Heard(), Heard()
    client.send_goal(goal_of(plain), result, feedback, failure)
    told = result.wait()
    assert told["status"] == roslibpy.GoalStatus.SUCCEEDED
    assert told["values"]["error_code"] == 0
    assert feedback.values[0]["joint_names"] == plain.controller_param_table["larm_controller"][0]["joint_names"]
    assert not failure.values
    joint = feedback.values[0]["joint_names"][0]
    assert plain.angles[joint] == pytest.approx(before[joint] + 0.1)

    result = Heard()
    identity = client.send_goal(goal_of(plain, 60), result, feedback, failure)
    client.cancel_goal(identity)
    assert result.wait()["status"] == roslibpy.GoalStatus.CANCELED


def test_refused_goal(ros):
    """A goal that cannot be followed comes back as a failure."""
    client = roslibpy.ActionClient(
        ros, "/larm_controller/follow_joint_trajectory", "control_msgs/action/FollowJointTrajectory"
    )
    result, failure = Heard(), Heard()
    client.send_goal(roslibpy.Goal({"trajectory": {}}), result, Heard(), failure)
    assert "joint" in str(failure.wait()) or "point" in str(failure.wait())
    assert not result.values
