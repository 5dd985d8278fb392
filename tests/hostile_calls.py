"""Hostile calls, made from the signatures of all public names."""

import inspect
import traceback
from dataclasses import fields, is_dataclass
from fnmatch import fnmatch
from pathlib import Path as FilePath

import numpy as np

import nuno
from hostile_recipes import CALLS, OF_ROBOTS, OWNERS, SETTERS, UNCALLED, Robots, Scene
from hostile_values import TEXTS, VALUES, may_accept
from nuno.bodies.body import BodyOptions

# Arguments that may accept more than their annotation says, by name and argument
MORE = {
    ("World.start", "real_time_factor"): {"inf"},
    ("Motor", "max_effort"): {"inf"},
    ("World.grip", "max_force"): {"inf"},
    ("World.weld", "max_force"): {"inf"},
    ("Camera", "distortion"): {"no items"},  # as files without one have it
    ("Cloth", "stretch_stiffness"): {"ragged"},  # (warp, weft) of arrays by world
    ("Cloth", "bending_rigidity"): {"ragged"},
    ("HandPath.at", "time"): {"no items"},
    ("JointTrajectory", "names"): TEXTS,  # of one joint
    ("JointTrajectory.of", "names"): TEXTS,
    ("ServoCommand", "names"): TEXTS,
    ("RobotServer", "origins"): {"texts"},
    ("take_picture", "without"): {"no rows"},  # none of them
    ("RobotInterface.angle_vector", "velocities"): {"no items"},  # as None
    ("World.reset", "worlds"): {"no items"},  # none of them
}
# Arguments of which only those values are tried that must be refused: what they accept would take long
LONG = {
    "World.run", "World.trace", "World.start", "World.imagine", "Recording.of", "carry_mat", "estimate_pick",
    "fit_material", "improve_fold", "lift_soft_cube", "minimise", "plan_walk", "plan_walk_footsteps",
    "plan_walk_velocity", "play_fold", "replay_fold", "sweep", "continue_walk", "stop_walk", "soft_sphere",
    "soft_cylinder", "soft_capsule", "SoftSphere", "SoftCylinder", "SoftCapsule", "RobotServer", "WireRobot",
    "Ros1Driver", "Ros2Server", "describe_robot", "compare_engines",
    "take_picture", "track_hands", "track_hands_in_stereo", "locate_marker", "World.save", "Body.export",
    "export_body", "Film.save", "Recording.save", "Recording.export", "SweepResult.save_csv", "SimulatedRobot",
    "HoldResult.save", "HoldResult.figure", "estimate_hold", "garment", "imagine_holds",
    "Links", "Humanoid", "Humanoid.enter", "Humanoid.reach", "TowelPicker", "Snapshot.spread", "Picture.save",
    "TaughtFold.from_hands", "Viewer",
}  # fmt: skip


def find(name):
    """Return what is called, of ``nuno``, by a name such as "World.run"."""
    found = nuno
    for part in name.split("."):
        found = getattr(found, part)
    return found


def parameters_of(name):
    """Yield name, annotation and default of each argument; options of bodies one by one."""
    for parameter in inspect.signature(find(name)).parameters.values():
        if parameter.name == "self":
            continue
        if parameter.kind is parameter.VAR_KEYWORD:
            if "BodyOptions" in str(parameter.annotation):
                for option, annotation in BodyOptions.__annotations__.items():
                    text = getattr(annotation, "__forward_arg__", str(annotation))
                    yield option, text, parameter.empty
            continue
        if parameter.kind is not parameter.VAR_POSITIONAL:
            yield parameter.name, str(parameter.annotation), parameter.default


def is_of_robots(name):
    """Return whether a call needs a robot."""
    return name in OF_ROBOTS or name.split(".")[0] in OF_ROBOTS


