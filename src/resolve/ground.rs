//! The ground under the particles.

use crate::math::narrow;
use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::surface;
use crate::manifest::{GroundKind, GroundPattern, GroundReach, Manifest};
use crate::pipeline::Setup;
use crate::render::IntegratorKind;
use crate::scene::ground::{GroundImage, Pattern};
use crate::scene::{Bounds, Ground, Texture, WetGround};
use crate::surface::SurfaceKind;

/// Default edge of a square on the ground as a fraction of the diagonal of the bounds: some squares can be counted
/// through the particles, and none is only a few pixels wide.
const TILE: f64 = 1.0 / 8.0;

/// Greatest depth of spheres in a shadow catcher in jobs of earlier versions, as a fraction of the diagonal of the bounds.
/// Spheres with a greater radius are less deep, in proportion.
const SUNK: f64 = 1.0 / 100.0;

/// Distance from the box of the particles at which shadows have faded out, in its diagonals: the ground is white at the
/// edges of the picture.
const SHADOW: f32 = 0.25;

/// Distances from the middle at which shadows start to fade and have faded out in jobs of earlier versions, in diagonals.
const FAR_FADE: [f32; 2] = [2.0, 8.0];

/// Where the ground is.
#[derive(Debug, Clone, Copy)]
pub(super) struct GroundPlace<'a> {
    /// Box of the particles.
    pub(super) bounds: &'a Bounds,
    /// Distance by which the particles reach beyond their centres.
    pub(super) reach: f64,
    pub(super) up: DVec3,
    pub(super) origin: DVec3,
    /// Whether particles lie on the lower side of the box at some time.
    pub(super) has_layer: bool,
    /// Whether the job is of an earlier version: spheres are sunk in a shadow catcher, whose shadows reach far.
    pub(super) is_of_earlier_version: bool,
    /// The lowest place of spheres with radii of their own along `up`, world units.
    pub(super) lowest: Option<f64>,
}

/// The ground of `render.ground`, if there is one.
pub(super) fn ground(manifest: &Manifest, place: &GroundPlace<'_>) -> Option<Ground> {
    let render = &manifest.render;
    let integrator = manifest.integrator();
    let kind = match &render.ground {
        Some(ground) => ground.kind,
        // Without a ground under the particles, a shadow would fall on nothing
        None if integrator == IntegratorKind::Path && place.has_layer => GroundKind::ShadowCatcher,
        None => GroundKind::None,
    };
    if kind == GroundKind::None {
        return None;
    }
    let is_catcher = kind == GroundKind::ShadowCatcher;
    // Put it under the particles, as a catcher or as a surface
    let mut ground = placed(manifest, place, is_catcher);
    if is_catcher {
        return Some(shadow_catcher(ground, place, render.ground_shadow));
    }
    // Colour it
    ground.color = render.ground_color;
    let tile = || match render.ground_tile {
        Some(tile) => narrow(tile),
        None => surface::round(place.bounds.diagonal() * TILE),
    };
    ground.pattern = match (kind, render.ground_pattern) {
        // `add_image` adds the picture
        (GroundKind::Image, _) => Pattern::Plain,
        (GroundKind::Checker, _) | (_, GroundPattern::Checker) => Pattern::Checker { tile: tile() },
        (_, GroundPattern::Sand) => Pattern::Sand { tile: tile() },
        (_, GroundPattern::Plain) => Pattern::Plain,
    };
    let is_far = match render.ground_reach {
        GroundReach::Auto => integrator == IntegratorKind::Path && manifest.environment.visible,
        reach => reach == GroundReach::Far,
    };
    Some(if is_far { ground.reaching(render.haze.map(narrow)) } else { ground })
}

/// The ground under the particles or at its height, without colour.
fn placed(manifest: &Manifest, place: &GroundPlace<'_>, is_catcher: bool) -> Ground {
    let GroundPlace { bounds, up, origin, .. } = *place;
    let mut ground = Ground::under(bounds, up.as_vec3(), origin);
    if let Some(height) = manifest.render.ground_height {
        let relative = narrow(height - origin.dot(up.normalize_or(DVec3::Z)));
        ground.center += (relative - ground.height) * ground.up;
        ground.height = relative;
    } else if manifest.surface.kind != SurfaceKind::Spheres {
        // Raise it to the lowest centres: between a body that only touched the ground and the ground itself would be
        // a thin layer of air, which reflects all light at grazing angles
        ground.raise(narrow(place.reach));
    } else if let Some(lowest) = place.lowest {
        // The lowest sphere may be smaller than most
        let relative = narrow(lowest - origin.dot(up.normalize_or(DVec3::Z)));
        ground.raise((relative - ground.height).max(0.0));
    } else if is_catcher && place.is_of_earlier_version {
        let most = (SUNK * bounds.diagonal()).powi(2) / place.reach;
        ground.raise(narrow(place.reach.min(most)));
    }
    ground
}

