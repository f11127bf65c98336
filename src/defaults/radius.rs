//! Radii of particles that have none under a name that always means one: from other columns, or from their distances.

use toml::Value;

use super::Rules;
use crate::surface::SurfaceKind;
use crate::survey::GrainRadius;

impl Rules<'_> {
    /// Columns whose values are plausible radii are radii.
    pub(super) fn grains(&mut self) {
        let is_open = !self.facts.has_radii && !self.is_molecular() && !self.draws_a_body();
        if let Some(grains) = self.facts.grain_radius.as_ref().filter(|_| is_open) {
            let GrainRadius { attribute, scale } = grains;
            let what = if *scale == 1.0 { "radii" } else { "diameters" };
            let line =
                format!("`{attribute}` has the {what} (--radius auto follows the distances)");
            let pairs = [("attribute", attribute.clone().into()), ("scale", Value::from(*scale))];
            let keys = pairs.map(|(key, value)| (key.to_owned(), value));
            let radius: Value = toml::Table::from_iter(keys).into();
            self.set([("input.radius", radius)], Some(line));
        }
    }

    /// Particles at one place have no spacing.
    pub(super) fn lone(&mut self) {
        let is_point = self.facts.bounds.is_some_and(|(min, max)| min == max);
        let has_size =
            self.facts.has_radii || self.facts.elements.is_some() || self.has_set("input.radius");
        if is_point && !has_size && !self.draws_a_body() {
            let line =
                "radius 1, as particles at one place have no spacing (--radius gives another)";
            self.set([("input.radius", 1.0.into())], Some(line.to_owned()));
        }
    }

    /// Particles in a plane or on a surface have the radius that covers it.
    pub(super) fn sheet(&mut self) {
        let is_open = !self.facts.has_radii && !self.is_molecular() && !self.draws_a_body();
        if let Some(radius) = self.facts.covering_radius.filter(|_| is_open) {
            let radius = three_digits(radius);
            let is_flat = self.facts.flat_axis().is_some();
            let what = if is_flat { "plane" } else { "surface" };
            let line = format!(
                "radius {radius}, large enough to cover the {what} of the particles (--radius gives another)"
            );
            self.set([("input.radius", radius.into())], Some(line));
            // Nothing falls on the floor under a surface, but thin layers of a fluid lie on it
            if !is_flat && !self.facts.has_velocities {
                self.set([("render.ground", "none".into())], None);
            }
        }
    }

    /// Particles at random distances have the radius that follows from their density.
    pub(super) fn random(&mut self) {
        let is_open = self.facts.elements.is_none() && self.facts.flat_axis().is_none();
        if let Some(radius) = self.facts.random_radius.filter(|_| is_open && !self.draws_a_body()) {
            let radius = three_digits(radius);
            let line = format!(
                "radius {radius}, from the density, as the particles are at random distances (--radius gives another)"
            );
            self.set([("input.radius", radius.into())], Some(line));
        }
    }

    /// Whether the particles are drawn as one body.
    fn draws_a_body(&self) -> bool {
        self.manifest.surface.kind != SurfaceKind::Spheres
    }
}

/// A positive number with three significant digits.
pub(super) fn three_digits(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}
