//! The planes of a film for compositing: light by its first reflection, the colour before denoising, shadows, motion,
//! attributes of particles, and Cryptomatte. All of them are floats, interleaved by pixel in one array.

use std::ops::Range;

/// Maximum number of floats of attribute channels in a pixel.
pub const MAX_ATTRIBUTE_FLOATS: usize = 64;

/// Maximum number of light groups, with that of light without a group.
pub const MAX_LIGHT_GROUPS: usize = 64;

/// Classes of light by the first interaction of its path, seen from the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LightClass {
    /// Diffuse reflection at an opaque surface, and ambient light.
    Diffuse,
    /// Glossy reflection at an opaque surface: the coat of plastic, metal, highlights.
    Specular,
    /// Reflection at a mirroring or transmissive surface.
    Reflection,
    /// Refraction at a transmissive surface.
    Refraction,
    /// Lights that the camera sees directly.
    Emission,
    /// The background or the environment that the camera sees directly.
    Background,
}

impl LightClass {
    /// All classes, in the order of their planes.
    pub const ALL: [Self; 6] = [
        Self::Diffuse,
        Self::Specular,
        Self::Reflection,
        Self::Refraction,
        Self::Emission,
        Self::Background,
    ];
    /// Number of classes.
    pub const COUNT: usize = Self::ALL.len();

    /// Name of the channel.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Diffuse => "diffuse",
            Self::Specular => "specular",
            Self::Reflection => "reflection",
            Self::Refraction => "refraction",
            Self::Emission => "emission",
            Self::Background => "background",
        }
    }
}

/// A set of classes of light.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LightClasses(u8);

impl LightClasses {
    /// No class.
    pub const NONE: Self = Self(0);
    /// All classes.
    pub const ALL: Self = Self((1 << LightClass::COUNT) - 1);

    /// Whether it contains `class`.
    pub const fn contains(self, class: LightClass) -> bool {
        self.0 >> class as u8 & 1 == 1
    }

    /// Adds `class`.
    pub const fn insert(&mut self, class: LightClass) {
        self.0 |= 1 << class as u8;
    }

    /// Its classes, in order.
    pub fn iter(self) -> impl Iterator<Item = LightClass> {
        let all = LightClass::ALL.into_iter();
        all.filter(move |class| self.contains(*class))
    }

    /// Whether it has no class.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }
}

/// Ways to divide a picture into objects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MatteKind {
    /// Every particle is an object.
    Particle,
    /// All surfaces of a material are an object.
    Material,
    /// All particles with the same part are an object.
    Part,
}

impl MatteKind {
    /// All kinds, in the order of their planes.
    pub const ALL: [Self; 3] = [Self::Particle, Self::Material, Self::Part];

    /// Name of the layer, and of the channel in a manifest.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Particle => "crypto_particle",
            Self::Material => "crypto_material",
            Self::Part => "crypto_part",
        }
    }
}

/// Cryptomatte layers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Mattes {
    /// Whether each [`MatteKind`] has a layer.
    pub kinds: [bool; MatteKind::ALL.len()],
    /// Maximum number of objects in a pixel of each kind; even.
    pub levels: u8,
}

impl Mattes {
    /// The usual number of levels.
    pub const DEFAULT_LEVELS: u8 = 6;
    /// Greatest number of levels.
    pub const MAX_LEVELS: u8 = 32;

    /// No layers.
    pub const NONE: Self =
        Self { kinds: [false; MatteKind::ALL.len()], levels: Self::DEFAULT_LEVELS };

    /// Sets the number of levels, rounded up to an even number.
    pub fn set_levels(&mut self, levels: u32) {
        let levels = levels.clamp(1, u32::from(Self::MAX_LEVELS));
        self.levels = u8::try_from(levels.next_multiple_of(2)).unwrap_or(Self::MAX_LEVELS);
    }

    /// Whether there is a layer of `kind`.
    pub const fn contains(&self, kind: MatteKind) -> bool {
        self.kinds[kind as usize]
    }

    /// Adds a layer of `kind`.
    pub const fn insert(&mut self, kind: MatteKind) {
        self.kinds[kind as usize] = true;
    }

    /// The kinds with a layer, in order.
    pub fn iter(self) -> impl Iterator<Item = MatteKind> {
        let all = MatteKind::ALL.into_iter();
        all.filter(move |kind| self.contains(*kind))
    }

    /// Whether there are no layers.
    pub fn is_empty(&self) -> bool {
        self.kinds == Self::NONE.kinds
    }

    /// Number of floats of one layer: an object and its coverage for each level.
    pub const fn floats(&self) -> usize {
        2 * self.levels as usize
    }
}

impl Default for Mattes {
    fn default() -> Self {
        Self::NONE
    }
}

/// The layers of a film. See the module.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Layers {
    /// Light by its first interaction, linear RGB; the sum of all classes is the colour before denoising.
    pub lights: LightClasses,
    /// Number of light groups with layers: light by its source, linear RGB; the sum of all groups is the colour before
    /// denoising. Group 0 is that of light without a group. 0 if there are no such layers.
    pub light_groups: u8,
    /// `noisy`: the colour before denoising, linear RGB.
    pub noisy: bool,
    /// `shadow`: the fraction of direct light that arrives, 0 to 1.
    pub shadow: bool,
    /// `motion`: motion on the film to the next frame, pixels; x to the right, y up.
    pub motion: bool,
    /// Number of floats of attribute channels.
    pub attributes: u8,
    /// Cryptomatte.
    pub mattes: Mattes,
    /// `overlay`: what is drawn over previews, linear RGB with alpha. Rendering leaves it as it is.
    pub overlay: bool,
}

