"""The server: who is answered, what is too much, and what a run does when nobody listens."""

import errno
import http.client
import json
import multiprocessing
import os
import re
import signal
import subprocess
import sys
import threading
import urllib.request

import pytest

from evfem import cli
from evfem.electrostatics.laws import FORCE_LAWS, Kaczmarek
from evfem.errors import InputError, StorageError
from evfem.studio import runs
from evfem.studio.server import ADDRESS, ASSETS, MOST_STATE, MOST_UPLOAD, Studio


def ask(server, method, path, body=None, **headers):
    """Status, headers and body of an answer."""
    port = server.server_address[1]
    connection = http.client.HTTPConnection(ADDRESS, port, timeout=30)
    given = {name.replace("_", "-"): value for name, value in headers.items()}
    connection.request(method, path, body, {"Host": f"{ADDRESS}:{port}", **given})
    answer = connection.getresponse()
    found = answer.status, dict(answer.getheaders()), answer.read()
    connection.close()
    return found


@pytest.mark.parametrize("path", ASSETS)
def test_the_page_and_its_parts_come_from_here_and_nowhere_else(server, path):
    status, headers, body = ask(server, "GET", path)
    assert status == 200
    assert "default-src 'self'" in headers["Content-Security-Policy"]
    assert b"http://" not in body.replace(b"http://www.w3.org/2000/svg", b"")
    assert b"https://" not in body


@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "evil.example"},
        {"Host": "127.0.0.1"},
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Sec_Fetch_Site": "cross-site"},
        {"Sec_Fetch_Site": "same-site"},
    ],
)
@pytest.mark.parametrize(("method", "path"), [("GET", "/"), ("POST", "/answer")])
def test_other_hosts_and_origins_are_refused(server, headers, method, path):
    status, _, body = ask(server, method, path, "{}", **headers)
    assert status == 403
    assert set(json.loads(body)) == {"error"}


def test_the_page_itself_is_answered(server):
    port = server.server_address[1]
    status, _, body = ask(server, "POST", "/answer", "{}", Origin=f"http://{ADDRESS}:{port}")
    assert status == 200
    assert json.loads(body)["source"] == "estimate"
    # D/s of the film below 0.38 mm of stratum corneum: 0.47 / (0.38/1650 + 0.09/3.35)
    assert json.loads(body)["numbers"]["laws"] == pytest.approx(17.3457, abs=1e-3)


def test_the_page_offers_the_laws_and_insulators_that_there_are(server, monkeypatch):
    monkeypatch.setitem(FORCE_LAWS, "own", Kaczmarek)
    _, _, body = ask(server, "GET", "/")
    assert b'<option value="kaczmarek" selected>kaczmarek</option>' in body
    assert b'<option value="own">own</option>' in body
    assert b'<option value="touchscreen">touchscreen, 1 um</option>' in body


def test_only_this_machine_is_served(server):
    assert server.server_address[0] == "127.0.0.1"


@pytest.mark.parametrize(("path", "most"), [("/answer", MOST_STATE), ("/upload", MOST_UPLOAD)])
def test_what_is_too_long_is_refused_before_it_is_read(server, path, most):
    port = server.server_address[1]
    connection = http.client.HTTPConnection(ADDRESS, port, timeout=10)
    connection.putrequest("POST", path, skip_host=True)
    connection.putheader("Host", f"{ADDRESS}:{port}")
    connection.putheader("Content-Length", str(most + 1))
    connection.endheaders()
    answer = connection.getresponse()
    assert answer.status == 413
    assert "are too much" in json.loads(answer.read())["error"]
    connection.close()


@pytest.mark.parametrize(
    ("method", "path", "body", "status"),
    [
        ("GET", "/../server.py", None, 404),
        ("GET", "/assets/page.html", None, 404),
        ("POST", "/other", "{}", 404),
        ("POST", "/answer", "{", 400),
        ("POST", "/answer", '{"touch": {"load": -1}}', 400),
        ("POST", "/file?kind=exe", "{}", 400),
        ("POST", "/upload?name=a.wav&licence=CC0&speed=10", "RIFF....", 400),
        ("POST", "/upload?name=a.csv", "x,height\n0,0\n", 400),
        ("POST", "/run", '{"method": 1}', 400),
        ("GET", "http://[/", None, 400),
        ("POST", "http://[/", "{}", 400),
        ("POST", "/upload?name=..&licence=CC0", "x,height\n0,0\n", 400),
        ("POST", f"/upload?name={'%F0%A0%80%80' * 300}.csv&licence=CC0", "x,height\n0,0\n", 400),
    ],
)
def test_mistakes_get_a_status_and_a_sentence(server, method, path, body, status):
    found, _, answer = ask(server, method, path, body)
    assert found == status
    assert json.loads(answer)["error"]


