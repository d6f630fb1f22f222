"""The studio's server in a thread."""

import threading

import pytest

from evfem.studio.server import Studio


@pytest.fixture(scope="module")
def server():
    with Studio() as studio:
        thread = threading.Thread(target=studio.serve_forever, kwargs={"poll_interval": 0.02})
        thread.start()
        yield studio
        studio.shutdown()
        thread.join()
