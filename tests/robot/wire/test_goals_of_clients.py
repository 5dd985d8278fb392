"""Goals of several clients of a server: whose counts, what is cancelled, and what ends when a client goes."""

import socket

import numpy as np
from wire_with import advance, angles, goal, until

from nuno.robot.goal import GoalStatus


def test_client_lost_in_a_motion(serve, raw, plain):
    """The robot holds where it was when the client's connection dropped, and serves others."""
    server = serve()
    client, other = raw(server), raw(server)
    client.say(goal(plain))
    client.hear(op="action_feedback")
    advance(client, 0.5)
    before = angles(plain)
    running = plain.goals["larm_controller"][0]
    client.socket.socket.shutdown(socket.SHUT_RDWR)  # as if the cable were cut: no closing handshake
    until(lambda: running.is_done)
    assert running.status == GoalStatus.PREEMPTED
    advance(other, 1.0)
    np.testing.assert_array_equal(angles(plain), before)


def test_base_of_a_lost_client_stops(serve, raw, plain):
    """Velocities and places that a lost client asked for end too."""
    server = serve()
    for message in (
        {"op": "publish", "topic": "/cmd_vel", "msg": {"linear": {"x": 0.2}}},
        {"op": "send_action_goal", "action": "/navigate_to_pose", "action_type": "nav2_msgs/action/NavigateToPose",
         "args": {"pose": {"pose": {"position": {"x": 1.0}}}}},
    ):  # fmt: skip
        client, other = raw(server), raw(server)
        client.say(message)
        advance(client, 0.1)
        assert not plain.going[0].is_done
        client.socket.close()
        until(lambda: plain.going[0].is_done)
        before = plain.place
        advance(other, 0.5)
        np.testing.assert_array_equal(plain.place, before)


def test_what_others_asked_for_goes_on(serve, raw, plain):
    """A client that goes ends its own motions only."""
    server = serve()
    left, right = raw(server), raw(server)
    left.say(goal(plain, "larm_controller"))
    right.say(goal(plain, "rarm_controller"))
    left.hear(op="action_feedback")
    right.hear(op="action_feedback")
    left.socket.close()
    until(lambda: plain.goals["larm_controller"][0].is_done)
    right.say({"op": "call_service", "service": "/simulation/advance", "args": {"duration": {"sec": 2}}})
    assert right.hear(op="action_result")["status"] == 4


def test_later_goal_takes_the_place_of_an_earlier(serve, raw, plain):
    """Two clients that want the same joints: the first learns that its goal was cancelled, the second is served."""
    server = serve()
    first, second = raw(server), raw(server)
    first.say(goal(plain))
    first.hear(op="action_feedback")
    second.say(goal(plain, change=-0.1))
    result = first.hear(op="action_result")
    assert (result["status"], result["result"]) == (5, True)
    assert "another" in result["values"]["error_string"]
    second.say({"op": "call_service", "service": "/simulation/advance", "args": {"duration": {"sec": 2}}})
    assert second.hear(op="action_result")["status"] == 4


def test_going_client_does_not_end_the_goal_that_took_its_place(serve, raw, plain):
    """The loss of a client whose goal was pre-empted leaves the other's alone."""
    server = serve()
    first, second = raw(server), raw(server)
    first.say(goal(plain))
    first.hear(op="action_feedback")
    second.say(goal(plain, change=-0.1))
    first.hear(op="action_result")
    first.socket.close()
    second.say({"op": "call_service", "service": "/simulation/advance", "args": {"duration": {"sec": 2}}})
    assert second.hear(op="action_result")["status"] == 4


def test_cancelling(serve, raw, plain):
    """A client cancels its own goal by id, or whatever a controller does by the service of ROS 2."""
    server = serve()
    client, other = raw(server), raw(server)
    client.say(goal(plain))
    client.hear(op="action_feedback")
    action = "/larm_controller/follow_joint_trajectory"
    other.say({"op": "cancel_action_goal", "id": "g", "action": action})  # the same id, but another's
    advance(other, 0.1)
    assert not plain.goals["larm_controller"][0].is_done
    client.say({"op": "cancel_action_goal", "id": "g", "action": action})
    assert client.hear(op="action_result")["status"] == 5
    client.say(goal(plain))
    client.hear(op="action_feedback")
    other.say({"op": "call_service", "service": f"{action}/_action/cancel_goal", "args": {}})
    assert client.hear(op="action_result")["status"] == 5
