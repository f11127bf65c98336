//! Rules between the keys of `[camera]`.

use crate::rule::{Rule, rules};

const FIXED_NEEDS: &str = "a fixed camera needs it, such as [5.0, 5.0, 0.0]";
const AUTO_CHOOSES: &str =
    "is given, but the automatic camera chooses its own; set mode = \"fixed\"";
const KEYS_HAVE: &str = "is given, but each [[camera.key]] has its own";
const IS_PLACED: &str = "is given, but eye and look_at place the camera; remove it or them";
const HAS_ANGLES: &str = "is given, but so are azimuth or elevation; remove it or them";
const PAIRS_HAVE_NO_LENS: &str =
    "is true, but stereo pairs have no depth of field; remove f_stop and aperture";

/// Without a mode, the camera is fixed if there is an eye, moves through the keys if there are keys, and is automatic
/// otherwise.
pub(crate) const RULES: &[Rule] = rules! {
    // Each mode has keys of its own
    "mode" Is["fixed"] => "eye", "look_at" Given: FIXED_NEEDS;
    "mode" Missing, "eye" Given => "look_at" Given: FIXED_NEEDS;
    "mode" Is["auto"] => "eye", "look_at" Missing: AUTO_CHOOSES;
    "mode" Missing, "eye" Missing, "key" Missing => "look_at" Missing: AUTO_CHOOSES;
    "mode" Is["keys"] => "eye", "look_at" Missing: KEYS_HAVE;
    "mode" Missing, "eye" Missing, "key" Given => "look_at" Missing: KEYS_HAVE;
    "mode" Is["keys"] => "key" Given: "mode = \"keys\" needs at least one [[camera.key]]";
    "mode" Is["turntable"] => "eye", "look_at" Missing:
        "is given, but a turntable finds its own; azimuth and elevation place it";
    "mode" Is["turntable"] => "center" Missing:
        "is given, but a turntable turns around the particles; remove it";
    "f_stop" IsNot["0"] => "aperture" Missing: "is given, but so is f_stop; remove one of them";
    // Each projection has keys of its own
    "projection" Is["orthographic"] => "fov" MissingOr["45"]:
        "is given, but an orthographic picture has a height instead; remove it";
    "projection" Is["equirectangular"] => "fov" MissingOr["45"]:
        "is given, but an equirectangular picture shows all directions; remove it";
    "projection" IsNot["perspective"] => "f_stop", "aperture" MissingOr["0"]:
        "is given, but only perspective has depth of field; remove it";
    "projection" MissingOrNot["orthographic"] => "height" MissingOr["auto"]:
        "is given, but only projection = \"orthographic\" has a height; fov sets the size in perspective";
    "projection" Is["equirectangular"] => "mode" MissingOrNot["turntable"]:
        "is turntable, but an equirectangular picture shows all directions already; use auto, fixed or keys";
    "projection" Is["equirectangular"] => "elevation" Missing:
        "is given, but the horizon is in the middle of an equirectangular picture; remove it";
    // A view along an axis stands for azimuth and elevation
    "mode" Is["fixed", "keys"] => "view" Missing: IS_PLACED;
    "mode" Missing, "eye" Given => "view" Missing: IS_PLACED;
    "mode" Missing, "key" Given => "view" Missing: IS_PLACED;
    "mode" Is["turntable"] => "view" MissingOrNot["top", "bottom"]:
        "is along the axis of the turntable; choose another one, or elevation = 80, for example";
    "azimuth" Given => "view" Missing: HAS_ANGLES;
    "elevation" Given => "view" Missing: HAS_ANGLES;
    "projection" Is["equirectangular"] => "view" MissingOr["front", "back", "left", "right"]:
        "must be front, back, left or right, because the horizon is in the middle of an equirectangular picture";
    // Stereo pairs have two eyes, which see different things
    "stereo" MissingOr["false"] => "eye_distance", "convergence" MissingOr["auto"]:
        "is given, but there is only one eye; set stereo = true";
    "projection" Is["orthographic"] => "stereo" MissingOr["false"]:
        "is true, but both eyes see the same in orthographic projection; use perspective";
    "f_stop" IsNot["0"] => "stereo" MissingOr["false"]: PAIRS_HAVE_NO_LENS;
    "aperture" IsNot["0"] => "stereo" MissingOr["false"]: PAIRS_HAVE_NO_LENS;
    "projection" Is["equirectangular"], "stereo" Is["true"] => "eye_distance" IsNot["auto"]:
        "an equirectangular stereo pair needs it, in scene units, such as 0.065";
    "projection" Is["equirectangular"], "stereo" Is["true"] => "convergence" MissingOr["auto"]:
        "is given, but the eyes of an equirectangular stereo pair look in parallel directions; remove it";
};
