//! Mist above the ground.

use glam::Vec3;

use crate::manifest::Manifest;
use crate::math::narrow;
use crate::scene::{Bounds, Mist, Scene};

/// Default scale height as a fraction of the diagonal of the bounds. Tuned on dam breaks.
const HEIGHT: f64 = 0.1;

/// The mist of `[mist]`, if there is some: above the ground of `scene`, or above the lowest point of its particles, which
/// are in `bounds`.
pub(super) fn mist(manifest: &Manifest, bounds: &Bounds, scene: &Scene, up: Vec3) -> Option<Mist> {
    let settings = &manifest.mist;
    let visibility = narrow(settings.visibility?);
    let height = settings.height.unwrap_or(HEIGHT * bounds.diagonal());
    let up = up.normalize_or(Vec3::Z);
    let lowest = || {
        let corners = bounds.corners().map(|corner| (corner - scene.origin).as_vec3().dot(up));
        corners.into_iter().fold(f32::INFINITY, f32::min)
    };
    Some(Mist {
        up,
        base: scene.ground.as_ref().map_or_else(lowest, |ground| ground.height),
        scale_height: narrow(height).max(f32::MIN_POSITIVE),
        extinction: Mist::extinction_for(visibility),
        albedo: settings.color,
        anisotropy: settings.anisotropy,
    })
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::scene::{Camera, CameraView, Ground};

    #[test]
    fn mist_begins_at_the_ground_or_at_the_lowest_particles() {
        let view = CameraView { eye: DVec3::X, look_at: DVec3::ZERO, up: DVec3::Z, fov: 30.0 };
        let origin = DVec3::new(0.0, 0.0, 1.0);
        let camera = Camera::new(&view, 1.0, origin).unwrap();
        let mut scene = Scene { origin, ..Scene::new(camera) };
        let bounds = Bounds { min: DVec3::new(-1.0, -2.0, 3.0), max: DVec3::new(1.0, 2.0, 7.0) };
        let mut manifest = Manifest::new("in");
        let of = |manifest: &Manifest, scene: &Scene| mist(manifest, &bounds, scene, 2.0 * Vec3::Z);
        assert_eq!(of(&manifest, &scene), None);
        manifest.mist.visibility = Some(3.912);
        let found = of(&manifest, &scene).unwrap();
        assert_eq!((found.up, found.base, found.extinction), (Vec3::Z, 2.0, 1.0));
        // A tenth of the diagonal, which is 6 long
        assert!((found.scale_height - 0.6).abs() < 1e-6);
        scene.ground = Some(Ground::under(&bounds, Vec3::Z, DVec3::ZERO));
        manifest.mist.height = Some(0.25);
        let found = of(&manifest, &scene).unwrap();
        assert_eq!((found.base, found.scale_height), (3.0, 0.25));
        // The range of the keys leaves nothing that the renderer refuses
        for extreme in [1e-37, 1e-30, 1.0, 1e30, 3e38] {
            (manifest.mist.visibility, manifest.mist.height) = (Some(extreme), Some(extreme));
            of(&manifest, &scene).unwrap().validate().unwrap();
        }
    }
}
