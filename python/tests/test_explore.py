"""The page of arrays and files."""

import json
import pathlib
import urllib.request

import numpy as np
import pytest

import spherule

SMALL = {"image.width": 32, "image.height": 18, "image.samples": 2}


def wish(page, **settings):
    """Wishes as the page does, and waits for the last picture."""
    chosen = [{"key": key.replace("__", "."), "value": value} for key, value in settings.items()]
    frame = json.load(urllib.request.urlopen(page.url + "start"))["frames"][0]
    body = json.dumps({"page": 1, "wish": {"frame": frame, "settings": chosen}}).encode()
    number = json.load(urllib.request.urlopen(urllib.request.Request(page.url + "wish", data=body)))["wish"]
    after = 0
    while True:
        answer = urllib.request.urlopen(f"{page.url}picture?page=1&after={after}")
        about = json.loads(answer.headers["X-Picture"])
        after = about["number"]
        if about["wish"] == number and about["facts"]["is_last"]:
            return answer.read()


def test_what_is_found_renders_the_same_picture(ball):
    values = np.arange(100, dtype=np.float32)
    with spherule.explore(ball, attributes={"value": values}, radius=0.3, settings=SMALL) as page:
        assert page.settings == {} and page.camera is None and page.frame is None
        assert page.url in page._repr_html_()
        seen = wish(page, camera__azimuth=70.0, material__color={"attribute": "value"})
        assert page.settings == {"camera.azimuth": 70.0, "material.color": {"attribute": "value"}}
        settings = {**SMALL, **page.settings}
        image = spherule.render(ball, attributes={"value": values}, radius=0.3, settings=settings)
        assert image.to_png() == seen
        camera = page.camera
        assert camera["mode"] == "fixed" and len(camera["eye"]) == 3
        again = spherule.render(ball, radius=0.3, camera=camera, settings=SMALL)
        assert again.camera["eye"] == pytest.approx(camera["eye"])
        directory = pathlib.Path(page._process.args[2]).parent
        assert directory.is_dir()
    assert not directory.exists()
    with pytest.raises(spherule.Error, match="has ended"):
        _ = page.settings


def test_files_are_explored_and_errors_are_those_of_the_command(example, tmp_path):
    with spherule.explore(example, settings=SMALL) as page:
        assert wish(page).startswith(b"\x89PNG")
    with pytest.raises(spherule.InputError, match="nowhere"):
        spherule.explore(tmp_path / "nowhere")
    with pytest.raises(spherule.SettingError):
        spherule.explore(tmp_path, radius=1.0)
    with spherule.explore(spherule.read(next(pathlib.Path(example).iterdir())), settings=SMALL) as page:
        assert wish(page).startswith(b"\x89PNG")
    with pytest.raises(spherule.InputError, match="samples"):
        spherule.explore(example, settings={"image.samples": 0})
