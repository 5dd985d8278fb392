"""Looking at worlds in a browser, and films of them."""

from nuno.viewer.film import Film
from nuno.viewer.viewer import Viewer

__all__ = ["Film", "Viewer"]
