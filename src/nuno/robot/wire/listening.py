"""Sockets that listen."""

from __future__ import annotations

import socket
import sys

from nuno.errors import NotConnectedError

WAITING = 128
"""So many that connect at once wait until they are accepted."""


def listen(host: str, port: int) -> tuple[socket.socket, ...]:
    """Return sockets that listen at all addresses of a host; none of them ever waits.

    Args:
        host: Its name or address; empty stands for all of this machine.
        port: [0, 65535]; 0 takes a free one.

    Raises:
        NotConnectedError: the port is taken, or the address is not this machine's.
    """
    sockets: list[socket.socket] = []
    try:
        found = socket.getaddrinfo(host or None, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
        for family, kind, protocol, _, address in dict.fromkeys(found):
            own = socket.socket(family, kind, protocol)
            sockets.append(own)
            own.setblocking(False)
            if sys.platform != "win32":  # where it would let two programs listen at one port
                own.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            if family == socket.AF_INET6:
                own.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
            own.bind((address[0], port, *address[2:]))
            port = own.getsockname()[1]  # the same at all addresses
            own.listen(WAITING)
    except (OSError, UnicodeError) as error:
        for own in sockets:
            own.close()
        raise NotConnectedError(f"cannot listen at {host} port {port}: {error}") from error
    return tuple(sockets)
