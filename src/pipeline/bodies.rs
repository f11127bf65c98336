//! Bodies over some of the particles of a frame: smooth surfaces, and normals that follow from several particles.

use glam::Vec3;
use spherule_files::memory::{MemoryUse, available};
use spherule_formats::Radius;

use super::setup::Setup;
use crate::accel::SphereRadius;
use crate::surface::contact::near;
use crate::surface::smooth::{SmoothError, SmoothGrid, SmoothReport};
use crate::surface::{GradientNormals, NormalKind, PcaNormals, ShadingNormals, SurfaceSettings};

/// Radii with a smaller relative difference count as equal.
const RADIUS_TOLERANCE: f32 = 0.01;

/// Clear bodies extend so far into bodies with priority that they touch, in supports of the kernel: the field beside the
/// line where both meet air must be complete, also after it is blurred. Tuned on a block of water with a layer of oil: with
/// 1.25, there is a band along that line.
const CONTACT_REACH: f32 = 2.0;

/// Factor on the threshold of such bodies. Without it, surfaces of both bodies would coincide beside the line where these
/// and air meet, and reflect at random like one or the other.
const CONTACT_THRESHOLD: f32 = 1.02;

/// The particles of a body.
#[derive(Clone, Copy)]
pub(super) struct BodyParticles<'a> {
    pub(super) centers: &'a [Vec3],
    pub(super) radius: &'a Radius,
    /// Centres of particles of clear bodies that have priority over it. Surfaces of single liquids have gaps between them,
    /// because the field of each falls off there; the field of both does not.
    pub(super) prior: &'a [Vec3],
}

/// Builds the smooth surface of `particles` in `grid`. Notes what the user may not expect.
///
/// # Errors
/// [`SmoothError`] if it does not fit.
pub(super) fn build_grid(
    setup: &Setup,
    grid: &mut SmoothGrid,
    particles: BodyParticles<'_>,
    settings: &SurfaceSettings,
    notes: &mut Vec<String>,
) -> Result<SmoothReport, SmoothError> {
    let radius = match particles.radius {
        Radius::Common(radius) => *radius,
        Radius::PerParticle(radii) => median_radius(radii, notes),
    };
    // Keep the particles if attributes are looked up at points of the surface
    let rules = &setup.picture.particles;
    let is_colored = rules.first().color.is_by_particle() || rules.is_divided();
    let keep = setup.picture.render.channels.needs_particles() || is_colored;
    let left = memory_left(setup.run.memory_limit);
    let own = particles.centers;
    let prior = near(own, particles.prior, CONTACT_REACH * settings.support() * radius);
    let made = if prior.is_empty() {
        grid.build(own, radius, settings, keep, left)?
    } else {
        let threshold = CONTACT_THRESHOLD * settings.threshold;
        let settings = SurfaceSettings { threshold, ..*settings };
        let made = grid.build(&[own, &prior].concat(), radius, &settings, keep, left)?;
        grid.set_own_particles(u32::try_from(own.len()).unwrap_or(u32::MAX));
        made
    };
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

/// The radius that a body of particles with these radii has.
pub(super) fn common_radius(radius: &Radius) -> f32 {
    match radius {
        Radius::Common(radius) => *radius,
        Radius::PerParticle(radii) => median_radius(radii, &mut Vec::new()),
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
pub(super) fn memory_left(limit: Option<u64>) -> Option<u64> {
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
