//! What the samples of a group contribute to the layers of a film, and their accumulation to pixels.

use std::ops::Range;

use super::channels::Channels;
use super::cryptomatte::rank;
use super::film::FilmTile;
use super::layers::{Layers, LightClass, MatteKind};
use super::light_groups::GroupLight;
use super::light_split::LightSplit;
use super::planes::FilmPlane;
use super::stream::SegmentPacket;
use glam::Vec3;
use spherule_tree::math::{LANES, Lanes, Lanes3, lane3, lanes_in, splat};

/// Contributions of samples to layers, packet by packet. Vectors of layers that the film does not have are empty.
#[derive(Default)]
pub(super) struct SampleLayers {
    pub(super) channels: Channels,
    /// Decides about the number of light groups, also for samples that are for no film.
    pub(super) layers: Layers,
    /// The light group of the background.
    pub(super) background_group: usize,
    /// The object of each sample, of each kind; 0 for none.
    objects: [Vec<[u32; LANES]>; MatteKind::ALL.len()],
    /// Radiance of each sample by class.
    lights: Vec<[Lanes3; LightClass::COUNT]>,
    /// Radiance of each sample by light group: all groups of a packet, then those of the next.
    groups: Vec<Lanes3>,
    /// The diffuse part of the reflection at the first surface.
    diffuse: Vec<Lanes3>,
    /// Radiance after one interaction at most.
    direct_radiance: Vec<Lanes3>,
    /// The light that a shadow catcher lacks.
    shadow_loss: Vec<Lanes3>,
    /// Luminance of direct light: if nothing is in the way, and what arrives.
    direct: Vec<[Lanes; 2]>,
    /// Objects and coverage of the samples of a pixel.
    covered: Vec<(u32, f32)>,
}

impl SampleLayers {
    pub(super) fn is_empty(&self) -> bool {
        !self.channels.needs_samples()
    }

    /// Removes all samples.
    pub(super) fn clear(&mut self) {
        self.objects.iter_mut().for_each(Vec::clear);
        self.lights.clear();
        self.groups.clear();
        self.diffuse.clear();
        self.direct_radiance.clear();
        self.shadow_loss.clear();
        self.direct.clear();
    }

    /// Adds a packet of samples.
    pub(super) fn push_packet(&mut self) {
        for kind in self.channels.mattes() {
            self.objects[kind as usize].push([0; LANES]);
        }
        if self.channels.needs_light_classes() {
            self.lights.push([[splat(0.0); 3]; LightClass::COUNT]);
            self.diffuse.push([splat(0.0); 3]);
            self.direct_radiance.push([splat(0.0); 3]);
        }
        if self.channels.has(FilmPlane::ShadowCatcher) {
            self.shadow_loss.push([splat(0.0); 3]);
        }
        let groups = self.groups.len() + usize::from(self.layers.light_groups);
        self.groups.resize(groups, [splat(0.0); 3]);
        if self.channels.has(FilmPlane::Shadow) {
            self.direct.push([splat(0.0); 2]);
        }
    }

    /// Memory for `samples`, bytes.
    pub(super) fn bytes(channels: &Channels, samples: usize) -> usize {
        let objects = channels.mattes().count() * size_of::<[u32; LANES]>();
        let lights = if channels.needs_light_classes() {
            (LightClass::COUNT + 2) * size_of::<Lanes3>()
        } else {
            0
        };
        let groups = usize::from(channels.layers.light_groups) * size_of::<Lanes3>();
        let of = |plane, bytes| if channels.has(plane) { bytes } else { 0 };
        let direct = of(FilmPlane::Shadow, size_of::<[Lanes; 2]>())
            + of(FilmPlane::ShadowCatcher, size_of::<Lanes3>());
        // Vectors grow by doubling
        2 * samples.div_ceil(LANES) * (objects + lights + groups + direct)
    }

