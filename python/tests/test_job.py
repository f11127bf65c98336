"""Render jobs: the same images as of the command, events, state, and several processes."""

import subprocess

import pytest

import spherule

IMAGE = {"width": 32, "height": 18, "samples": 1}


def manifest(example, out):
    return {
        "input": {"path": str(example), "frames": "1-5"},
        "image": IMAGE,
        "output": {"path": str(out / "frame.####.exr"), "preview": False},
    }


def test_images_are_those_of_the_command(example, tmp_path):
    events = []
    job = spherule.Job(manifest(example, tmp_path / "module"))
    result = job.run(progress=events.append, threads=2)
    assert result["done"] == 3 and result["failed"] == [] and job.dir == result["dir"]
    assert sorted(e["frame"] for e in events if e["event"] == "done") == [1, 3, 5]
    arguments = ["render", str(example), "--frames", "1-5", "-o", str(tmp_path / "command/frame.####.exr")]
    settings = [f"image.{key}={value}" for key, value in IMAGE.items()] + ["output.preview=false"]
    options = [word for setting in settings for word in ("--set", setting)]
    subprocess.run([spherule.command(), *arguments, *options], check=True, capture_output=True)
    for number in (1, 3, 5):
        name = f"frame.{number:04}.exr"
        assert (tmp_path / "module" / name).read_bytes() == (tmp_path / "command" / name).read_bytes()
    # The command takes over the job of the module
    assert job.status()["done"] == [1, 3, 5]
    assert [frame["frame"] for frame in job.verify() if frame["status"] != "pending"] == [1, 3, 5]
    assert job.run()["pending"] == result["pending"]
    # The directory of the job stands for its manifest
    assert spherule.Job(tmp_path / "module").run()["done"] == 3


def test_a_check_writes_nothing(example, tmp_path):
    job = spherule.Job(manifest(example, tmp_path / "out"))
    assert isinstance(job.check(), dict)
    assert not (tmp_path / "out").exists()


def test_an_exception_of_the_callable_ends_the_run(example, tmp_path):
    def stop(event):
        raise RuntimeError("enough")

    job = spherule.Job(manifest(example, tmp_path))
    with pytest.raises(RuntimeError, match="enough"):
        job.run(progress=stop)


def test_changed_settings_are_refused(example, tmp_path):
    spherule.Job(manifest(example, tmp_path)).run()
    with pytest.raises(spherule.JobError):
        spherule.Job(manifest(example, tmp_path), settings={"image.samples": 2}).run()
    assert spherule.Job(manifest(example, tmp_path), settings={"image.samples": 2}).run(mode="force")["done"] == 3


def test_movies_and_sheets_are_functions(example, tmp_path):
    settings = manifest(example, tmp_path / "out")
    settings["output"]["preview"] = True
    job = spherule.Job(settings)
    job.run()
    movie = spherule.movie(job.dir, tmp_path / "m.gif", fps=5)
    assert open(movie, "rb").read(6) == b"GIF89a"
    sheet = spherule.sheet(job.dir, tmp_path / "s.png", columns=3)
    assert open(sheet, "rb").read(4) == b"\x89PNG"
    with pytest.raises(spherule.JobError):
        spherule.movie(tmp_path / "nothing", tmp_path / "n.gif")


def test_a_check_has_the_camera_of_the_run(example, tmp_path):
    job = spherule.Job(manifest(example, tmp_path / "out"))
    checked = job.check()
    job.run()
    assert spherule.Job(tmp_path / "out").check()["camera"] == checked["camera"]
