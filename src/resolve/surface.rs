//! Radius and material of the surface.

use glam::Vec3;

use crate::manifest::{Absorption, Manifest};
use crate::math::narrow;
use crate::scene::{Bounds, Fresnel, Material, material};
use crate::surface::SurfaceKind;
use crate::survey::Survey;

/// Default distance at which light takes the colour of absorption, and mean distance between scattering events, as a
/// fraction of the diagonal of the bounds: a pool seen from above is tinted or murky, a drop is not. Tuned on dam breaks.
const LENGTH: f64 = 0.25;

/// Radius of the spheres of a union, in particle radii. Spheres that only touch leave gaps between them, and light
/// passes through a sponge of beads; these spheres overlap enough to close the gaps.
const OVERLAP: f32 = 1.8;

/// Radius of spheres in a plane, in half distances of neighbours: those of a square lattice cover the area between them.
const AREA: f32 = std::f32::consts::SQRT_2;

/// Default radius of particles, for frames without radii. Jobs from before the estimate for bodies (`packed_radius`)
/// use the estimate for spheres.
pub(super) fn radius(kind: SurfaceKind, survey: &Survey) -> Option<f32> {
    let packed = match kind {
        SurfaceKind::Spheres if survey.is_flat => survey.radius.map(|radius| AREA * radius),
        SurfaceKind::Spheres => None,
        SurfaceKind::Union => survey.packed_radius.map(|radius| OVERLAP * radius),
        SurfaceKind::Smooth => survey.packed_radius,
    };
    packed.or(survey.radius)
}

/// The material that the manifest describes, with defaults that depend on the size of the scene.
pub(super) fn material(manifest: &Manifest, bounds: &Bounds) -> Material {
    optics(&manifest.material, manifest.surface.kind, bounds)
}

/// The material that the settings `m` describe, of particles with this `kind` of surface.
pub(super) fn optics(
    m: &crate::manifest::Material,
    kind: SurfaceKind,
    bounds: &Bounds,
) -> Material {
    let length_of = |own: Option<f64>| match own {
        Some(length) => narrow(length),
        None => narrow(bounds.diagonal() * LENGTH).max(f32::MIN_POSITIVE),
    };
    let length = length_of(m.absorption_length);
    let usual = m.resolved(match kind {
        SurfaceKind::Spheres => Fresnel::Schlick,
        SurfaceKind::Union | SurfaceKind::Smooth => Fresnel::Exact,
    });
    let absorbing = match m.absorption {
        Absorption::Color(color) => {
            Material { extinction: material::extinction(color, length), ..usual }
        }
        Absorption::OfParticles => Material { color_length: Some(length), ..usual },
    };
    if m.scattering == Vec3::ZERO {
        return absorbing;
    }
    absorbing.with_scattering(m.scattering, length_of(m.scattering_length), m.anisotropy)
}

/// The larger of two values divided by the smaller.
fn ratio(a: f64, b: f64) -> f64 {
    (a / b).max(b / a)
}

/// Rounds `length` to the nearest of 1, 2 and 5 times a power of ten; 1 if it is not positive.
pub(super) fn round(length: f64) -> f32 {
    let power = libm::exp10(libm::log10(length).floor());
    let nearest = [1.0, 2.0, 5.0, 10.0]
        .map(|digit| digit * power)
        .into_iter()
        .min_by(|a, b| ratio(*a, length).total_cmp(&ratio(*b, length)));
    match nearest.map(narrow) {
        Some(length) if length > 0.0 && length.is_finite() => length,
        _ => 1.0,
    }
}

#[cfg(test)]
#[path = "surface_tests.rs"]
mod tests;
