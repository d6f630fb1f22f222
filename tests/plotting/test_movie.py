"""Moving pictures: a frame for each of the result's, on one scale, written whole or not at all."""

import base64
import os
import sys

import numpy as np
import pytest
from PIL import Image
from tools.fakes import fake_result

from evfem.errors import InputError, StorageError
from evfem.plotting import animate, deformed
from evfem.plotting import movie as movies
from evfem.plotting.movie import make_reel

#: stands for ffmpeg: says what it was given, and writes how many bytes came
FFMPEG = """#!{python}
import sys
data = sys.stdin.buffer.read()
size = sys.argv[sys.argv.index("-s") + 1]
open(sys.argv[-1], "w").write(f"{{len(data)}} {{size}} {{sys.argv[sys.argv.index('-framerate') + 1]}}")
sys.exit({status})
"""


@pytest.fixture
def ffmpeg(tmp_path, monkeypatch):
    """A program called ffmpeg on the path, which ends with a given status."""

    def install(status=0):
        program = tmp_path / "bin" / "ffmpeg"
        program.parent.mkdir()
        program.write_text(FFMPEG.format(python=sys.executable, status=status))
        program.chmod(0o755)
        monkeypatch.setenv("PATH", f"{program.parent}{os.pathsep}{os.environ['PATH']}")

    return install


def test_a_gif_has_every_frame_of_the_result(tmp_path):
    result = fake_result("quad9", steps=6)
    path = animate(result, tmp_path / "slide.gif", fps=5)
    assert path == tmp_path / "slide.gif"
    assert os.listdir(tmp_path) == ["slide.gif"]
    with Image.open(path) as gif:
        assert (gif.format, gif.n_frames, gif.info["duration"], gif.info["loop"]) == ("GIF", 3, 200, 0)
        frames = []
        for number in range(3):
            gif.seek(number)
            frames.append(np.asarray(gif.convert("RGB"), dtype=int))
    assert np.abs(frames[1] - frames[0]).max() > 50
    assert np.all(frames[0][0, 0] == 255)


def test_a_notebook_shows_the_moving_picture(tmp_path, ffmpeg):
    ffmpeg()
    gif, mp4 = (animate(fake_result(), tmp_path / f"slide.{ending}") for ending in ("gif", "mp4"))
    for path, begin in ((gif, '<img src="data:image/gif;base64,'), (mp4, "<video controls loop src=")):
        shown = path._repr_html_()
        assert shown.startswith(begin)
        data = shown.split("base64,")[1].split('"')[0]
        assert base64.b64decode(data) == path.read_bytes()


def test_frames_show_the_result_on_one_scale_with_a_mark():
    result = fake_result("quad9", steps=6)
    reel = make_reel(result, "von_mises", None, (None, None))
    highest = max(frame.von_mises.max() for frame in result.frames)
    marks, windows = [], set()
    for frame, figure in zip(result.frames, reel.frames(), strict=True):
        above, below = figure.axes[:2]
        mapped, alone = above.collections[0], deformed(result, frame=result.frames.index(frame))
        np.testing.assert_array_equal(mapped.get_array(), alone.collections[0].get_array())
        assert mapped.get_clim() == (0.0, highest)
        assert above.get_title() == alone.get_title()
        windows.add((*above.get_xlim(), *above.get_ylim()))
        marks.append([x for line in below.get_lines() if line.get_color() == "0.3" for x in line.get_xdata()])
    assert marks == [[2, 2], [4, 4], [6, 6]]
    assert len(windows) == 1


def test_a_close_up_goes_along_with_the_finger():
    result = fake_result("quad9", steps=6)
    reel = make_reel(result, "gap", "contact", (None, None))
    left, right = np.array(reel.windows)[:, :2].T
    np.testing.assert_allclose(left - left[0], [frame.position for frame in result.frames])
    np.testing.assert_allclose(right - left, right[0] - left[0])
    for window, frame in zip(reel.windows, result.frames, strict=True):
        touching = (result.mesh.points + frame.displacement)[frame.contact_status > 0]
        assert window[0] < touching[:, 0].min() < touching[:, 0].max() < window[1]


def test_an_mp4_goes_through_ffmpeg(tmp_path, ffmpeg):
    ffmpeg()
    animate(fake_result(), tmp_path / "slide.mp4", fps=20)
    received, size, rate = (tmp_path / "slide.mp4").read_text().split()
    width, height = map(int, size.split("x"))
    assert int(received) == 2 * width * height * 4  # frames of red, green, blue and opacity
    assert rate == "20"
    assert width % 2 == height % 2 == 0  # as its usual encoder needs


def test_a_failure_leaves_what_was_there(tmp_path, ffmpeg, monkeypatch):
    ffmpeg(status=1)
    for name in ("slide.gif", "slide.mp4"):
        (tmp_path / name).write_text("before")
    with pytest.raises(StorageError, match="ffmpeg ended with 1"):
        animate(fake_result(), tmp_path / "slide.mp4")
    drawn = []

    def interrupted(*arguments):
        drawn.append(arguments)
        if len(drawn) == 2:
            raise KeyboardInterrupt
        return "title"

    monkeypatch.setattr(movies, "told", interrupted)
    with pytest.raises(KeyboardInterrupt):
        animate(fake_result(), tmp_path / "slide.gif")
    assert sorted(os.listdir(tmp_path)) == ["bin", "slide.gif", "slide.mp4"]
    assert {(tmp_path / name).read_text() for name in ("slide.gif", "slide.mp4")} == {"before"}


def test_bad_input_is_refused_before_anything_is_drawn(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(movies, "make_reel", None)
    result = fake_result()
    result_without = fake_result(steps=1)
    for arguments, sentence in (
        ((result, tmp_path / "slide.avi"), r"slide\.avi; allowed: a file name that ends in \.gif or \.mp4"),
        ((result, tmp_path / "slide.mp4"), "no ffmpeg; allowed: a .gif, or an .mp4 where ffmpeg is"),
        ((result, tmp_path / "slide.gif", "stress"), "field: .*von_mises"),
        ((result_without, tmp_path / "slide.gif"), "without frames"),
    ):
        with pytest.raises(InputError, match=sentence):
            animate(*arguments)
    with pytest.raises(InputError, match="fps: given 0; allowed: a whole number from 1 to 60"):
        animate(result, tmp_path / "slide.gif", fps=0)
    with pytest.raises(StorageError, match="no folder"):
        animate(result, tmp_path / "nowhere" / "slide.gif")
    assert os.listdir(tmp_path) == []
