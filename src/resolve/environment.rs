//! The environment of the scene.

use std::path::Path;
use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::lights::group_index;
use super::{ResolveError, SceneInputs};
use crate::manifest::{EnvironmentKind, ExtractSun, Manifest};
use crate::render::IntegratorKind;
use crate::scene::environment::{
    ClearSky, DetailMap, MapSun, SkySettings, sky_direction, studio, take_suns,
};
use crate::scene::framing::view_direction;
use crate::scene::{self, CameraView, Environment, EnvironmentAxes, Light, RadianceMap};

/// An image of the environment, as far as pictures need it.
#[derive(Debug, Clone)]
pub struct EnvironmentMap {
    /// In the resolution of environments, without the suns.
    reduced: RadianceMap,
    /// At its own resolution, if that is higher and the camera sees it.
    detail: Option<Arc<DetailMap>>,
    /// The suns, which are lights.
    suns: Vec<MapSun>,
}

impl EnvironmentMap {
    /// The image `map` with the settings of `manifest`.
    pub fn new(manifest: &Manifest, mut map: RadianceMap) -> Self {
        let settings = &manifest.environment;
        let suns = match settings.extract_sun {
            ExtractSun::Auto => take_suns(&mut map),
            ExtractSun::Off => Vec::new(),
        };
        let detail = if settings.detail { DetailMap::of(&map).map(Arc::new) } else { None };
        Self { reduced: map.reduced(), detail, suns }
    }

    /// Notes for the user on the image at a `path`.
    pub fn notes(&self, path: &Path) -> Vec<String> {
        let negative = self.reduced.negative();
        let negative =
            (negative > 0).then(|| format!("{negative} pixels are negative, which counts as 0"));
        let suns = self.suns.iter().map(|sun| {
            let elevation = libm::asin(f64::from(sun.direction.z)).to_degrees();
            let size = 2.0 * sun.half_angle.to_degrees();
            let [red, green, blue] = sun.irradiance.to_array();
            format!(
                "the sun in it is a light: elevation {elevation:.1}, size {size:.2} degrees, irradiance \
                 [{red:.3}, {green:.3}, {blue:.3}] (--set environment.extract_sun=off leaves it in the image)"
            )
        });
        negative.into_iter().chain(suns).map(|note| format!("{}: {note}", path.display())).collect()
    }
}

/// An environment that is kept for other views.
#[derive(Debug)]
pub struct KeptEnvironment {
    environment: Environment,
    /// Irradiance of the sun of a sky on a surface that faces it, linear RGB.
    sun: Vec3,
}

/// Light from infinitely far away.
#[derive(Debug, Default)]
pub(super) struct Surroundings {
    /// The environment of the path integrator.
    pub(super) environment: Option<Arc<Environment>>,
    /// Its suns: that of a sky, or those of an image.
    pub(super) suns: Vec<Light>,
}

/// The surroundings as they are placed by the first `view` of the camera.
pub(super) fn surroundings(
    manifest: &Manifest,
    inputs: &SceneInputs<'_>,
    view: &CameraView,
    up: DVec3,
) -> Result<Surroundings, ResolveError> {
    if manifest.integrator() != IntegratorKind::Path {
        return Ok(Surroundings::default());
    }
    // A studio and a sky turn with the camera, an image stays where it is
    let settings = &manifest.environment;
    let forward = match settings.kind {
        EnvironmentKind::Image => view_direction(up.normalize_or(DVec3::Z), 0.0, 0.0),
        _ => view.heading(up),
    };
    let axes = EnvironmentAxes::of_view(forward, up, settings.rotation);
    let scale = settings.intensity * settings.color;
    let sun = |direction: Vec3, half_angle: f64, irradiance: Vec3| Light {
        kind: scene::LightKind::Sun { to_light: axes.to_world(direction), half_angle },
        radiance: irradiance * scale,
        casts_shadow: true,
        is_visible: settings.visible,
        group: group_index(manifest, settings.group.as_ref()),
    };
    let of = |make: &dyn Fn() -> KeptEnvironment| kept(inputs, axes, make);
    let (environment, suns) = match settings.kind {
        EnvironmentKind::Studio => (of(&|| without_sun(studio(axes, scale))).0, Vec::new()),
        EnvironmentKind::Constant => (Environment::constant(scale), Vec::new()),
        EnvironmentKind::Sky => {
            let direction = sky_direction(settings.sun.elevation, settings.sun.azimuth);
            let (turbidity, albedo) = (settings.turbidity, settings.albedo);
            let (environment, irradiance) = of(&|| {
                let sky = ClearSky::new(&SkySettings { sun: direction, turbidity, albedo });
                KeptEnvironment { environment: sky.environment(axes, scale), sun: sky.sun() }
            });
            let half_angle = (0.5 * settings.sun.size).to_radians();
            // Below the horizon it is no light
            let is_up = irradiance != Vec3::ZERO;
            let light = is_up.then(|| sun(direction, half_angle, irradiance));
            (environment, light.into_iter().collect())
        }
        EnvironmentKind::Image => {
            let map = inputs.environment.ok_or_else(|| ResolveError::Unsupported {
                key: "environment.image",
                what: "the image has not been read".to_owned(),
            })?;
            let image = || without_sun(Environment::from_map(axes, &map.reduced, scale));
            let of_map = |own: &MapSun| sun(own.direction, own.half_angle, own.irradiance);
            let suns = map.suns.iter().map(of_map).collect();
            (of(&image).0.with_detail(map.detail.clone(), scale), suns)
        }
    };
    Ok(Surroundings { environment: Some(Arc::new(environment)), suns })
}

