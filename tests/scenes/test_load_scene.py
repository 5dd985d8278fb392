"""What is asked of load_scene before a file is read."""

import pytest

import nuno


@pytest.mark.parametrize(
    ("name", "options", "said"),
    [
        ("room.obj", {}, "must end with"),
        ("room", {}, "must end with"),
        ("gone.xml", {}, "there is no scene file"),
        ("gone.urdf", {"keyframe": "home"}, "keyframe is for MJCF"),
        ("gone.xml", {"keyframe": ""}, "keyframe must be text"),
        ("gone.urdf", {"package_dirs": [3]}, "package_dirs"),
        ("gone.urdf", {"fixed_base": 1}, "fixed_base"),
        ("gone.urdf", {"world": 3}, "world must be"),
    ],
)
def test_bad_arguments_are_named(tmp_path, name, options, said):
    """Another ending, no file, and values of other types."""
    with pytest.raises(nuno.InvalidInputError, match=said):
        nuno.load_scene(tmp_path / name, **options)


@pytest.mark.parametrize(
    ("name", "package", "extra"),
    [("a.xml", "mujoco", "mujoco"), ("a.usda", "pxr", "usd"), ("a.urdf", "pinocchio", "robot")],
)
def test_a_missing_package_is_named(tmp_path, monkeypatch, name, package, extra):
    """The extra that brings it."""
    import sys

    (tmp_path / name).write_text("<robot name='a'/>")
    monkeypatch.setitem(sys.modules, package, None)
    monkeypatch.delitem(sys.modules, "nuno.robot.pinocchio", raising=False)
    with pytest.raises(nuno.MissingPackageError) as caught:
        nuno.load_scene(tmp_path / name, nuno.World(device="cpu"))
    assert caught.value.extra == extra
