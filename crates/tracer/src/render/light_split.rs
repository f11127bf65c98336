//! Light of one packet by its first interaction: what camera rays see is divided into classes, and direct light into
//! what arrives and what is in shadow.

#![expect(clippy::needless_range_loop, reason = "one index for the lanes of many arrays")]

use glam::Vec3;

use super::channels::Channels;
use super::dimensions::{BOUNCED, REFLECTED, REFRACTED, SCATTERED};
use super::layers::LightClass;
use super::planes::FilmPlane;
use crate::scene::environment::LUMINANCE;
use spherule_tree::math::{LANES, Lanes, Lanes3, lane3, lanes_in, set_lane3, splat};

/// The light of a packet of camera rays. Inactive for all other rays, and if the film has no channels for it.
#[derive(Default)]
pub(super) struct LightSplit {
    /// Whether light is divided into classes.
    pub(super) is_active: bool,
    /// Whether shadows are measured.
    pub(super) has_shadow: bool,
    /// Radiance of each class.
    pub(super) lights: [Lanes3; LightClass::COUNT],
    /// Radiance of all classes so far.
    sum: Lanes3,
    /// The diffuse part of the reflection of a direction, 0 to 1: of the last light sample, and at the end of the path.
    pub(super) diffuse: Lanes3,
    /// Luminance of direct light: if nothing is in the way, and what arrives.
    pub(super) direct: [Lanes; 2],
    /// Light of a camera ray and of the rays of the second depth after one interaction at most.
    pub(super) direct_radiance: Lanes3,
    /// Whether the rays are those of the second depth, and light is divided into classes.
    is_second_depth: bool,
    /// The light that a shadow catcher lacks, if that is measured.
    pub(super) shadow_loss: Option<Lanes3>,
}

impl LightSplit {
    /// Prepares for a packet at `depth`.
    pub(super) fn start(&mut self, channels: &Channels, depth: u32) {
        self.is_active = depth == 1 && channels.needs_light_classes();
        self.has_shadow = depth == 1 && channels.has(FilmPlane::Shadow);
        self.is_second_depth = depth == 2 && channels.needs_light_classes();
        self.direct_radiance = [splat(0.0); 3];
        let has_shadow_loss = depth == 1 && channels.has(FilmPlane::ShadowCatcher);
        self.shadow_loss = has_shadow_loss.then_some([splat(0.0); 3]);
        if self.is_active {
            self.lights = [[splat(0.0); 3]; LightClass::COUNT];
            self.sum = [splat(0.0); 3];
            self.diffuse = [splat(1.0); 3];
        }
        if self.has_shadow {
            self.direct = [splat(0.0); 2];
        }
    }

    /// Counts what was added to `radiance` since the last call as light of `class`.
    pub(super) fn take(&mut self, class: LightClass, radiance: &Lanes3) {
        if self.is_second_depth && class == LightClass::Background {
            // Rays of the second depth that leave the scene have one interaction behind them
            self.direct_radiance = *radiance;
        }
        if !self.is_active {
            return;
        }
        let light = &mut self.lights[class as usize];
        for axis in 0..3 {
            for lane in 0..LANES {
                light[axis][lane] += radiance[axis][lane] - self.sum[axis][lane];
            }
        }
        self.sum = *radiance;
    }

    /// Counts what a camera ray has found as light after one interaction at most, without that of photons.
    pub(super) fn add_direct_radiance(&mut self, radiance: &Lanes3) {
        for (direct_radiance, radiance) in self.direct_radiance.iter_mut().zip(radiance) {
            for (direct_radiance, radiance) in direct_radiance.iter_mut().zip(radiance) {
                *direct_radiance += radiance;
            }
        }
    }

    /// Counts `light`, which photons have brought to what a camera ray meets, as light after several interactions.
    pub(super) fn remove_photon_light(&mut self, lane: usize, light: Vec3) {
        let direct_radiance = lane3(&self.direct_radiance, lane) - light;
        set_lane3(&mut self.direct_radiance, lane, direct_radiance);
    }