    /// Stores the light that camera rays of packet `number` see.
    pub(super) fn store(&mut self, number: usize, split: &LightSplit, groups: &GroupLight) {
        let all = groups.all();
        self.groups[number * all.len()..(number + 1) * all.len()].copy_from_slice(all);
        if split.is_active {
            self.lights[number] = split.lights;
            self.diffuse[number] = split.diffuse;
            self.direct_radiance[number] = split.direct_radiance;
        }
        if let Some(shadow_loss) = split.shadow_loss {
            self.shadow_loss[number] = shadow_loss;
        }
        if split.has_shadow {
            self.direct[number] = split.direct;
        }
    }

    /// Adds the radiance along the rays of `segments`, which are not camera rays, to the classes of their samples.
    /// `direct_radiance` is the part of it after one interaction.
    pub(super) fn add(
        &mut self,
        segments: &SegmentPacket,
        radiance: &Lanes3,
        direct_radiance: &Lanes3,
    ) {
        if !self.channels.needs_light_classes() {
            return;
        }
        for lane in lanes_in(segments.lanes()) {
            let sample = segments.sample[lane] as usize;
            let (packet, to) = (sample / LANES, sample % LANES);
            let lights = &mut self.lights[packet];
            for axis in 0..3 {
                let added = radiance[axis][lane];
                self.direct_radiance[packet][axis][to] += direct_radiance[axis][lane];
                if let Some(class) = segments.first[lane].class() {
                    lights[class as usize][axis][to] += added;
                    continue;
                }
                let diffuse = self.diffuse[packet][axis][to] * added;
                lights[LightClass::Diffuse as usize][axis][to] += diffuse;
                lights[LightClass::Specular as usize][axis][to] += added - diffuse;
            }
        }
    }

    /// Adds the light of `groups` along the rays of `segments`, which are not camera rays, to the groups of their
    /// samples.
    pub(super) fn add_groups(&mut self, segments: &SegmentPacket, groups: &GroupLight) {
        let count = groups.all().len();
        for (group, radiance) in groups.all().iter().enumerate() {
            for lane in lanes_in(segments.lanes()) {
                let sample = segments.sample[lane] as usize;
                let sum = &mut self.groups[sample / LANES * count + group];
                for (sum, radiance) in sum.iter_mut().zip(radiance) {
                    sum[sample % LANES] += radiance[lane];
                }
            }
        }
    }

    /// The light of `group` at a sample, linear RGB.
    pub(super) fn light_of_group(&self, group: usize, sample: usize) -> Vec3 {
        let count = usize::from(self.layers.light_groups);
        lane3(&self.groups[sample / LANES * count + group], sample % LANES)
    }

    /// Stores the object of `kind` of the sample in `lane` of `packet`.
    pub(super) fn set_object(&mut self, kind: MatteKind, packet: usize, lane: usize, object: u32) {
        self.objects[kind as usize][packet][lane] = object;
    }