@pytest.mark.parametrize("length", ["-1", "abc", "5, 5", "\u00b2"])
def test_a_length_that_is_no_number_is_refused(server, length):
    status, _, body = ask(server, "POST", "/answer", "{}", Content_Length=length)
    assert (status, json.loads(body)) == (411, {"error": "the length of a request must be said"})


@pytest.mark.parametrize(
    ("path", "body"), [("/file?kind=png", "{}"), ("/upload?name=a.csv&licence=CC0", "x,height\n0,0\n")]
)
def test_a_disk_that_is_full_is_said(server, monkeypatch, path, body):
    def full(*given, **more):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("tempfile.TemporaryDirectory", full)
    status, _, answer = ask(server, "POST", path, body)
    told = "cannot use the folder for temporary files: No space left on device"
    assert (status, json.loads(answer)) == (500, {"error": told})


def test_a_file_has_its_name(server):
    status, headers, body = ask(server, "POST", "/file?kind=wav", "{}")
    assert (status, body[:4]) == (200, b"RIFF")
    assert headers["Content-Disposition"] == 'attachment; filename="voltage.wav"'


def test_a_run_ends_when_nobody_listens(monkeypatch):
    began = []
    monkeypatch.setattr(runs, "EVERY", 0.05)

    def send(line):
        began.append(line)
        if len(began) == 3:
            raise BrokenPipeError

    with pytest.raises(BrokenPipeError):
        runs.run("{}", False, send)
    assert not multiprocessing.active_children()


def test_a_run_whose_process_dies_says_so(monkeypatch):
    lines = []
    monkeypatch.setattr(runs, "_work", os.abort)  # takes no arguments: the process ends at once
    runs.run("{}", False, lines.append)
    assert "without a result" in lines[-1]["error"]


class SlowToGo:
    """A process that says its last and needs a while to go."""

    def __init__(self, *given):
        self.line, self.lines, self.there = self, [{"animation": ""}], [True, False]

    def poll(self, seconds):
        return self.there.pop(0) if self.there else True

    def recv(self):
        if not self.lines:
            raise EOFError
        return self.lines.pop()

    def end(self):
        pass


def test_a_run_whose_process_goes_slowly_has_a_result(monkeypatch):
    lines = []
    monkeypatch.setattr(runs, "Worker", SlowToGo)
    runs.run("{}", False, lines.append)
    assert lines == [{"animation": ""}, {"alive": True}]


def test_no_more_than_two_runs_at_once(monkeypatch):
    places = threading.BoundedSemaphore(1)
    monkeypatch.setattr(runs, "_PLACES", places)
    monkeypatch.setattr(runs, "_work", os.abort)
    with places, pytest.raises(InputError, match="at a time: wait"):
        runs.run("{}", False, print)
    runs.run("{}", False, lambda line: None)
    assert places.acquire(blocking=False)


@pytest.mark.slow
def test_a_run_tells_its_steps_its_curve_and_both_pictures():
    lines = []
    runs.run('{"touch": {"length": 0.5, "ridged": false}}', False, lines.append)
    kinds = [next(iter(line)) for line in lines if "alive" not in line]
    steps = [line for line in lines if "step" in line]
    assert [line["step"] for line in steps] == list(range(steps[0]["of"] + 1))
    assert kinds[-3:] == ["curve", "picture", "animation"]
    curve = next(line["curve"] for line in lines if "curve" in line)
    assert curve["x"][-1] == pytest.approx(0.5)


def test_a_port_that_is_taken_is_told(server, capsys):
    port = server.server_address[1]
    with pytest.raises(StorageError, match=f"cannot use port {port}"):
        Studio(port)
    assert cli.main(["studio", "--no-browser", "--port", str(port)]) == 4
    assert cli.main(["studio", "--no-browser", "--port", "70000"]) == 2
    assert "port" in capsys.readouterr().err


def test_the_command_serves_until_it_is_interrupted():
    words = [sys.executable, "-P", "-m", "evfem", "studio", "--no-browser", "--port", "0"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        url = re.search(r"http://127\.0\.0\.1:\d+/", process.stdout.readline())[0]
        with urllib.request.urlopen(url) as answer:
            assert b"evfem studio" in answer.read()
        process.send_signal(signal.SIGINT)
        assert "closed" in process.stdout.read()
        assert process.wait() == 0
