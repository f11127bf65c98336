//! The views of molecules, of particles in a plane, and of clouds without an end.

use glam::DVec3;

use super::Rules;
use crate::manifest::CameraMode;
use crate::scene::azimuth_toward;

/// A molecule is turned if its extent along the view would be more than this part of its largest one.
const ROUND: f64 = 0.85;

/// The least cosine between the smallest extent of a slab that lies and the direction that points up.
const LIES: f64 = 0.95;

/// Angles by which a molecule is turned from its broad side, degrees: they show its depth.
const TILT: [f64; 2] = [14.0, 12.0];

/// The share of the particles of a cloud without an end that are in the picture.
const SHARE: &str = "90%";

impl Rules<'_> {
    /// Molecules show their broad side, with their largest extent from left to right.
    pub(super) fn molecule(&mut self) {
        // Leave the camera alone if the user has set any of it
        let is_alone = self.is_molecular() && !self.has_set("cell.visible");
        let is_open = ["view", "azimuth", "elevation", "up"]
            .iter()
            .all(|name| self.lacks(&format!("camera.{name}")));
        let axes =
            self.facts.axes.filter(|_| is_alone && is_open && self.is_placed_automatically());
        let Some(axes) = axes.filter(|axes| axes.deviations[2] < ROUND * axes.deviations[0]) else {
            return;
        };
        // A slab lies flat
        let is_solid = self.facts.elements.is_some_and(|elements| elements.is_solid);
        if is_solid && axes.directions[2].dot(self.up_direction()).abs() > LIES {
            return;
        }
        // Of both signs, those that are nearest to the usual axes
        let [_, up, toward] = axes.directions;
        let up = if up.dot(self.up_direction()) < 0.0 { -up } else { up };
        let toward = if toward.element_sum() < 0.0 { -toward } else { toward };
        // Turn it a little, so that depth is visible
        let [azimuth, elevation] = TILT;
        let round = |value: f64| (1e4 * value).round() / 1e4;
        let up = up.to_array().map(round);
        let azimuth =
            round(azimuth_toward(DVec3::from_array(up).normalize_or(DVec3::Z), toward) + azimuth);
        let line = "the molecule is seen from its broad side (--view front looks along an axis)";
        self.set(
            [
                ("camera.up", up.to_vec().into()),
                ("camera.azimuth", azimuth.into()),
                ("camera.elevation", elevation.into()),
            ],
            Some(line.to_owned()),
        );
    }

    /// Most of a cloud that thins out on all sides is in the picture.
    pub(super) fn tails(&mut self) {
        if self.facts.has_heavy_tails && self.is_placed_automatically() {
            let line = format!(
                "the picture shows {SHARE} of the particles: they thin out on all sides (--set camera.fit=all shows more)"
            );
            self.set([("camera.fit", SHARE.into())], Some(line));
        }
    }

    /// The direction that points up, with those of the rules so far.
    pub(super) fn up_direction(&self) -> DVec3 {
        let usual = if self.files.is_y_up { DVec3::Y } else { DVec3::Z };
        let found = self.facts.up.filter(|_| self.has_set("input.up"));
        let own = self.manifest.input.up.map(|up| DVec3::from_array(up.vector()));
        own.or(found).unwrap_or(usual)
    }

    pub(super) fn is_placed_automatically(&self) -> bool {
        matches!(self.manifest.camera.mode, CameraMode::Auto | CameraMode::Turntable)
    }

    /// Two-dimensional data are seen from the front, in flat light.
    pub(super) fn flat(&mut self) {
        // Leave the camera alone if the user has set it
        let flat = self.facts.flat_axis().filter(|_| !self.has_set("camera.up"));
        let (Some(axis), true) = (flat, self.is_placed_automatically()) else {
            return;
        };
        // Choose the side
        let side = side_along(axis, self.up_direction());
        if self.lacks("camera.azimuth") && self.lacks("camera.elevation") {
            self.set([("camera.view", side.into())], None);
        }
        // Atoms are told apart by their shading, and so are particles of one colour
        let is_lit = self.facts.elements.is_some() || !self.has_mapped_colors();
        let light = if is_lit { "" } else { " in flat light" };
        let line = format!(
            "the particles lie in a plane: seen from the {side}{light} (--view and --integrator path give others)"
        );
        self.set(
            [("camera.projection", "orthographic".into()), ("render.ground", "none".into())],
            Some(line),
        );
        if is_lit {
            return;
        }
        // Flat light shows colours exactly as in the map
        if self.is_white() && self.lacks("render.integrator") && self.has_plain_material() {
            self.set(
                [
                    ("render.integrator", "whitted".into()),
                    ("material.ambient", 1.0.into()),
                    ("material.diffuse", 0.0.into()),
                    ("material.specular", 0.0.into()),
                ],
                None,
            );
        }
    }
}

/// The side from which a plane without extent along `axis` is seen.
fn side_along(axis: usize, up: DVec3) -> &'static str {
    if up[axis] != 0.0 {
        return "top";
    }
    // The front looks along y if z is up, and along z if y is up
    let front = if up.y != 0.0 { 2 } else { 1 };
    if axis == front { "front" } else { "right" }
}