    /// Stores the planes that come from all samples of a pixel, those in `range`. The `mean` of the samples has been
    /// limited to `color`. `coverage`: that of all samples. `pixel`: its column and row in `tile`.
    pub(super) fn accumulate(
        &mut self,
        range: Range<usize>,
        coverage: &[Lanes],
        (mean, color): ([f32; 4], [f32; 4]),
        (tile, [column, row]): (&mut FilmTile<'_>, [u32; 2]),
    ) {
        let share = 1.0 / range.len() as f32;
        if self.channels.has(FilmPlane::Noisy) {
            tile.components_mut(FilmPlane::Noisy, column, row).copy_from_slice(&color[..3]);
        }
        // What the limit took from the mean is missing in the background: shadows on it may be darker than it is
        let limited = Vec3::from_slice(&color) - Vec3::from_slice(&mean);
        if self.channels.needs_light_classes() {
            self.accumulate_classes(range.clone(), limited, (tile, [column, row]));
            let direct = mean_of(&self.direct_radiance, range.clone()) + limited;
            let indirect = Vec3::from_slice(&color) - direct;
            store(tile.components_mut(FilmPlane::Direct, column, row), direct);
            store(tile.components_mut(FilmPlane::Indirect, column, row), indirect);
        }
        if self.channels.has(FilmPlane::ShadowCatcher) {
            let arriving = Vec3::ONE - mean_of(&self.shadow_loss, range.clone());
            store(
                tile.components_mut(FilmPlane::ShadowCatcher, column, row),
                arriving.max(Vec3::ZERO),
            );
        }
        let groups = tile.components_mut(FilmPlane::LightGroups, column, row);
        self.accumulate_groups(range.clone(), limited, groups);
        if self.channels.has(FilmPlane::Shadow) {
            let arriving = self.arriving(range.clone());
            tile.components_mut(FilmPlane::Shadow, column, row).fill(arriving);
        }
        // Rank the objects of each kind by the part of the pixel that they cover
        for kind in self.channels.mattes() {
            let objects = &self.objects[kind as usize];
            let sample = |s: usize| (objects[s / LANES][s % LANES], coverage[s / LANES][s % LANES]);
            self.covered.clear();
            let samples = range.clone().map(sample);
            self.covered.extend(samples.filter(|(object, _)| *object != 0));
            rank(&mut self.covered, share, tile.components_mut(kind.plane(), column, row));
        }
    }

    /// The fraction of the direct light of samples that arrives.
    fn arriving(&self, range: Range<usize>) -> f32 {
        let sum = |part: usize| -> f32 {
            let sample = |s: usize| self.direct[s / LANES][part][s % LANES];
            range.clone().map(sample).sum()
        };
        lit_part([sum(0), sum(1)])
    }

    /// Stores the mean light of each class. `limited` is added to the background.
    fn accumulate_classes(
        &self,
        range: Range<usize>,
        limited: Vec3,
        (tile, [column, row]): (&mut FilmTile<'_>, [u32; 2]),
    ) {
        let share = 1.0 / range.len() as f32;
        for class in LightClass::ALL {
            let light = tile.components_mut(class.plane(), column, row);
            for (axis, light) in light.iter_mut().enumerate() {
                let sample = |s: usize| self.lights[s / LANES][class as usize][axis][s % LANES];
                let sum: f32 = range.clone().map(sample).sum();
                let limited = match class {
                    LightClass::Background => limited[axis],
                    _ => 0.0,
                };
                *light = sum * share + limited;
            }
        }
    }

    /// Stores the mean light of each light group in `floats`. `limited` is added to the group of the background.
    fn accumulate_groups(&self, range: Range<usize>, limited: Vec3, floats: &mut [f32]) {
        let share = 1.0 / range.len() as f32;
        for (group, light) in floats.chunks_mut(3).enumerate() {
            let samples = range.clone().map(|s| self.light_of_group(group, s));
            let limited = if group == self.background_group { limited } else { Vec3::ZERO };
            let mean = samples.sum::<Vec3>() * share + limited;
            light.copy_from_slice(&mean.to_array());
        }
    }
}

/// The part of direct light that arrives, 0 to 1, by its luminance: if nothing is in the way, and what arrives.
pub(super) fn lit_part([whole, arriving]: [f32; 2]) -> f32 {
    let lit = if whole > 0.0 { arriving / whole } else { 1.0 };
    lit.clamp(0.0, 1.0)
}

/// The mean of the samples in `range`.
fn mean_of(samples: &[Lanes3], range: Range<usize>) -> Vec3 {
    let share = 1.0 / range.len() as f32;
    range.map(|s| lane3(&samples[s / LANES], s % LANES)).sum::<Vec3>() * share
}

/// Stores `color` in the components of a pixel, if it has them.
pub(super) fn store(components: &mut [f32], color: Vec3) {
    for (component, value) in components.iter_mut().zip(color.to_array()) {
        *component = value;
    }
}
