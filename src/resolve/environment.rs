//! The environment of the scene.

use std::path::Path;
use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::ResolveError;
use super::lights::group_index;
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

/// The environment of the path integrator, as it is placed by the first `view` of the camera.
pub(super) fn environment(
    manifest: &Manifest,
    map: Option<&EnvironmentMap>,
    view: &CameraView,
    up: DVec3,
) -> Result<Option<Arc<Environment>>, ResolveError> {
    if manifest.integrator() != IntegratorKind::Path {
        return Ok(None);
    }
    // Its directions are relative to the view
    let settings = &manifest.environment;
    let scale = settings.intensity * settings.color;
    let axes = |forward| EnvironmentAxes::of_view(forward, up, settings.rotation);
    // Make it; a studio and a sky turn with the camera, an image stays where it is
    let environment = match settings.kind {
        EnvironmentKind::Studio => studio(axes(view.heading(up)), scale),
        EnvironmentKind::Sky => clear_sky(manifest).environment(axes(view.heading(up)), scale),
        EnvironmentKind::Constant => Environment::constant(scale),
        EnvironmentKind::Image => {
            let map = map.ok_or_else(|| ResolveError::Unsupported {
                key: "environment.image",
                what: "the image has not been read".to_owned(),
            })?;
            let axes = image_axes(manifest, up);
            let image = Environment::from_map(axes, &map.reduced, scale);
            image.with_detail(map.detail.clone(), scale)
        }
    };
    Ok(Some(Arc::new(environment)))
}

/// The axes of an image: the middle is where a camera with azimuth 0 looks.
fn image_axes(manifest: &Manifest, up: DVec3) -> EnvironmentAxes {
    let forward = view_direction(up.normalize_or(DVec3::Z), 0.0, 0.0);
    EnvironmentAxes::of_view(forward, up, manifest.environment.rotation)
}

/// The sky of a manifest.
fn clear_sky(manifest: &Manifest) -> ClearSky {
    let settings = &manifest.environment;
    ClearSky::new(&SkySettings {
        sun: sky_direction(settings.sun.elevation, settings.sun.azimuth),
        turbidity: settings.turbidity,
        albedo: settings.albedo,
    })
}

/// The suns of the environment: that of a sky, or those of the image `map`.
pub(super) fn suns(
    manifest: &Manifest,
    map: Option<&EnvironmentMap>,
    view: &CameraView,
    up: DVec3,
) -> Vec<Light> {
    let settings = &manifest.environment;
    let light = |to_light: Vec3, half_angle: f64, irradiance: Vec3| Light {
        kind: scene::LightKind::Sun { to_light, half_angle },
        radiance: irradiance * settings.intensity * settings.color,
        casts_shadow: true,
        is_visible: settings.visible,
        group: group_index(manifest, settings.group.as_ref()),
    };
    match (manifest.integrator(), settings.kind, map) {
        (IntegratorKind::Path, EnvironmentKind::Sky, _) => {
            let axes = EnvironmentAxes::of_view(view.heading(up), up, settings.rotation);
            let sun = &settings.sun;
            let to_light = axes.to_world(sky_direction(sun.elevation, sun.azimuth));
            let half_angle = (0.5 * sun.size).to_radians();
            vec![light(to_light, half_angle, clear_sky(manifest).sun())]
        }
        (IntegratorKind::Path, EnvironmentKind::Image, Some(map)) => {
            let axes = image_axes(manifest, up);
            let of_map =
                |sun: &MapSun| light(axes.to_world(sun.direction), sun.half_angle, sun.irradiance);
            map.suns.iter().map(of_map).collect()
        }
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sky of 1024x512 pixels with a sun above the middle.
    fn map() -> RadianceMap {
        let mut pixels = vec![Vec3::splat(0.5); 1024 * 512];
        pixels[128 * 1024 + 512] = Vec3::splat(4e5);
        RadianceMap::new(1024, 512, pixels).expect("a map")
    }

    #[test]
    fn suns_of_images_are_lights() {
        let mut manifest = Manifest::new("data");
        manifest.environment.kind = EnvironmentKind::Image;
        manifest.environment.intensity = 2.0;
        let view = CameraView { eye: DVec3::NEG_Y, look_at: DVec3::ZERO, up: DVec3::Z, fov: 30.0 };
        let of = |manifest: &Manifest| {
            let image = EnvironmentMap::new(manifest, map());
            let lights = suns(manifest, Some(&image), &view, DVec3::Z);
            let environment = environment(manifest, Some(&image), &view, DVec3::Z);
            (lights, image.notes(Path::new("a.exr")), environment.expect("one").expect("one"))
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
        assert!(sky.has_detail());
        let up = sky.irradiance(Vec3::Z).x / std::f32::consts::PI;
        assert!((up - 1.0).abs() < 1e-3, "{up}");
        assert!(radiance.x > 2.0, "{radiance}");
        // Without extraction it stays in the image
        manifest.environment.extract_sun = ExtractSun::Off;
        manifest.environment.detail = false;
        let (lights, notes, sky) = of(&manifest);
        assert!(lights.is_empty() && notes.is_empty() && !sky.has_detail());
        assert!(sky.irradiance(*to_light).x > 2.0 * up);
    }
}
