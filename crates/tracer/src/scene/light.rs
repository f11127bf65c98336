//! Light sources: without extent (point, directional), and with an extent, for path tracing (sun, sphere, rectangle,
//! disc).

use glam::{DVec3, Vec3};

use super::{Bounds, CameraView};

/// Colour of the default key light (linear RGB): daylight, slightly warm.
pub const KEY_COLOR: Vec3 = Vec3::new(1.0, 0.965, 0.91);

/// Intensity of the default key light: bright enough for the dark ends of colour maps, tuned by eye on the dam break.
/// The view transform of the preview compresses highlights that become too bright.
pub const KEY_INTENSITY: f32 = 1.9;

/// Colour of the default fill light: cool against the warm key.
pub const FILL_COLOR: Vec3 = Vec3::new(0.72, 0.84, 1.0);

/// Intensity of the default fill light: a fifth of the key light brightens shadows without flattening them.
pub const FILL_INTENSITY: f32 = 0.4;

/// Dependence of a point light on distance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Falloff {
    /// Constant, as in the thesis.
    #[default]
    None,
    /// `intensity / distance²`.
    InverseSquare,
}

/// Kinds of lights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightKind {
    /// A point light.
    Point {
        /// Position relative to the origin of the sequence.
        position: Vec3,
        /// Dependence on distance.
        falloff: Falloff,
    },
    /// A light at infinite distance.
    Directional {
        /// Unit vector from the scene to the light.
        to_light: Vec3,
    },
    /// A light at infinite distance with an angular size.
    Sun {
        /// Unit vector from the scene to the centre of the light.
        to_light: Vec3,
        /// Half the apparent diameter, radians.
        half_angle: f64,
    },
    /// A sphere.
    Sphere {
        /// Its centre, relative to the origin of the sequence.
        center: Vec3,
        /// Its radius.
        radius: f32,
    },
    /// A rectangle that shines to one side.
    Rectangle {
        /// Its centre, relative to the origin of the sequence.
        center: Vec3,
        /// Unit vectors along its width and height, and in the direction that it shines.
        axes: [Vec3; 3],
        /// Half its width and half its height.
        half: [f32; 2],
    },
    /// A disc that shines to one side.
    Disc {
        /// Its centre, relative to the origin of the sequence.
        center: Vec3,
        /// Unit vector in the direction that it shines.
        normal: Vec3,
        /// Its radius.
        radius: f32,
    },
}

impl LightKind {
    /// Whether the light has an extent, so that only path tracing can use it.
    pub const fn has_extent(&self) -> bool {
        !matches!(self, Self::Point { .. } | Self::Directional { .. })
    }
}

/// A light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Light {
    /// The kind of light and its position or direction.
    pub kind: LightKind,
    /// Colour times intensity, linear RGB. In path tracing, that is radiant intensity (W/sr) for a point light with
    /// falloff, irradiance on a surface that faces it (W/m2) for a point light without falloff, a directional light and
    /// a sun, and radiance (W/m2/sr) for all others.
    pub radiance: Vec3,
    /// Whether other objects occlude it. A light without shadows needs no shadow rays.
    pub casts_shadow: bool,
    /// Whether the camera sees a light with an extent.
    pub is_visible: bool,
    /// Index of its light group; 0 is that of light without a group.
    pub group: u8,
}

impl Light {
    /// A point light without falloff at a world `position`.
    pub fn point(position: DVec3, origin: DVec3, radiance: Vec3) -> Self {
        Self::point_with(position, origin, radiance, Falloff::None)
    }

    /// A point light at a world `position`.
    pub fn point_with(position: DVec3, origin: DVec3, radiance: Vec3, falloff: Falloff) -> Self {
        Self {
            kind: LightKind::Point { position: (position - origin).as_vec3(), falloff },
            radiance,
            casts_shadow: true,
            is_visible: false,
            group: 0,
        }
    }

    /// Light that travels along `direction` (of any length); `None` for a zero vector.
    pub fn directional(direction: Vec3, radiance: Vec3) -> Option<Self> {
        Some(Self {
            kind: LightKind::Directional { to_light: -direction.try_normalize()? },
            radiance,
            casts_shadow: true,
            is_visible: false,
            group: 0,
        })
    }
}

/// A key light from above the left shoulder of the camera, with shadows, and a soft fill light from the right,
/// without shadows. Both are directional, so they suit a scene of any size. They do not move with the camera: pass
/// the first view of its path.
pub fn default_lights(bounds: &Bounds, up: DVec3, view: &CameraView) -> Vec<Light> {
    // Find the horizontal axes of the view
    let up = up.try_normalize().unwrap_or(DVec3::Z);
    let is_steep = view.heading(up) == view.up;
    let to_eye = if is_steep { -view.up } else { view.eye - bounds.center() };
    let level = to_eye - to_eye.dot(up) * up;
    // For a view from straight above, any direction will do.
    let back = level.try_normalize().unwrap_or_else(|| up.any_orthonormal_vector());
    let right = up.cross(back);
    // Place both lights relative to these axes
    let light = |right_part: f64, up_part: f64, back_part: f64, radiance| {
        let to_light = (right_part * right + up_part * up + back_part * back).normalize();
        LightKind::Directional { to_light: to_light.as_vec3() }.with(radiance)
    };
    let key = light(-0.7, 1.0, 0.45, KEY_INTENSITY * KEY_COLOR);
    let fill = light(0.9, 0.25, 0.6, FILL_INTENSITY * FILL_COLOR);
    vec![key, Light { casts_shadow: false, ..fill }]
}

impl LightKind {
    /// A shadow-casting light of this kind.
    const fn with(self, radiance: Vec3) -> Light {
        Light { kind: self, radiance, casts_shadow: true, is_visible: false, group: 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn to_light(light: &Light) -> Vec3 {
        match light.kind {
            LightKind::Directional { to_light } => to_light,
            _ => panic!("not a directional light"),
        }
    }

    #[test]
    fn directional_light_travels_along_its_direction() {
        let light = Light::directional(Vec3::new(0.0, 0.0, -3.0), Vec3::ONE).unwrap();
        assert_eq!(to_light(&light), Vec3::Z);
        assert_eq!(Light::directional(Vec3::ZERO, Vec3::ONE), None);
    }

    #[test]
    fn default_lights_come_from_above_and_from_the_viewer() {
        let bounds = Bounds { min: DVec3::ZERO, max: DVec3::ONE };
        for (up, eye) in
            [(DVec3::Z, DVec3::new(0.5, -9.0, 3.0)), (DVec3::Y, DVec3::new(0.5, 9.0, 0.5))]
        {
            let view = CameraView { eye, look_at: bounds.center(), up, fov: 30.0 };
            let lights = default_lights(&bounds, up, &view);
            assert_eq!(lights.len(), 2);
            for light in lights {
                let to_light = to_light(&light);
                assert!(to_light.dot(up.as_vec3()) > 0.1);
                assert!(to_light.dot((eye - bounds.center()).as_vec3()) > 0.0);
            }
        }
    }
}
