//! `[surface]` and `render.surface`: the surface that rays hit.

use spherule_surface::{NormalKind, SprayStyle, SurfaceKind, SurfaceSettings};

use super::key::Affects;
use super::keys::{Keys, keys};
use super::value::named;

/// Edge of a voxel, in particle radii: the memory of finer voxels grows with the third power, and coarser ones lose
/// drops.
const VOXELS: [f32; 2] = [0.25, 4.0];

/// Smoothing length, in particle radii: with a smaller one, neighbours do not overlap; with a larger one, every
/// particle has thousands of neighbours.
const SMOOTHING_LENGTHS: [f32; 2] = [1.0, 8.0];

/// Maximum threshold; the field is about 1 inside, and rarely higher.
const MAX_THRESHOLD: f32 = 4.0;

/// Maximum amount of whitewater: its drops cover everything long before.
const MAX_AMOUNT: f32 = 8.0;

/// Maximum factor on their radii, with which the largest are as large as particles.
const MAX_SIZE: f32 = 4.0;

named!(SurfaceKind: Spheres = "spheres", Union = "union", Smooth = "smooth");
named!(SprayStyle: Soft = "soft", Spheres = "spheres");
named!(NormalKind: Auto = "auto", Sphere = "sphere", Field = "field", Pca = "pca");

pub(super) const ABOUT: &[&str] =
    &["Settings of the surface; its kind is render.surface; lengths are in particle radii"];

/// The kind of surface, a key of `[render]`.
pub(super) fn kind_key(settings: &mut SurfaceSettings, keys: &mut Keys<'_>) {
    keys!(keys:
        /// What rays hit: spheres, union (overlapping spheres as one body) or smooth (isosurface of the SPH field)
        surface => settings.kind, renamed("medium", "union"), flag("surface", "NAME", "Look");
    );
}

/// The keys of `[surface]`.
pub(super) fn all_keys(settings: &mut SurfaceSettings, keys: &mut Keys<'_>) {
    keys!(keys:
        /// Normals: auto | sphere | field (smooth, not of spheres) | pca (smooth, of spheres)
        normals => settings.normals;
        /// Smoothing of a smooth surface: 0 (every particle shows) to 1 (calm water); drops and thin sheets keep their
        /// shape
        smoothing => settings.smoothing, from(0), to(1), affects(Affects::SmoothSurfaces),
            flag("smoothing", "NUMBER", "Look");
        /// Positions and normals from the particles instead of the grid, without smoothing
        exact => settings.exact, affects(Affects::SmoothSurfaces), flag("exact-surface", "", "Look");
        /// Edge of a voxel in particle radii, like splashsurf's -c
        voxel => settings.voxel, from(VOXELS[0]), to(VOXELS[1]), unit("a number of particle radii"),
            affects(Affects::SmoothSurfaces);
        /// Smoothing length of the kernel in particle radii, like splashsurf's -l
        smoothing_length => settings.smoothing_length, from(SMOOTHING_LENGTHS[0]), to(SMOOTHING_LENGTHS[1]),
            unit("a number of particle radii"), affects(Affects::Bodies);
        /// Value of the field at the surface, like splashsurf's -t; a larger value makes the body thinner
        threshold => settings.threshold, above(0), to(MAX_THRESHOLD), affects(Affects::SmoothSurfaces);
        /// Particles with few neighbours become foam and spray outside the surface
        spray => settings.spray, affects(Affects::Bodies), flag("spray", "", "Look");
        /// Spray, foam and bubbles of a smooth surface where its flow mixes with air; needs velocities
        ///
        /// Spray is in the air, foam on the surface, bubbles below it. It includes the particles that `spray` draws, if
        /// they are fast.
        whitewater => settings.whitewater, affects(Affects::SmoothSurfaces), flag("whitewater", "", "Look");
        /// Speed of violent water, to which the speeds in whitewater are relative, in the unit of the velocities
        ///
        /// auto: the speed of the fastest particles of the sequence, but at least two fifths of that of a fall over its
        /// height in metres. A larger speed gives less whitewater.
        whitewater_speed => settings.whitewater_speed, or("auto"), unit("a speed"), above(0), single(),
            affects(Affects::Whitewater);
        /// Factor on the number of drops of whitewater
        whitewater_amount => settings.whitewater_amount, above(0), to(MAX_AMOUNT), affects(Affects::Whitewater);
        /// Factor on the radii of the drops of whitewater, which are 0.012 to 0.25 particle radii
        ///
        /// In simulations with few particles, a half with four times the amount is a finer mist.
        whitewater_size => settings.whitewater_size, above(0), to(MAX_SIZE), affects(Affects::Whitewater);
        /// Foam, spray and whitewater: soft (clusters of white drops that fade out) | spheres
        ///
        /// whitted draws spheres only.
        spray_style => settings.spray_style, affects(Affects::Spray);
    );
}
