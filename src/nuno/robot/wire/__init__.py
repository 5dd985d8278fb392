"""Robots on the wire: the rosbridge protocol over websockets, as a client and as a server."""
