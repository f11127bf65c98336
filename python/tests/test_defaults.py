"""Defaults that follow from the particles, and what a picture says about itself."""

import numpy as np

import spherule

SMALL = {"size": (64, 48), "samples": 1}


def test_looks_are_an_argument():
    positions = np.random.default_rng(1).random((500, 3))
    white = spherule.render(positions, **SMALL)
    assert tuple(white.srgb[0, 0]) == (255, 255, 255)
    grey = spherule.render(positions, look="studio", **SMALL)
    assert tuple(grey.srgb[0, 0]) != (255, 255, 255)
    assert np.array_equal(white.srgb, spherule.render(positions, settings={"look": "auto"}, **SMALL).srgb)


def test_unknown_looks_are_refused():
    try:
        spherule.render(np.zeros((1, 3)), look="sepia", radius=1)
    except spherule.SettingError as error:
        assert "look" in str(error)
    else:
        raise AssertionError("no error")


def test_a_view_is_used_again():
    positions = np.random.default_rng(2).random((500, 3))
    first = spherule.render(positions, **SMALL)
    assert first.camera["mode"] == "fixed"
    again = spherule.render(positions, camera=first.camera, **SMALL)
    assert np.allclose(again.camera["eye"], first.camera["eye"])
    assert np.array_equal(first.srgb, again.srgb)


def test_planes_are_seen_without_perspective():
    positions = np.random.default_rng(3).random((500, 3))
    positions[:, 2] = 0
    flat = spherule.render(positions, **SMALL)
    assert flat.camera["projection"] == "orthographic"
    again = spherule.render(positions, camera=flat.camera, **SMALL)
    assert np.isclose(again.camera["height"], flat.camera["height"])


def test_elements_have_their_colours():
    positions = np.random.default_rng(4).random((100, 3)) * 10
    atoms = spherule.render(positions, attributes={"element": np.full(100, 8)}, size=(320, 240), samples=1)
    assert any("elements" in note for note in atoms.notes)
