"""A live page of a small image for the tests: two walls, and one thing seen by way of each."""

from __future__ import annotations

import threading
from contextlib import contextmanager

import numpy as np
from synthetic import diffuse, radar_image, together

from mirrorfold.common.geometry import reflect, segment_normal
from mirrorfold.viewing.server import Server
from mirrorfold.viewing.session import Session

WALLS = np.array([[[0.5, 1.8], [0.9, 0.9]], [[-0.95, 1.0], [-0.5, 1.9]]])
OBJECTS = np.array([[[-0.2, 1.9], [-0.06, 1.95]], [[0.15, 1.45], [0.28, 1.5]]])


def two_walls():
    """Two walls, and one thing seen by way of each."""
    parts = [diffuse(*wall, seed=i) for i, wall in enumerate(WALLS)]
    for i, (wall, thing) in enumerate(zip(WALLS, OBJECTS, strict=True)):
        parts.append(diffuse(*reflect(thing, wall[0], segment_normal(*wall)), seed=9 + i))
    return radar_image(*together(*parts), np.linspace(-2.2, 2.4, 461), np.linspace(0.3, 2.9, 261))


def opened(path, scene=None, **options):
    """A session that has opened its file."""
    session = Session(path, scene, **options)
    session.open().join(timeout=60.0)
    return session


@contextmanager
def served(path, scene=None, **options):
    """A server in a thread of its own, once it has opened its file; no fold is left running beside the next test."""
    session = opened(path, scene, **options)
    with Server(session) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
        thread.start()
        yield server
        server.shutdown()
        thread.join()
    with session._lock:  # which a fold holds
        pass
