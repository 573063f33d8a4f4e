"""ROS domains for the tests. Each domain has one owner at a time on this machine.

The owner holds a lock, an abstract Unix socket. The kernel releases the lock with the last process that holds it,
however the process ends, and no other program uses its name.
"""
import pathlib
import random
import socket

USABLE = [*range(11, 102), *range(215, 230)]
"""Domains of Linux whose ports lie outside of the ephemeral ports. `pedestal run` chooses from 0 on, so the first ones
stay free for the runs of users."""


def hold(domain_id: int) -> socket.socket | None:
    """Return the lock of a domain, None if another session or a run of a user holds the domain."""
    if f'@pedestal-domain-{domain_id}' in pathlib.Path('/proc/net/unix').read_text().split():
        return None
    lock = socket.socket(socket.AF_UNIX)
    try:
        lock.bind(f'\0pedestal-test-domain-{domain_id}')
    except OSError:
        lock.close()
        return None
    return lock


def candidates() -> list[int]:
    """Return all usable domains in a random order, because sessions begin at the same time."""
    return random.sample(USABLE, len(USABLE))
