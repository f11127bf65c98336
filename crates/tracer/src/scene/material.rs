//! Materials: the constants of eq. 4.1 to 4.3, the surface for path tracing, and the optics that depend only on them:
//! Fresnel reflectance and refraction by Snell's law.
//!
//! Schlick, "An inexpensive BRDF model for physically-based rendering", 1994. As in eq. 4.3 the cosine is that of the
//! incoming ray, on its side of the surface.

use glam::Vec3;
use thiserror::Error;

use super::ground;

/// What has a material.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Owner {
    /// The particles without a style.
    Particles,
    /// Particles that are drawn in a style of their own, with its number.
    Style(u16),
    /// The same, if nothing but their material differs: parts of the particles, with the number of their material.
    Part(u16),
    /// Foam and spray.
    Spray,
    /// The ground.
    Ground,
    /// A mesh or rods; the number counts such things.
    Thing(u16),
}

impl Owner {
    /// Whether surfaces of the material belong to particles, which have attributes.
    pub const fn is_of_particles(self) -> bool {
        self.has_styles() || matches!(self, Self::Spray)
    }

    /// Whether the style of a particle says which material its surface has.
    pub(crate) const fn has_styles(self) -> bool {
        matches!(self, Self::Particles | Self::Style(_) | Self::Part(_))
    }
}

/// Default base colour of particles (linear RGB): a clear blue, as readers expect of a fluid; highlights and
/// reflections at silhouettes reduce the saturation, so it is higher than desired.
pub const DEFAULT_COLOR: Vec3 = Vec3::new(0.12, 0.38, 0.78);

/// A material. The base colour multiplies ambient and diffuse light; highlights have the colour of the light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// What has the material.
    pub owner: Owner,
    /// Base colour, or transmittance of a pane, linear RGB; None if each particle has its own, and for the ground, which
    /// has a pattern.
    pub color: Option<Vec3>,
    /// Whether it hides what is behind it from the camera without being visible itself.
    pub is_holdout: bool,
    /// Whether only camera rays that hit nothing but the ground see it, behind everything else; for panes.
    pub is_underlay: bool,
    /// `Ka`.
    pub ambient: f32,
    /// `kd`, not negative.
    pub diffuse: f32,
    /// `ks`, not negative.
    pub specular: f32,
    /// Exponent of the highlight, not negative.
    pub shininess: f32,
    /// Relative index of refraction, inside over outside, above 0.
    pub ior: f32,
    /// Weight of the reflected ray, 0 to 1.
    pub reflection: f32,
    /// Weight of the refracted ray, 0 to 1; 0 is opaque.
    pub transmission: f32,
    /// The formula for `r` of eq. 4.1.
    pub fresnel: Fresnel,
    /// Extinction coefficient of the medium inside, per length: absorption and scattering attenuate light by
    /// `exp(-extinction * length)` (Beer-Lambert law). Not less than `scattering`. Shadows of separate spheres ignore it
    /// unless they scatter light.
    pub extinction: Vec3,
    /// Length over which the medium inside gives white light the colour of the particles there, in addition to
    /// `extinction`, which then has no absorption; above 0. Shadows of separate spheres ignore it unless they scatter
    /// light.
    pub color_length: Option<f32>,
    /// Scattering coefficient of the medium inside, per length, not negative: the part of `extinction` that scatters light
    /// to other directions in path tracing. In Whitted's model it is lost.
    pub scattering: Vec3,
    /// Mean cosine of the angle by which the medium inside deflects light (the parameter `g` of Henyey and Greenstein):
    /// 0 scatters to all sides alike, above 0 forwards. From -[`MAX_ANISOTROPY`] to [`MAX_ANISOTROPY`].
    pub anisotropy: f32,
    /// How the surface meets light.
    pub finish: Finish,
    /// Roughness of the surface of transmissive particles for path tracing, 0 (smooth) to 1.
    pub interface_roughness: f32,
    /// Where connected transmissive bodies overlap, the one with the highest priority fills the space, and of several the
    /// one whose material comes first.
    pub priority: u8,
}

/// How a surface meets light. Whitted's model knows only panes; for it, all other surfaces are matte with the constants
/// of eq. 4.1.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Finish {
    /// Light leaves in all directions alike.
    #[default]
    Matte,
    /// A matte base under a clear coat.
    Plastic {
        /// Roughness of the coat, 0 to 1.
        roughness: f32,
    },
    /// A mirror in the base colour.
    Metal {
        /// Roughness, 0 to 1.
        roughness: f32,
    },
    /// A thin pane of glass: the surface stands for both sides of a wall, so that light passes without refraction.
    Pane,
    /// Drops of spray that fade out and scatter light from their inside.
    Foam,
}

