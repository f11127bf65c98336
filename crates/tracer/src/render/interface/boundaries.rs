//! What belongs to the boundaries between the media of several bodies and air.

use super::{Dielectric, Interface, interface_of, smooth_interface_of};
use crate::render::bodies::{MediumBoundary, TransmissiveBodies};
use crate::render::body_set::AIR;
use crate::scene::Material;

/// A value for each boundary between two media.
pub(in crate::render) struct BoundaryTable<T> {
    /// For each body, the values of its boundaries with those of lower priority, and with air.
    of_bodies: Vec<Vec<T>>,
}

impl<T> BoundaryTable<T> {
    /// The values that `make` returns for the material of a body with its index of refraction relative to the medium
    /// outside.
    fn new(bodies: &TransmissiveBodies<'_>, make: impl Fn(&Material) -> T) -> Self {
        let materials: Vec<&Material> = bodies.all().iter().map(|body| body.material).collect();
        let row = |body: usize| {
            let inner = materials[body];
            let others = materials[body + 1..].iter().map(|outer| inner.ior / outer.ior);
            let relative = others.chain([inner.ior]).map(|ior| Material { ior, ..*inner });
            relative.map(|material| make(&material)).collect()
        };
        Self { of_bodies: (0..materials.len()).map(row).collect() }
    }

    /// The value of a boundary.
    #[inline]
    pub(in crate::render) fn of(&self, boundary: MediumBoundary) -> &T {
        let MediumBoundary { body, outer } = boundary;
        let row = &self.of_bodies[body];
        if outer == AIR { &row[row.len() - 1] } else { &row[outer - body - 1] }
    }
}

impl BoundaryTable<Box<dyn Interface>> {
    /// Smooth interfaces.
    pub(in crate::render) fn smooth(bodies: &TransmissiveBodies<'_>) -> Self {
        Self::new(bodies, |material| smooth_interface_of(material, true))
    }

    /// Smooth or rough interfaces, for path tracing.
    pub(in crate::render) fn for_paths(bodies: &TransmissiveBodies<'_>) -> Self {
        Self::new(bodies, |material| interface_of(material, true))
    }
}

impl BoundaryTable<Dielectric> {
    /// Constants for shadow rays.
    pub(in crate::render) fn for_shadow_rays(bodies: &TransmissiveBodies<'_>) -> Self {
        Self::new(bodies, Dielectric::for_straight_rays)
    }
}
