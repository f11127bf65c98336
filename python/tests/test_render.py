"""Pictures of arrays: the bytes of the command, planes without copies, layouts and precision."""

import gc
import subprocess
import sys

import numpy as np
import pytest

import spherule


def command_still(source, output, *options):
    arguments = ["still", str(source), "-o", str(output), "--width", "64", "--height", "36", *options]
    subprocess.run([spherule.command(), *arguments], check=True, capture_output=True)
    return output.read_bytes()


def test_bytes_are_those_of_the_command(example, tmp_path):
    source = example / "ParticleData_Fluid_5.bgeo"
    expected = command_still(source, tmp_path / "command.exr", "--set", "image.samples=2")
    frame = spherule.read(source)
    image = spherule.render(frame, size=(64, 36), samples=2)
    image.save(tmp_path / "module.exr")
    assert (tmp_path / "module.exr").read_bytes() == expected
    assert image.to_exr() == expected
    expected = command_still(source, tmp_path / "command.png", "--set", "image.samples=2")
    assert image.to_png() == expected == image._repr_png_()


def test_channels_and_layers_are_views_that_keep_the_picture_alive(ball, small):
    speed = np.linspace(0, 1, len(ball), dtype=np.float32)
    image = spherule.render(
        ball,
        radius=0.3,
        attributes={"speed": speed, "id": np.arange(100, dtype=np.uint32)},
        color={"attribute": "speed", "map": "viridis"},
        channels=["Z", "N", "id", "diffuse", "attribute:speed"],
        **small,
    )
    shapes = {name: plane.shape for name, plane in image.planes.items()}
    assert shapes == {
        "rgba": (18, 32, 4),
        "Z": (18, 32),
        "N": (18, 32, 3),
        "id": (18, 32),
        "diffuse": (18, 32, 3),
        "speed": (18, 32),
    }
    assert image["id"].dtype == np.uint32 and image.rgba.dtype == np.float32
    low, high = image.color_range
    assert 0 <= low < high <= 1
    assert not any(plane.flags.writeable or plane.flags.owndata for plane in image.planes.values())
    with pytest.raises(ValueError):
        image["Z"][0, 0] = 1
    # Two calls give the same memory
    assert image._native.planes()["Z"].ctypes.data == image["Z"].ctypes.data
    planes, copies = image.planes, {name: plane.copy() for name, plane in image.planes.items()}
    del image
    gc.collect()
    spherule.render(ball, radius=0.1, **small)
    assert all(np.array_equal(planes[name], copies[name]) for name in planes)


def test_layouts_and_types_give_the_same_picture(ball, small):
    expected = spherule.render(ball, radius=0.3, **small).to_exr()
    wide = np.zeros((100, 4), np.float32)
    wide[:, :3] = ball
    for same in (np.asfortranarray(ball), wide[:, :3], ball.astype(np.float64), ball.astype(">f4"), ball.tolist()):
        assert spherule.render(same, radius=0.3, **small).to_exr() == expected
    # Integers
    whole = np.round(ball * 3)
    expected = spherule.render(whole, radius=0.3, **small).to_exr()
    assert spherule.render(whole.astype(np.int16), radius=0.3, **small).to_exr() == expected


def test_the_origin_of_float64_positions_is_subtracted_before_rounding(ball, small):
    near = spherule.render(ball.astype(np.float64), radius=0.3, **small)
    # A binary fraction, so that the sum is exact
    far = spherule.render(ball.astype(np.float64) + 2.0**30, radius=0.3, **small)
    assert far.origin != (0.0, 0.0, 0.0)
    assert np.abs(near.rgba - far.rgba).mean() < 0.02
    covered = lambda image: float(image.rgba[..., 3].mean())
    assert covered(near) == pytest.approx(covered(far), abs=0.02) and covered(near) > 0.1


def test_radii_as_array_and_as_attribute_agree(ball, small):
    radii = np.linspace(0.1, 0.4, len(ball))
    one = spherule.render(ball, radius=radii, **small)
    other = spherule.render(ball, attributes={"radius": radii.astype(np.float32)}, **small)
    assert one.to_exr() == other.to_exr()


def test_threads_do_not_change_bytes(ball):
    images = [spherule.render(ball, radius=0.3, size=(32, 18), threads=n).to_exr() for n in (1, 3)]
    assert images[0] == images[1]


def test_no_particles_are_a_picture(small):
    image = spherule.render(np.zeros((0, 3), np.float32), radius=0.1, settings={"output.transparent": True}, **small)
    assert not image.rgba[..., 3].any()
    # The colour type in the header of the PNG: with alpha
    assert image.to_png()[25] == 6


def test_frames_of_a_sequence_are_read_when_asked_for(example):
    frames = spherule.sequence(example)
    assert len(frames) == 9 and frames.numbers[:3] == [1, 3, 5]
    frame = frames[-1]
    assert frame.number == 17 and frame.up == "y" and len(frame) == 10422
    assert frame.positions.shape == (10422, 3) and frame.positions.dtype == np.float32
    assert frame.attributes["velocity"].shape == (10422, 3)
    assert len(frames[2:4]) == 2


def test_native_frames_keep_positions_attributes_and_time(ball, tmp_path):
    path = tmp_path / "ball.spf"
    weight = np.arange(100, dtype=np.int64)
    spherule.write_spf(path, ball, radius=0.25, attributes={"weight": weight}, time=1.5)
    frame = spherule.read(path)
    assert frame.time == 1.5 and frame.radius == 0.25
    order = frame.attributes["weight"]
    assert sorted(order) == list(range(100))
    assert np.array_equal(frame.positions, ball[order])
    assert spherule.inspect(path)["count"] == 100


def test_the_module_imports_nothing_but_numpy():
    code = "import sys, spherule; assert not {'pandas', 'matplotlib'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
