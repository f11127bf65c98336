//! Bodies over some of the particles of a frame: smooth surfaces, and normals that follow from several particles.

use glam::Vec3;
use spherule_files::memory::{MemoryUse, available};
use spherule_formats::Radius;

use super::setup::Setup;
use crate::accel::SphereRadius;
use crate::surface::smooth::{SmoothError, SmoothGrid, SmoothReport};
use crate::surface::{GradientNormals, NormalKind, PcaNormals, ShadingNormals, SurfaceSettings};

/// Radii with a smaller relative difference count as equal.
const RADIUS_TOLERANCE: f32 = 0.01;

/// Builds the smooth surface of particles with these centres and radii in `grid`. Notes what the user may not expect.
///
/// # Errors
/// [`SmoothError`] if it does not fit.
pub(super) fn build_grid(
    setup: &Setup,
    grid: &mut SmoothGrid,
    (centers, radius): (&[Vec3], &Radius),
    settings: &SurfaceSettings,
    notes: &mut Vec<String>,
) -> Result<SmoothReport, SmoothError> {
    let radius = match radius {
        Radius::Common(radius) => *radius,
        Radius::PerParticle(radii) => median_radius(radii, notes),
    };
    // Keep the particles if attributes are looked up at points of the surface
    let rules = &setup.picture.particles;
    let is_colored = rules.color.is_by_particle() || !rules.styles.is_empty();
    let keep = setup.picture.render.channels.needs_particles() || is_colored;
    let left = memory_left(setup.run.memory_limit);
    let made = grid.build(centers, radius, settings, keep, left)?;
    if made.left_out > 0 {
        notes.push(format!(
            "{} particles are too far from all others for the smooth surface and left out",
            made.left_out
        ));
    }
    if made.is_empty {
        notes.push(format!(
            "the smooth surface is empty: with radius {radius} the field of the particles nowhere gets to \
             surface.threshold = {}",
            settings.threshold
        ));
    }
    Ok(made)
}

/// Radii as the input of a builder.
pub(super) fn radius_of(radius: &Radius) -> SphereRadius<'_> {
    match radius {
        Radius::Common(radius) => SphereRadius::Common(*radius),
        Radius::PerParticle(radii) => SphereRadius::Each(radii),
    }
}

/// The median of `radii`, because the field needs a common radius.
fn median_radius(radii: &[f32], notes: &mut Vec<String>) -> f32 {
    let mut sorted = radii.to_vec();
    let middle = sorted.len() / 2;
    if sorted.is_empty() {
        return 1.0;
    }
    let (_, median, _) = sorted.select_nth_unstable_by(middle, f32::total_cmp);
    let median = *median;
    if radii.iter().any(|radius| (radius - median).abs() > RADIUS_TOLERANCE * median) {
        notes.push(format!(
            "radii differ; a smooth surface has one for all, here their median {median} (input.radius sets another)"
        ));
    }
    median
}

/// Bytes that a surface may use: within the limit of the job, and free.
fn memory_left(limit: Option<u64>) -> Option<u64> {
    let used = MemoryUse::now().anonymous;
    let of_limit = limit.map(|limit| limit.saturating_sub(used));
    match (of_limit, available()) {
        (Some(limit), Some(free)) => Some(limit.min(free)),
        (limit, free) => limit.or(free),
    }
}

/// The normals for shading of spheres.
pub(super) fn shading_normals(surface: &SurfaceSettings) -> ShadingNormals {
    match surface.normals {
        NormalKind::Auto | NormalKind::Sphere => ShadingNormals::Sphere,
        NormalKind::Field => ShadingNormals::Gradient(GradientNormals::new(surface.support())),
        NormalKind::Pca => ShadingNormals::Pca(PcaNormals::new(surface.support())),
    }
}