/// Largest anisotropy of media: beyond it, single directions have almost all light, and pictures are noise.
pub const MAX_ANISOTROPY: f32 = 0.95;

/// Index of refraction of panes.
const PANE_IOR: f32 = 1.5;

/// The part of the light that one side of a pane reflects, at the absolute `cosine` between ray and normal.
pub fn surface_reflectance(cosine: f32) -> f32 {
    dielectric(cosine, 1.0 / PANE_IOR)
}

/// The part of the light that a thin pane reflects, at the absolute `cosine` between ray and normal. Light that both
/// of its sides reflect any number of times is included.
pub fn pane_reflectance(cosine: f32) -> f32 {
    let once = surface_reflectance(cosine);
    2.0 * once / (1.0 + once)
}

/// Formulas for the Fresnel reflectance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Fresnel {
    /// Schlick's approximation with the cosine of the incoming ray (eq. 4.3). From inside it reflects too little: it
    /// does not approach 1 at the critical angle.
    #[default]
    Schlick,
    /// Fresnel's equations for unpolarised light.
    Exact,
}

impl Material {
    /// Default constants: the index of refraction of water, opaque, a soft highlight. A white particle under the
    /// default lights is just below white.
    pub const DEFAULT: Self = Self {
        owner: Owner::Particles,
        color: None,
        is_holdout: false,
        is_underlay: false,
        ambient: 0.1,
        diffuse: 0.7,
        specular: 0.2,
        shininess: 32.0,
        ior: 1.33,
        reflection: 1.0,
        transmission: 0.0,
        fresnel: Fresnel::Schlick,
        extinction: Vec3::ZERO,
        color_length: None,
        scattering: Vec3::ZERO,
        anisotropy: 0.0,
        finish: Finish::Matte,
        interface_roughness: 0.0,
        priority: 0,
    };

    /// A matte surface of this colour: of meshes, rods and spray.
    pub const fn matte(color: Vec3) -> Self {
        Self { color: Some(color), ..MATTE }
    }

    /// Whether light passes it as a thin pane.
    pub fn is_pane(&self) -> bool {
        self.finish == Finish::Pane
    }

    /// Whether two rays leave a surface: reflected and refracted.
    pub fn branches(&self) -> bool {
        self.reflection > 0.0 && self.transmission > 0.0
    }

    /// Checks the ranges of all constants. With reflection and transmission in 0 to 1, the weight of the rays that
    /// leave a surface never exceeds that of the incoming ray.
    ///
    /// # Errors
    /// Names the first constant that is out of range.
    pub fn validate(&self) -> Result<(), MaterialError> {
        let weights = [
            ("ambient", self.ambient, f32::MAX),
            ("diffuse", self.diffuse, f32::MAX),
            ("specular", self.specular, f32::MAX),
            ("shininess", self.shininess, f32::MAX),
            ("reflection", self.reflection, 1.0),
            ("transmission", self.transmission, 1.0),
            ("interface_roughness", self.interface_roughness, 1.0),
        ];
        // Check the numbers, whose ranges do not contain NaN
        for (name, value, max) in weights {
            if !(0.0..=max).contains(&value) {
                return Err(MaterialError { name, value });
            }
        }
        let extinction = self.extinction.to_array();
        if let Some(value) = extinction.iter().find(|v| !(0.0..=f32::MAX).contains(*v)) {
            return Err(MaterialError { name: "extinction", value: *value });
        }
        // What is scattered is a part of the extinction
        for (value, max) in self.scattering.to_array().into_iter().zip(extinction) {
            if !(0.0..=max).contains(&value) {
                return Err(MaterialError { name: "scattering", value });
            }
        }
        if !(-MAX_ANISOTROPY..=MAX_ANISOTROPY).contains(&self.anisotropy) {
            return Err(MaterialError { name: "anisotropy", value: self.anisotropy });
        }
        if let Some(value) = self.color_length.filter(|length| !(0.0..=f32::MAX).contains(length)) {
            return Err(MaterialError { name: "color_length", value });
        }
        if self.ior > 0.0 && self.ior.is_finite() {
            Ok(())
        } else {
            Err(MaterialError { name: "ior", value: self.ior })
        }
    }

    /// The same with a medium inside that scatters light of a `color` (linear RGB) with a mean free path of `length` where
    /// that is 1, in addition to its absorption.
    #[must_use]
    pub fn with_scattering(self, color: Vec3, length: f32, anisotropy: f32) -> Self {
        let scattering = (color / length).clamp(Vec3::ZERO, Vec3::MAX);
        let extinction = (self.extinction + scattering).min(Vec3::MAX);
        Self { extinction, scattering, anisotropy, ..self }
    }

    /// Whether the medium inside attenuates light.
    pub fn absorbs(&self) -> bool {
        self.color_length.is_some() || self.extinction != Vec3::ZERO
    }

