"""Functions of Warp's that are replaced by wrappers."""

from types import SimpleNamespace

from nuno.kernels.warp_functions import wrap_function


def test_a_function_is_wrapped_once():
    """A second call leaves the wrapper as it is; a function that is not there is left out, and told."""
    owner = SimpleNamespace(count=lambda: 1)
    for _ in range(2):
        assert wrap_function(owner, "count", lambda own: lambda: own() + 1)
    assert owner.count() == 2
    assert not wrap_function(owner, "other", lambda own: own)
    assert not hasattr(owner, "other")