impl Layers {
    /// No layers.
    pub const NONE: Self = Self {
        lights: LightClasses::NONE,
        light_groups: 0,
        noisy: false,
        shadow: false,
        motion: false,
        attributes: 0,
        mattes: Mattes::NONE,
        overlay: false,
    };

    /// Adds the layers with this name in a manifest; None if there are none of that name.
    pub fn insert(&mut self, name: &str) -> Option<()> {
        match name {
            "lights" => self.lights = LightClasses::ALL,
            // The number of groups is that of the scene
            "light_groups" => self.light_groups = 1,
            "noisy" => self.noisy = true,
            "shadow" => self.shadow = true,
            "motion" => self.motion = true,
            "overlay" => self.overlay = true,
            "cryptomatte" => self.mattes.kinds.fill(true),
            _ => {
                let light = LightClass::ALL.into_iter().find(|c| c.name() == name);
                let matte = MatteKind::ALL.into_iter().find(|k| k.name() == name);
                match (light, matte) {
                    (Some(class), _) => self.lights.insert(class),
                    (_, Some(kind)) => self.mattes.insert(kind),
                    _ => return None,
                }
            }
        }
        Some(())
    }

    /// Sets the number of light groups, if there are layers for them: groups with `names`, and that of light without a
    /// group.
    pub fn set_light_groups(&mut self, names: usize) {
        if self.light_groups > 0 {
            self.light_groups = u8::try_from(1 + names).unwrap_or(u8::MAX);
        }
    }

    /// Number of floats of a pixel.
    pub fn floats(&self) -> usize {
        self.overlay_at().end
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.floats() == 0
    }

    /// Place of the light of `class` in the floats of a pixel: R, G and B.
    pub fn light_at(&self, class: LightClass) -> Option<Range<usize>> {
        let index = self.lights.iter().position(|c| c == class)?;
        Some(3 * index..3 * index + 3)
    }

    /// Place of the light of group `group` in the floats of a pixel: R, G and B.
    pub fn light_group_at(&self, group: usize) -> Range<usize> {
        let start = 3 * (self.lights.iter().count() + group);
        start..start + 3
    }

    /// Place of the colour before denoising.
    pub fn noisy_at(&self) -> Range<usize> {
        let start = self.light_group_at(usize::from(self.light_groups)).start;
        start..start + if self.noisy { 3 } else { 0 }
    }

    /// Place of the fraction of direct light.
    pub fn shadow_at(&self) -> Range<usize> {
        let start = self.noisy_at().end;
        start..start + usize::from(self.shadow)
    }

    /// Place of the motion.
    pub fn motion_at(&self) -> Range<usize> {
        let start = self.shadow_at().end;
        start..start + if self.motion { 2 } else { 0 }
    }

    /// Place of the attributes.
    pub fn attributes_at(&self) -> Range<usize> {
        let start = self.motion_at().end;
        start..start + usize::from(self.attributes)
    }

    fn mattes_at(&self) -> Range<usize> {
        let start = self.attributes_at().end;
        start..start + self.mattes.iter().count() * self.mattes.floats()
    }

    /// Place of the overlay: R, G, B and A.
    pub fn overlay_at(&self) -> Range<usize> {
        let start = self.mattes_at().end;
        start..start + if self.overlay { 4 } else { 0 }
    }

    /// Place of the layer of `kind`: object and coverage of each level.
    pub fn matte_at(&self, kind: MatteKind) -> Option<Range<usize>> {
        let index = self.mattes.iter().position(|k| k == kind)?;
        let (start, len) = (self.mattes_at().start, self.mattes.floats());
        Some(start + index * len..start + (index + 1) * len)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_follow_each_other_without_gaps() {
        let mut layers = Layers {
            noisy: true,
            shadow: true,
            motion: true,
            attributes: 4,
            overlay: true,
            light_groups: 2,
            ..Layers::NONE
        };
        layers.lights.insert(LightClass::Refraction);
        layers.lights.insert(LightClass::Diffuse);
        layers.mattes.insert(MatteKind::Part);
        layers.mattes.insert(MatteKind::Particle);
        let ranges = [
            layers.light_at(LightClass::Diffuse).unwrap(),
            layers.light_at(LightClass::Refraction).unwrap(),
            layers.light_group_at(0),
            layers.light_group_at(1),
            layers.noisy_at(),
            layers.shadow_at(),
            layers.motion_at(),
            layers.attributes_at(),
            layers.matte_at(MatteKind::Particle).unwrap(),
            layers.matte_at(MatteKind::Part).unwrap(),
            layers.overlay_at(),
        ];
        let mut end = 0;
        for (range, len) in ranges.into_iter().zip([3, 3, 3, 3, 3, 1, 2, 4, 12, 12, 4]) {
            assert_eq!((range.start, range.len()), (end, len));
            end = range.end;
        }
        assert_eq!(layers.floats(), end);
        assert_eq!(layers.light_at(LightClass::Emission), None);
        assert_eq!(layers.matte_at(MatteKind::Material), None);
        assert!(Layers::NONE.is_empty());
    }
}