    /// Divides what was added to `radiance` since the last call between diffuse and specular light, by
    /// [`Self::diffuse`].
    pub(super) fn take_reflected(&mut self, radiance: &Lanes3) {
        if !self.is_active {
            return;
        }
        for axis in 0..3 {
            for lane in 0..LANES {
                let added = radiance[axis][lane] - self.sum[axis][lane];
                let diffuse = self.diffuse[axis][lane] * added;
                self.lights[LightClass::Diffuse as usize][axis][lane] += diffuse;
                self.lights[LightClass::Specular as usize][axis][lane] += added - diffuse;
            }
        }
        self.sum = *radiance;
    }

    /// Adds direct light: its radiance in `lanes` if nothing is in the way, and what arrives in the lanes `visible`.
    pub(super) fn add_direct(
        &mut self,
        lanes: u32,
        unoccluded: &Lanes3,
        visible: u32,
        arriving: &Lanes3,
    ) {
        if !self.has_shadow {
            return;
        }
        let [whole, arrived] = &mut self.direct;
        for lane in lanes_in(lanes) {
            whole[lane] += lane3(unoccluded, lane).dot(LUMINANCE);
        }
        for lane in lanes_in(lanes & visible) {
            arrived[lane] += lane3(arriving, lane).dot(LUMINANCE);
        }
    }

    /// Sets the direct light in `lane`: all of it, and what is lost.
    pub(super) fn set_lost(&mut self, lane: usize, whole: Vec3, lost: Vec3) {
        if self.has_shadow {
            self.direct[0][lane] = whole.dot(LUMINANCE);
            self.direct[1][lane] = (whole - lost).dot(LUMINANCE);
        }
    }
}

/// `part / whole` per component, 1 where nothing is divided.
pub(super) fn ratio(part: &Lanes3, whole: &Lanes3) -> Lanes3 {
    let component = |axis: usize, lane: usize| {
        if whole[axis][lane] > 0.0 { part[axis][lane] / whole[axis][lane] } else { 1.0 }
    };
    std::array::from_fn(|axis| std::array::from_fn(|lane| component(axis, lane)))
}

/// The part of the light along a path after its first interaction, by the continuation at that interaction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct FirstInteraction(u8);

impl FirstInteraction {
    /// The first interaction of a path whose ray is continuation `branch` of a ray with the first interaction `self`.
    pub(super) fn continued(self, branch: u32) -> Self {
        match (self.0, branch) {
            (0, REFLECTED) => Self(1),
            // A camera inside a body sees the light of its medium as that behind its surface
            (0, REFRACTED | SCATTERED) => Self(2),
            (0, BOUNCED) => Self(3),
            _ => self,
        }
    }

    /// The class of the light; None for reflection at an opaque surface, which has two, and for camera rays.
    pub(super) fn class(self) -> Option<LightClass> {
        match self.0 {
            1 => Some(LightClass::Reflection),
            2 => Some(LightClass::Refraction),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use spherule_tree::math::splat3;

    #[test]
    fn light_is_divided_without_loss() {
        let mut split = LightSplit::default();
        let channels = Channels::from_names(["lights"]).unwrap();
        split.start(&channels, 1);
        split.take(LightClass::Background, &splat3(Vec3::new(1.0, 2.0, 3.0)));
        split.diffuse = splat3(Vec3::new(1.0, 0.5, 0.0));
        split.take_reflected(&splat3(Vec3::new(2.0, 4.0, 6.0)));
        let of = |class: LightClass| lane3(&split.lights[class as usize], 5);
        assert_eq!(of(LightClass::Background), Vec3::new(1.0, 2.0, 3.0));
        assert_eq!(of(LightClass::Diffuse), Vec3::new(1.0, 1.0, 0.0));
        assert_eq!(of(LightClass::Specular), Vec3::new(0.0, 1.0, 3.0));
        // Later rays keep the class of the first interaction
        split.start(&channels, 2);
        assert!(!split.is_active);
    }

    #[test]
    fn the_first_interaction_counts() {
        let first = FirstInteraction::default().continued(REFRACTED);
        assert_eq!(first.class(), Some(LightClass::Refraction));
        assert_eq!(first.continued(REFLECTED).continued(BOUNCED), first);
        let first = FirstInteraction::default().continued(BOUNCED);
        assert_eq!(first.continued(REFLECTED).class(), None);
    }
}