/// The environment around some `axes`, and the irradiance of its sun. It costs more than all the rest of a setup, and only
/// its axes depend on the view; so it is kept if `inputs` have a place for it.
fn kept(
    inputs: &SceneInputs<'_>,
    axes: EnvironmentAxes,
    make: &dyn Fn() -> KeptEnvironment,
) -> (Environment, Vec3) {
    match inputs.kept {
        Some(known) => {
            let KeptEnvironment { environment, sun } = known.get_or_init(make);
            (environment.clone().with_axes(axes), *sun)
        }
        None => {
            let KeptEnvironment { environment, sun } = make();
            (environment, sun)
        }
    }
}

/// An environment that is no sky.
const fn without_sun(environment: Environment) -> KeptEnvironment {
    KeptEnvironment { environment, sun: Vec3::ZERO }
}

#[cfg(test)]
mod tests {
    use std::sync::OnceLock;

    use super::*;

    /// A sky of 1024x512 pixels with a sun above the middle.
    fn map() -> RadianceMap {
        let mut pixels = vec![Vec3::splat(0.5); 1024 * 512];
        pixels[128 * 1024 + 512] = Vec3::splat(4e5);
        RadianceMap::new(1024, 512, pixels).expect("a map")
    }

    #[test]
    fn environments_that_are_kept_are_those_that_are_made() {
        let mut manifest = Manifest::new("data");
        for kind in [EnvironmentKind::Studio, EnvironmentKind::Constant, EnvironmentKind::Sky] {
            manifest.environment.kind = kind;
            let known = OnceLock::new();
            let kept = SceneInputs { kept: Some(&known), ..SceneInputs::default() };
            for eye in [DVec3::NEG_Y, DVec3::new(3.0, 1.0, 2.0)] {
                let view = CameraView { eye, look_at: DVec3::ZERO, up: DVec3::Z, fov: 30.0 };
                let of = |inputs: &SceneInputs<'_>| {
                    let found = surroundings(&manifest, inputs, &view, DVec3::Z);
                    found.expect("light").environment.expect("one")
                };
                assert_eq!(of(&kept), of(&SceneInputs::default()), "{kind:?} {eye}");
            }
        }
    }

    #[test]
    fn suns_of_images_are_lights() {
        let mut manifest = Manifest::new("data");
        manifest.environment.kind = EnvironmentKind::Image;
        manifest.environment.intensity = 2.0;
        let view = CameraView { eye: DVec3::NEG_Y, look_at: DVec3::ZERO, up: DVec3::Z, fov: 30.0 };
        let of = |manifest: &Manifest| {
            let image = EnvironmentMap::new(manifest, map());
            let inputs = SceneInputs { environment: Some(&image), ..SceneInputs::default() };
            let found = surroundings(manifest, &inputs, &view, DVec3::Z).expect("light");
            (found.suns, image.notes(Path::new("a.exr")), found.environment.expect("one"))
        };
        let (lights, notes, sky) = of(&manifest);
        let [Light { kind: scene::LightKind::Sun { to_light, .. }, radiance, .. }] = &lights[..]
        else {
            panic!("{lights:?}");
        };
        // The middle of the image is where a camera with azimuth 0 looks
        assert!(to_light.y > 0.7 && to_light.z > 0.7, "{to_light}");
        assert!(notes.iter().any(|note| note.starts_with("a.exr: the sun in it is a light: elev")));
        // Light and sky have the factor
        assert!(sky.detail().is_some());
        let up = sky.irradiance(Vec3::Z).x / std::f32::consts::PI;
        assert!((up - 1.0).abs() < 1e-3, "{up}");
        assert!(radiance.x > 2.0, "{radiance}");
        // Without extraction it stays in the image
        manifest.environment.extract_sun = ExtractSun::Off;
        manifest.environment.detail = false;
        let (lights, notes, sky) = of(&manifest);
        assert!(lights.is_empty() && notes.is_empty() && sky.detail().is_none());
        assert!(sky.irradiance(*to_light).x > 2.0 * up);
    }
}
