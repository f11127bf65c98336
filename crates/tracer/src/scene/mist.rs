//! Mist above the ground: air that scatters light, whose density falls exponentially with the height, as that of an
//! atmosphere in equilibrium does. There is none below its base.

use glam::Vec3;

use super::material::{MAX_ANISOTROPY, MaterialError};

/// The optical depth of the distance at which the contrast of a dark object with the horizon has fallen to 0.02, the least
/// that an observer sees: `-ln 0.02`, by Koschmieder, "Theorie der horizontalen Sichtweite", 1924.
pub const VISIBILITY_DEPTH: f32 = 3.912;

/// Default of [`Mist::anisotropy`]: that of the haze in continental air at a humidity of 80 %. The droplets of fog have
/// 0.85 (Hess, Koepke and Schult, "Optical properties of aerosols and clouds: the software package OPAC", 1998).
pub const DEFAULT_ANISOTROPY: f32 = 0.7;

/// A layer of mist.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mist {
    /// Unit vector upwards.
    pub up: Vec3,
    /// Distance of the base from the scene's origin along `up`.
    pub base: f32,
    /// Height above the base at which the density is 1/e of that at the base.
    pub scale_height: f32,
    /// Extinction coefficient at the base, per length.
    pub extinction: f32,
    /// The part of the extinction that is scattered, linear RGB.
    pub albedo: Vec3,
    /// Mean cosine of the angle by which light is deflected.
    pub anisotropy: f32,
}

impl Mist {
    /// The extinction coefficient of mist in which one sees as far as `visibility`.
    pub fn extinction_for(visibility: f32) -> f32 {
        (VISIBILITY_DEPTH / visibility).min(f32::MAX)
    }

    /// Checks that all values are in their ranges.
    ///
    /// # Errors
    /// The first that is not.
    pub fn validate(&self) -> Result<(), MaterialError> {
        let is_positive = |value: f32| value > 0.0 && value <= f32::MAX;
        let check = |name, value: f32, is_valid: bool| {
            if is_valid { Ok(()) } else { Err(MaterialError { name, value }) }
        };
        check("mist up", self.up.length(), self.up.is_normalized())?;
        check("mist base", self.base, self.base.is_finite())?;
        check("mist scale height", self.scale_height, is_positive(self.scale_height))?;
        check("mist extinction", self.extinction, is_positive(self.extinction))?;
        for value in self.albedo.to_array() {
            check("mist albedo", value, (0.0..=1.0).contains(&value))?;
        }
        let cosines = -MAX_ANISOTROPY..=MAX_ANISOTROPY;
        check("mist anisotropy", self.anisotropy, cosines.contains(&self.anisotropy))
    }
}