/// The ground as a shadow catcher of this strength. Its shadows fade out at a distance from the particles.
fn shadow_catcher(ground: Ground, place: &GroundPlace<'_>, strength: f32) -> Ground {
    let size = (place.bounds.max - place.bounds.min).as_vec3();
    let (base, [fade_start, fade_end]) = if place.is_of_earlier_version {
        (Vec3::ZERO, FAR_FADE.map(|part| part * size.length()))
    } else {
        (0.5 * size, [0.0, SHADOW * size.length()])
    };
    let lit_range = fade_start;
    Ground { base, fade_start, fade_end, lit_range, ..ground.into_shadow_catcher(strength) }
}

/// Lays `texture` on the ground of `setup`, if `manifest` says so.
pub(super) fn add_image(setup: &mut Setup, manifest: &Manifest, texture: &Arc<Texture>) {
    let scene = &mut setup.picture.scene;
    let (Some(image), Some(ground)) = (manifest.ground_image(), &mut scene.ground) else {
        return;
    };
    let [min, max] = scene.particles;
    let width = match image.width {
        Some(width) => narrow(width),
        None => surface::round(f64::from((max - min).length())),
    };
    let center = image.center.map(|center| (center - scene.origin).as_vec3());
    ground.pattern = Pattern::Image(GroundImage {
        texture: Arc::clone(texture),
        width,
        center: center.unwrap_or(ground.center),
        rotation: narrow(image.rotation.to_radians()),
        repeats: image.repeats,
    });
}

/// How the liquid wets the ground; shadow catchers stay dry.
pub(super) fn wet_ground(manifest: &Manifest, place: &GroundPlace<'_>) -> Option<WetGround> {
    let (strength, margin) = (manifest.render.ground_wetness, narrow(place.reach));
    let has_margin = margin > 0.0 && margin.is_finite();
    let is_wet = strength > 0.0 && has_margin && manifest.has_path_traced_body();
    is_wet.then_some(WetGround { strength, margin })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manifest::GroundSetting;

    const BOUNDS: Bounds =
        Bounds { min: DVec3::new(-1.0, -2.0, 3.0), max: DVec3::new(1.0, 2.0, 7.0) };

    fn of(kind: GroundKind, change: impl Fn(&mut Manifest)) -> Option<Ground> {
        let mut manifest = Manifest::new("in");
        manifest.render.ground = Some(GroundSetting::of(kind));
        change(&mut manifest);
        ground(&manifest, &place(true))
    }

    fn place(has_layer: bool) -> GroundPlace<'static> {
        GroundPlace {
            bounds: &BOUNDS,
            reach: 0.25,
            up: DVec3::Z,
            origin: DVec3::ZERO,
            has_layer,
            is_of_earlier_version: true,
            lowest: None,
        }
    }

    #[test]
    fn auto_is_a_shadow_catcher_of_paths_under_particles_on_a_floor() {
        let auto = Manifest::new("in");
        let found = |manifest: &Manifest, has_layer| ground(manifest, &place(has_layer));
        assert!(found(&auto, true).is_some_and(|ground| ground.shadow_catcher.is_some()));
        assert_eq!(found(&auto, false), None);
        let mut whitted = auto;
        whitted.render.integrator = Some(IntegratorKind::Whitted);
        assert_eq!(found(&whitted, true), None);
    }

    #[test]
    fn each_kind_has_its_height_and_colour() {
        assert_eq!(of(GroundKind::None, |_| {}), None);
        let plain = of(GroundKind::Plain, |_| {}).unwrap();
        assert_eq!((plain.height, plain.pattern), (3.0, Pattern::Plain));
        let checker = of(GroundKind::Checker, |_| {}).unwrap();
        assert!(matches!(checker.pattern, Pattern::Checker { .. }));
        let pattern = |manifest: &mut Manifest| {
            manifest.render.ground_pattern = GroundPattern::Checker;
        };
        assert_eq!(of(GroundKind::Plain, pattern), Some(checker));
        // A shadow catcher goes through the lowest centres, but not far above the lowest points of large spheres, and
        // fades from 2 to 8 diagonals, which are 6 long
        let catcher = of(GroundKind::ShadowCatcher, |m| m.render.ground_shadow = 0.5).unwrap();
        assert_eq!((catcher.height, catcher.shadow_catcher), (3.0144, Some(0.5)));
        let standing = GroundPlace { is_of_earlier_version: false, ..place(true) };
        let mut manifest = Manifest::new("in");
        manifest.render.ground = Some(GroundSetting::of(GroundKind::ShadowCatcher));
        assert_eq!(ground(&manifest, &standing).unwrap().height, 3.0);
        // Spheres of different sizes: the lowest one is smaller than most
        let mixed = GroundPlace { lowest: Some(3.4), ..standing };
        assert_eq!(ground(&manifest, &mixed).unwrap().height, 3.4);
        let under_body = of(GroundKind::ShadowCatcher, |m| {
            m.surface.kind = SurfaceKind::Union;
        });
        assert_eq!(under_body.unwrap().height, 3.25);
        assert_eq!([catcher.fade_start, catcher.fade_end], [12.0, 48.0]);
        let low = of(GroundKind::ShadowCatcher, |m| m.render.ground_height = Some(2.0));
        assert_eq!(low.unwrap().height, 2.0);
    }
}