    /// Whether the medium inside scatters light.
    pub fn scatters(&self) -> bool {
        self.transmission > 0.0 && self.scattering != Vec3::ZERO
    }

    /// `R0` of eq. 4.3, which is the same for both sides.
    pub fn r0(&self) -> f32 {
        let root = (1.0 - self.ior) / (1.0 + self.ior);
        root * root
    }
}

/// A matte surface without a colour: of the ground.
pub(super) const MATTE: Material = Material {
    owner: Owner::Ground,
    ambient: ground::AMBIENT,
    diffuse: ground::DIFFUSE,
    specular: 0.0,
    reflection: 0.0,
    ..Material::DEFAULT
};

/// The extinction coefficient of a medium that attenuates white light to `color` over `length`. Black is treated as
/// one millionth.
pub fn extinction(color: Vec3, length: f32) -> Vec3 {
    let loss = |part: f32| (-libm::logf(part.clamp(1e-6, 1.0)) / length).clamp(0.0, f32::MAX);
    Vec3::from_array(color.to_array().map(loss))
}

impl Default for Material {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// A constant out of range.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error("material {name} = {value} is out of range")]
pub struct MaterialError {
    /// Name of the constant.
    pub name: &'static str,
    /// Its value.
    pub value: f32,
}

/// Fresnel reflectance by Schlick's approximation (eq. 4.3), from `r0` and the absolute cosine between normal and ray.
#[inline(always)]
pub fn schlick(r0: f32, cosine: f32) -> f32 {
    let x = (1.0 - cosine).clamp(0.0, 1.0);
    let x2 = x * x;
    r0 + (1.0 - r0) * (x2 * x2 * x)
}

/// Fresnel reflectance of a dielectric, averaged over both polarisations, from the absolute cosine between normal and
/// ray and the `ratio` of the indices of refraction: on the side of the ray over that on the other side. 1 under
/// total internal reflection.
#[inline(always)]
pub fn dielectric(cosine: f32, ratio: f32) -> f32 {
    // Free of branches, for loops over lanes.
    let cos_in = cosine.clamp(0.0, 1.0);
    let sin2_out = ratio * ratio * (1.0 - cos_in * cos_in);
    let is_total = sin2_out >= 1.0;
    let cos_out = (1.0 - if is_total { 1.0 } else { sin2_out }).sqrt();
    let r_s = (ratio * cos_in - cos_out) / (ratio * cos_in + cos_out);
    let r_p = (cos_in - ratio * cos_out) / (cos_in + ratio * cos_out);
    let mean = 0.5 * (r_s * r_s + r_p * r_p);
    if is_total { 1.0 } else { mean }
}

/// Direction of the refracted ray by Snell's law; `None` under total internal reflection.
///
/// `normal` is the unit normal on the side of the unit vector `direction`, and `ratio` the index of refraction on
/// that side over that on the other side.
pub fn refract(direction: Vec3, normal: Vec3, ratio: f32) -> Option<Vec3> {
    let cos_in = -direction.dot(normal);
    let sin2_out = ratio * ratio * (1.0 - cos_in * cos_in).max(0.0);
    if sin2_out >= 1.0 {
        return None;
    }
    let along_normal = ratio * cos_in - (1.0 - sin2_out).sqrt();
    // Normalised, so that errors do not accumulate along a path.
    Some((ratio * direction + along_normal * normal).normalize())
}

/// Reflects the unit vector `direction` at a surface with unit `normal` (of either sign).
pub fn reflect(direction: Vec3, normal: Vec3) -> Vec3 {
    (direction - 2.0 * direction.dot(normal) * normal).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with_ior(ior: f32) -> Material {
        Material { ior, ..Material::DEFAULT }
    }

    #[test]
    fn schlick_at_known_angles() {
        // By hand: R0 = (0.33/2.33)^2 = 0.0200593, (0.5/2.5)^2 = 0.04.
        // (1-cos)^5: 45 deg 0.2928932^5 = 0.00215548, 60 deg 1/32, 80 deg 0.8263518^5 = 0.385316.
        for (ior, degrees, expected) in [
            (1.33, 0.0_f32, 0.020_059_3),
            (1.33, 45.0, 0.022_171_5),
            (1.33, 60.0, 0.050_682_4),
            (1.33, 80.0, 0.397_653),
            (1.5, 0.0, 0.04),
            (1.5, 45.0, 0.042_069_3),
            (1.5, 60.0, 0.07),
            (1.5, 80.0, 0.409_910),
        ] {
            let r = schlick(with_ior(ior).r0(), degrees.to_radians().cos());
            assert!((r - expected).abs() < 2e-6, "{ior} {degrees}: {r} {expected}");
        }
        assert!((schlick(0.04, 0.0) - 1.0).abs() < 1e-6);
        assert_eq!(schlick(0.04, 1.000_001), 0.04);
    }

    #[test]
    fn fresnel_at_known_angles() {
        // By hand for 1.5: 0.04 at normal incidence from both sides; at Brewster's angle (tan a = 1.5) the
        // p-polarised part is 0 and the s-polarised one ((1 - 1.5^2) / (1 + 1.5^2))^2 = 0.147929, the mean half of
        // that. 60 degrees: cos_out = 0.816497, s (0.5 - 1.224745) / 1.724745 = -0.420204, p (0.75 -
        // 0.816497) / 1.566497 = -0.042449.
        let brewster = 1.5_f32.atan().cos();
        for (cosine, ratio, expected) in [
            (1.0, 1.0 / 1.5, 0.04),
            (1.0, 1.5, 0.04),
            (brewster, 1.0 / 1.5, 0.073_964_5),
            (0.5, 1.0 / 1.5, 0.089_186_7),
            (0.0, 1.0 / 1.5, 1.0),
            (0.7, 1.5, 1.0),
            (0.3, 1.0, 0.0),
        ] {
            let r = dielectric(cosine, ratio);
            assert!((r - expected).abs() < 2e-6, "{cosine} {ratio}: {r} {expected}");
        }
        // The same on the same path in reverse.
        let inside = (1.0 - 0.75_f32 / 2.25).sqrt();
        assert!((dielectric(inside, 1.5) - dielectric(0.5, 1.0 / 1.5)).abs() < 1e-6);
    }

    #[test]
    fn absorption_is_the_colour_after_its_length() {
        let loss = extinction(Vec3::new(0.5, 1.0, 0.0), 2.0);
        let left = (-3.0 * loss).exp();
        assert!((left.x - 0.5_f32.powf(1.5)).abs() < 1e-6);
        assert_eq!(left.y, 1.0);
        assert!(left.z < 1e-6 && loss.z.is_finite());
        assert!(extinction(Vec3::ZERO, f32::from_bits(1)).is_finite());
    }

    #[test]
    fn snell_and_total_reflection() {
        let down = |degrees: f32| {
            let a = degrees.to_radians();
            Vec3::new(a.sin(), 0.0, -a.cos())
        };
        // sin 30 / 1.5 = 1/3.
        let t = refract(down(30.0), Vec3::Z, 1.0 / 1.5).unwrap();
        assert!((t.x - 1.0 / 3.0).abs() < 1e-6 && t.z < 0.0);
        // The path in reverse.
        let back = refract(-t, Vec3::NEG_Z, 1.5).unwrap();
        assert!((back + down(30.0)).length() < 1e-6);
        // Critical angle of 1.5 is 41.81 degrees.
        assert!(refract(down(41.7), Vec3::Z, 1.5).is_some());
        assert_eq!(refract(down(41.9), Vec3::Z, 1.5), None);
        let mirrored = reflect(down(41.9), Vec3::Z);
        assert!((mirrored.z - 41.9_f32.to_radians().cos()).abs() < 1e-6);
    }

    #[test]
    fn panes_reflect_at_both_sides() {
        // By hand: 0.04 + 0.96^2 * 0.04 * (1 + 0.04^2 + 0.04^4 + ...) = 0.08 / 1.04
        assert!((pane_reflectance(1.0) - 0.08 / 1.04).abs() < 1e-6);
        assert!((pane_reflectance(0.0) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn bad_constants_are_named() {
        assert_eq!(Material::DEFAULT.validate(), Ok(()));
        let shiny = Material { reflection: 1.5, ..Material::DEFAULT };
        assert_eq!(
            shiny.validate().unwrap_err().to_string(),
            "material reflection = 1.5 is out of range"
        );
        assert_eq!(with_ior(0.0).validate().unwrap_err().name, "ior");
        assert_eq!(with_ior(f32::NAN).validate().unwrap_err().name, "ior");
        let dark = Material { diffuse: -0.1, ..Material::DEFAULT };
        assert_eq!(dark.validate().unwrap_err().name, "diffuse");
        let murky = |scattering: f32, anisotropy: f32| {
            let scattering = Vec3::new(0.5, scattering, 0.5);
            Material { extinction: Vec3::ONE, scattering, anisotropy, ..Material::DEFAULT }
        };
        assert_eq!(murky(1.0, 0.95).validate(), Ok(()));
        for scattering in [-0.1, 1.5, f32::NAN, f32::INFINITY] {
            assert_eq!(murky(scattering, 0.0).validate().unwrap_err().name, "scattering");
        }
        for anisotropy in [-0.96, 1.0, f32::NAN] {
            assert_eq!(murky(1.0, anisotropy).validate().unwrap_err().name, "anisotropy");
        }
    }
}
