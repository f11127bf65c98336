"""Pictures of arrays: the bytes of the command, planes without copies, layouts and precision."""

import gc
import subprocess
import sys
import zlib

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


def test_pixels_are_those_of_the_png(ball, small):
    image = spherule.render(ball, radius=0.3, **small)
    pixels = image.srgb
    assert pixels.shape == (18, 32, 3) and pixels.dtype == np.uint8 and not pixels.flags.writeable
    assert np.array_equal(pixels, decoded(image.to_png()))
    assert np.asarray(image) is pixels
    copy = np.array(image)
    copy[0, 0] = 1
    assert np.asarray(image, dtype=float).max() == pixels.max()


def decoded(png):
    """The pixels of a PNG of 8-bit RGB."""
    width, height = (int.from_bytes(png[at : at + 4], "big") for at in (16, 20))
    at, packed = 8, b""
    while at < len(png):
        length, kind = int.from_bytes(png[at : at + 4], "big"), png[at + 4 : at + 8]
        if kind == b"IDAT":
            packed += png[at + 8 : at + 8 + length]
        at += 12 + length
    rows = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(height, 1 + 3 * width)
    pixels = np.zeros((height, width, 3), np.uint8)
    for y, row in enumerate(rows):
        kind, row = row[0], row[1:].reshape(width, 3).astype(int)
        for x in range(width):
            left = pixels[y, x - 1].astype(int) if x else np.zeros(3, int)
            up = pixels[y - 1, x].astype(int) if y else np.zeros(3, int)
            corner = pixels[y - 1, x - 1].astype(int) if x and y else np.zeros(3, int)
            distances = np.abs([up - corner, left - corner, left + up - 2 * corner])
            paeth = np.where(
                (distances[0] <= distances[1]) & (distances[0] <= distances[2]),
                left,
                np.where(distances[1] <= distances[2], up, corner),
            )
            guess = [0, left, up, (left + up) // 2, paeth][kind]
            pixels[y, x] = (row[x] + guess) % 256
    return pixels


def test_colours_by_name_and_by_particle(ball, small):
    speed = np.linspace(0, 1, len(ball), dtype=np.float32)
    by_dict = spherule.render(ball, radius=0.3, attributes={"s": speed}, color={"attribute": "s"}, **small)
    by_name = spherule.render(ball, radius=0.3, attributes={"s": speed}, color="s", **small)
    assert by_name.to_exr() == by_dict.to_exr()
    colors = np.random.default_rng(5).random((len(ball), 3), dtype=np.float32)
    by_array = spherule.render(ball, radius=0.3, color=colors, **small)
    by_attribute = spherule.render(ball, radius=0.3, attributes={"Cd": colors}, color={"attribute": "Cd"}, **small)
    assert by_array.to_exr() == by_attribute.to_exr() != by_name.to_exr()
    with pytest.raises(spherule.ArrayError, match="color: attributes have"):
        spherule.render(ball, radius=0.3, attributes={"Cd": colors}, color=colors, **small)
    with pytest.raises(spherule.ArrayError, match="color: expected three numbers"):
        spherule.render(ball, radius=0.3, color=colors[:7], **small)


def test_cells_are_kept_and_drawn(ball, small, tmp_path):
    dump = tmp_path / "a.dump"
    rows = "".join(f"{i} {x} {y} {z}\n" for i, (x, y, z) in enumerate(ball))
    bounds = "ITEM: BOX BOUNDS pp pp ff\n-4 4\n-4 4\n-5 5\n"
    dump.write_text(f"ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n100\n{bounds}ITEM: ATOMS id x y z\n{rows}")
    frame = spherule.read(dump)
    assert np.array_equal(frame.cell.vectors, np.diag([8.0, 8, 10]))
    assert tuple(frame.cell.origin) == (-4, -4, -5) and tuple(frame.cell.periodic) == (True, True, False)
    visible = {"cell.visible": True}
    of_file = spherule.render(frame, radius=0.3, settings=visible, **small).to_exr()
    hidden = {"cell.visible": False}
    assert of_file != spherule.render(frame, radius=0.3, settings=hidden, **small).to_exr()
    cell = spherule.Cell([8, 8, 10], origin=(-4, -4, -5))
    # Rules of a look would be among the notes
    plain = {"radius": 0.3, "settings": visible, "look": "none", **small}
    attributes = frame.attributes
    of_array = spherule.render(ball, attributes=attributes, cell=cell, **plain)
    same = spherule.render(frame.positions, attributes=attributes, cell=cell, **plain)
    assert of_array.notes == same.notes == []
    assert spherule.render(ball, cell=np.eye(3) * 8, **plain).notes == []
    with pytest.raises(spherule.ArrayError, match="cell: expected the edges"):
        spherule.render(ball, cell=np.ones((2, 3)), **small)


def test_radii_of_elements_and_topologies(small, tmp_path):
    molecules = "3\n\nO 0 0 0\nH 0.96 0 0\nH -0.24 0.93 0\n"
    (tmp_path / "water.xyz").write_text(molecules)
    frame = spherule.read(tmp_path / "water.xyz")
    by_argument = spherule.render(frame, radius="vdw", **small).to_exr()
    assert by_argument == spherule.render(frame, settings={"input.radius": "vdw"}, **small).to_exr()
    with pytest.raises(spherule.ArrayError, match="radius: expected a number or an array"):
        spherule.write_spf(tmp_path / "a.spf", frame.positions, radius="vdw")
    # Another trajectory with the same atoms, without their elements
    (tmp_path / "plain.csv").write_text("x,y,z\n0,0,0\n1,0,0\n0,1,0\n")
    assert "element" not in spherule.read(tmp_path / "plain.csv").attributes
    with_elements = spherule.read(tmp_path / "plain.csv", topology=tmp_path / "water.xyz")
    assert with_elements.attributes["element"].tolist() == [8, 1, 1]