class Callers:
    """The scene and the robots, made anew where a call was accepted."""

    def __init__(self):
        self.scene, self.robots = Scene(), None

    def renew(self):
        """Make another scene, as a call has changed this one."""
        self.close()
        self.scene = Scene()

    def close(self):
        """Close the viewer, if one was opened."""
        if "viewer" in vars(self.scene):
            self.scene.viewer.close()

    def holder(self, name):
        """Return the scene, or the robots, that a call by that name needs."""
        if is_of_robots(name):
            self.robots = self.robots or Robots()
            return self.robots
        return self.scene

    def prepared(self, name):
        """Return the function and valid arguments of it."""
        holder = self.holder(name)
        given = {key: value(holder) if callable(value) else value for key, value in CALLS[name].items()}
        owner, _, method = name.rpartition(".")
        static = inspect.getattr_static(find(owner), method, None) if owner else None
        if not owner or isinstance(static, classmethod | staticmethod):
            return find(name), given
        return getattr(OWNERS[owner](holder), method), given


def hostile_calls(names):
    """Yield (name, argument, value's name, whether it must be refused)."""
    for name in names:
        if CALLS.get(name) is None:
            continue
        for argument, annotation, default in parameters_of(name):
            allowed = may_accept(annotation, default) | MORE.get((name, argument), set())
            for key in VALUES:
                if key not in allowed:
                    yield name, argument, key, True
                elif name not in LONG and not is_of_robots(name) and not name.startswith("Viewer"):
                    yield name, argument, key, False
    for kind, properties in SETTERS.items():
        for argument in properties:
            for key in VALUES:
                yield f"{kind}.{argument}=", argument, key, key == "object"


def outcome(callers, call):
    """Make a call, and return "refused", "accepted" or "raw: ..."."""
    name, argument, key, _ = call
    if name.endswith("="):
        owner = OWNERS[name.split(".")[0]](callers.scene)

        def function(**given):
            setattr(owner, argument, given[argument])

        given = {}
    else:
        function, given = callers.prepared(name)
    try:
        function(**{**given, argument: VALUES[key]})
    except nuno.NunoError as error:
        assert str(error) and "NoneType: None" not in str(error)
        return "refused"
    except BaseException as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        own = [frame for frame in traceback.extract_tb(error.__traceback__) if "/nuno/" in frame.filename]
        at = f" ({FilePath(own[-1].filename).name}:{own[-1].lineno})" if own else ""
        return f"raw: {type(error).__name__} {error} at {FilePath(where.filename).name}:{where.lineno}{at}"
    return "accepted"


def state_of(world):
    """Return all that a world is, to compare it with a later one."""
    return [*flat(world.save()), *(tuple(sorted(grip.key for grip in body._dynamics.grips))
            for body in world.bodies if body.is_dynamic), world.is_running]  # fmt: skip


def flat(value):
    """Yield what a snapshot holds, as numbers, text and bytes."""
    if is_dataclass(value):
        for item in fields(value):
            if item.name not in ("from_file",):
                yield from flat(getattr(value, item.name))
    elif isinstance(value, dict):
        for key in value:
            yield key
            yield from flat(value[key])
    elif isinstance(value, tuple | list):
        for item in value:
            yield from flat(item)
    else:
        yield value.tobytes() if isinstance(value, np.ndarray) else value


def public_calls():
    """Yield the names of all that ``nuno`` lets call with arguments: functions, classes and their methods."""
    for name in nuno.__all__:
        value = getattr(nuno, name)
        if inspect.isclass(value) and issubclass(value, Exception):
            continue
        if callable(value):
            yield name
        if not inspect.isclass(value):
            continue
        for method in dir(value):
            static = inspect.getattr_static(value, method)
            if method.startswith("_") or not (inspect.isfunction(static) or isinstance(static, classmethod)):
                continue
            if list(parameters_of(f"{name}.{method}")):
                yield f"{name}.{method}"


def first_of(name):
    """Return the name of the first public class from which a method is inherited, which stands for all."""
    owner, _, method = name.partition(".")
    if not method:
        return name
    static = inspect.getattr_static(getattr(nuno, owner), method)
    for other in CALLS:
        parent, _, same = other.partition(".")
        if same == method and parent != owner and inspect.getattr_static(getattr(nuno, parent), method) is static:
            return other
    return name


def is_named(name):
    """Return whether a call is made, or it is said why it is not."""
    stands = first_of(name)
    return CALLS.get(stands) is not None or any(fnmatch(name, each) for names in UNCALLED.values() for each in names)
