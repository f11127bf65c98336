"""Wrong calls: each raises an exception of its class, with a message that names the argument or the key."""

import numpy as np
import pytest

import spherule

ROWS = np.random.default_rng(4).normal(size=(50, 3)).astype(np.float32)


def with_value(value, row=7):
    changed = ROWS.copy()
    changed[row, 1] = value
    return changed


def attributes(**arrays):
    return lambda: spherule.render(ROWS, radius=0.1, size=(8, 8), attributes=arrays)


def render(positions=ROWS, **options):
    return lambda: spherule.render(positions, **{"radius": 0.1, "size": (8, 8), "samples": 1, **options})


ARRAY, SETTING, INPUT = spherule.ArrayError, spherule.SettingError, spherule.InputError

CALLS = {
    "complex numbers": (render(ROWS.astype(complex)), ARRAY, "positions: expected real numbers"),
    "text": (render([["a", "b", "c"]]), ARRAY, "positions: expected real numbers"),
    "objects": (render(np.array([[None] * 3])), ARRAY, "positions: expected real numbers"),
    "two columns": (render(ROWS[:, :2]), ARRAY, r"positions: expected the shape \(N, 3\)"),
    "one dimension": (render(ROWS.ravel()), ARRAY, "positions: expected the shape"),
    "ragged rows": (render([[1, 2, 3], [4, 5]]), ARRAY, "positions: "),
    "NaN": (render(with_value(np.nan)), ARRAY, "positions: particle 7 is not finite"),
    "infinity": (render(with_value(np.inf)), ARRAY, "positions: particle 7 is not finite"),
    "negative radius": (render(radius=-1.0), ARRAY, "radius: expected a positive number"),
    "negative radii": (render(radius=np.linspace(-1, 1, 50)), ARRAY, "radius: -1.0 of particle 0"),
    "wrong number of radii": (render(radius=np.ones(49)), ARRAY, r"radius: .* \(50,\)"),
    "radii twice": (render(radius=np.ones(50), attributes={"radius": np.ones(50)}), ARRAY, "radius: attributes"),
    "short attribute": (attributes(mass=np.ones(49)), ARRAY, r"attributes\['mass'\]: 49 values for 50"),
    "attribute of three dimensions": (attributes(m=np.ones((50, 2, 2))), ARRAY, "expected the shape"),
    "attributes as a list": (render(attributes=[1]), ARRAY, "attributes: expected a dict"),
    "size": (render(size=5), ARRAY, "size: expected"),
    "threads": (render(threads=0), ARRAY, "threads: expected"),
    "unknown section": (render(settings={"lighting": {}}), SETTING, "lighting"),
    "unknown key": (render(settings={"image": {"widht": 3}}), SETTING, "image.widht: unknown key; did you mean"),
    "wrong value": (render(settings={"camera.fov": "wide"}), SETTING, "camera.fov: expected"),
    "None in settings": (render(settings={"render": {"max_depth": None}}), SETTING, "render.max_depth"),
    "settings as a list": (render(settings=[1]), SETTING, "settings: expected a dict"),
    "input path": (render(settings={"input": {"path": "x"}}), SETTING, "input.path"),
    "an object in settings": (render(settings={"image": {"width": object()}}), SETTING, "settings: expected numbers"),
    "unknown map": (
        render(attributes={"h": np.ones(50)}, color={"attribute": "h", "map": "virdis"}),
        SETTING,
        "virdis",
    ),
    "missing attribute": (render(color={"attribute": "mass"}), SETTING, "no attribute `mass`"),
    "missing file in settings": (
        render(settings={"environment": {"type": "image", "image": "missing.exr"}}),
        SETTING,
        "environment.image",
    ),
    "camera inside out": (
        render(camera={"mode": "fixed", "eye": [0, 0, 0], "look_at": [0, 0, 0]}),
        SETTING,
        "camera",
    ),
    "no such file": (lambda: spherule.read("missing.vtk"), INPUT, "missing.vtk"),
    "no such file to inspect": (lambda: spherule.inspect("missing.vtk"), INPUT, "missing.vtk"),
    "wrong ending": (lambda: render()().save("x.jpg"), spherule.OutputError, ".png or .exr"),
    "no directory": (lambda: render()().save("missing/x.png"), spherule.OutputError, "missing/x.png"),
    "manifest as a list": (lambda: spherule.Job([1]), SETTING, "manifest: expected"),
    "job without input": (lambda: spherule.Job({"image": {"width": 5}}).run(), SETTING, "input.path"),
    "mode": (lambda: spherule.Job({}).run(mode="now"), spherule.JobError, "mode"),
}


@pytest.mark.parametrize("name", CALLS)
def test_wrong_calls_have_the_right_exception(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    call, kind, pattern = CALLS[name]
    with pytest.raises(kind, match=pattern) as caught:
        call()
    assert isinstance(caught.value, spherule.Error)
    assert {"file", "place", "remedy"} <= set(vars(caught.value))
    assert not list(tmp_path.iterdir())


def test_errors_name_file_place_and_remedy(example, tmp_path):
    damaged = tmp_path / "damaged.spf"
    spherule.write_spf(damaged, ROWS, radius=0.1)
    damaged.write_bytes(damaged.read_bytes()[:100])
    with pytest.raises(INPUT) as caught:
        spherule.read(damaged)
    assert caught.value.file == str(damaged)
    with pytest.raises(SETTING) as caught:
        spherule.render(ROWS, radius=0.1, settings={"image": {"widht": 3}})
    assert caught.value.place == "image.widht" and "image.width" in caught.value.remedy
    with pytest.raises(INPUT, match="choose one with frame=") as caught:
        spherule.read(example)
    assert caught.value.place == "frame"
    with pytest.raises(SETTING) as caught:
        spherule.render(ROWS, radius=0.1, settings={"lighting": {}})
    assert caught.value.place == "lighting"
    with pytest.raises(INPUT) as caught:
        spherule.read(tmp_path / "missing.vtk")
    assert caught.value.file == str(tmp_path / "missing.vtk")


def test_messages_name_no_temporary_files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for path, shown in (("data/nothing", "data/nothing"), ("/nowhere/at all", "/nowhere/at all")):
        job = spherule.Job({"input": {"path": path}, "output": {"path": "out/f.####.exr"}})
        with pytest.raises(spherule.JobError) as caught:
            job.check()
        assert str(caught.value) == f"input.path: {shown}: no such file or directory"
