"""A robot behind another rosbridge, as real ones are: its own clock, no acknowledgements, no names of Nuno's."""

import asyncio
import queue
import threading
import time

from nuno.robot.wire import messages as ros
from nuno.robot.wire.bridge import Bridge

SKEW = 1234.5
"""[s] Its clock is ahead of this machine's."""


class OtherRobot:
    """Answers as rosbridge_suite does: results only, refusals as text; joint states at 50 Hz of real time."""

    def __init__(self, robot, with_rosapi=True):
        """Listen; joints are at once where a goal's last point is, when its time has come."""
        self.inbox, self.velocities, self.moving, self.positions = queue.Queue(), [], [], {}
        self.robot, self.with_rosapi, self.silent = robot, with_rosapi, False
        self.positions = dict(zip(robot.joint_names, robot.angle_vector().tolist(), strict=True))
        self.bridge = Bridge(self.take_in, self.let_go, "127.0.0.1", 0, 2**23, 20.0, ())
        self.closing, ready = threading.Event(), threading.Event()
        self.threads = [
            threading.Thread(target=lambda: asyncio.run(self.listen(ready)), daemon=True),
            threading.Thread(target=self.run, daemon=True),
        ]
        for thread in self.threads:
            thread.start()
            ready.wait()
        self.url = f"ws://127.0.0.1:{self.bridge.port}"

    def close(self):
        """End."""
        self.closing.set()
        for thread in self.threads:
            thread.join()

    async def listen(self, ready):
        """Serve until the end."""
        await self.bridge.open()
        ready.set()
        while not self.closing.is_set():
            await asyncio.sleep(0.01)
        await self.bridge.close()

    async def take_in(self, client, message):
        """Leave a message to the other thread."""
        self.inbox.put((client, message))

    async def let_go(self, client):
        """Nothing ends with a client."""

    def run(self):
        """Answer, and publish every 20 ms."""
        due = time.monotonic()
        while not self.closing.is_set():
            try:
                self.answer(*self.inbox.get(timeout=max(0.0, due - time.monotonic())))
                continue
            except queue.Empty:
                due += 0.02
            for own in [own for own in self.moving if time.monotonic() >= own[0]]:
                self.moving.remove(own)
                self.positions.update(own[1])
                self.finish(own[2], own[3], 4, {"error_code": 0, "error_string": ""})
            if not self.silent:
                self.publish()

    def publish(self):
        """Publish half of the joints on a topic each time, as two drivers would."""
        for own in (slice(None, 10), slice(10, None)):
            names = list(self.positions)[own]
            self.bridge.publish(
                "/joint_states",
                {
                    "header": ros.header_fields(time.time() + SKEW),
                    "name": names,
                    "position": [self.positions[name] for name in names],
                    "velocity": [],
                    "effort": [float("nan")] * len(names),
                },
            )

    def answer(self, client, message):
        """Do what a message asks."""
        op = message["op"]
        if op == "publish":
            self.velocities.append((time.monotonic(), message["msg"]))
        elif op == "call_service":
            if not self.with_rosapi or message["service"] != "/rosapi/action_servers":
                client.answer(message, "Service does not exist", False)
            else:
                actions = ["/larm_controller/follow_joint_trajectory", "/slow_controller/follow_joint_trajectory"]
                client.answer(message, {"action_servers": actions})
        elif op == "cancel_action_goal":
            for own in [own for own in self.moving if own[3]["id"] == message["id"]]:
                self.moving.remove(own)
                self.finish(client, own[3], 5, {"error_code": 0, "error_string": "cancelled"})
        elif op == "send_action_goal":
            self.take(client, message)

    def take(self, client, message):
        """Take a goal, or refuse one that has too many joints."""
        trajectory, start, _ = ros.read_follow(message["args"])
        if len(trajectory.names) > 7:
            refusal = {"op": "action_result", "id": message["id"], "action": message["action"], "status": 0}
            client.send(refusal | {"values": "Action goal was rejected", "result": False})
            return
        wait = trajectory.duration + (0.0 if start is None else start - time.time() - SKEW)
        last = dict(zip(trajectory.names, trajectory.positions[-1].tolist(), strict=True))
        self.moving.append((time.monotonic() + wait, last, client, message))

    def finish(self, client, message, status, values):
        """Send a result."""
        client.send({
            "op": "action_result", "id": message["id"], "action": message["action"], "values": values, "status": status,
            "result": True,
        })  # fmt: skip
