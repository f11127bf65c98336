//! Traces pictures, batch by batch of samples and depth by depth: see `shaders/queues.wgsl`, and `shaders/whitted.wgsl` or
//! `shaders/path.wgsl` for the transport of light.

use std::collections::BTreeMap;
use std::mem::take;

use bytemuck::{Pod, Zeroable};
use wgpu::{BindingResource, SubmissionIndex};

use crate::arrays::{Array, Downloads, Uniform, Uniforms};
use crate::batch::{Batch, DATA_BYTES, FILM_BYTES, MOST_RAYS, PixelNeed};
use crate::commands::{Commands, Timer, times_bytes};
use crate::denoise::Denoiser;
use crate::kernels::{self, Kernels, Variant, tile_of};
use crate::lighting::{Model, SceneUniform};
use crate::memory::{layer_bytes, object_bytes};
use crate::picture::{FilmSize, Picture, Samples, View};
use crate::pixels::{Cost, HostPixels};
use crate::readback::{KnownCost, LOST_WORDS, PendingPixels, Traced};
use crate::spheres::Spheres;
use crate::trace_arrays::TraceArrays;
use crate::tree::{TreeBuilder, TreeShape};
use crate::{Device, GpuError};

/// Invocations in a workgroup.
const GROUP: u64 = kernels::GROUP as u64;
/// Largest number of stages whose time is kept; pictures of opaque spheres with more batches have several in a stage.
const MAX_STAGES: u32 = 1025;
/// Parts of a picture that are submitted before the first of them has ended: the device need not wait for the host, and
/// neither a stop nor the progress waits for hundreds of samples.
const PARTS_AHEAD: usize = 4;
/// Depths between two questions whether the rays of all pixels have ended, if spheres are transmissive. The last of these
/// depths writes the same queue as the first.
const DEPTHS_OF_GLASS: u32 = 33;

/// Base colours of spheres, linear RGB.
#[derive(Debug, Clone, Copy)]
pub enum Colors<'a> {
    /// All have this one.
    Constant([f32; 3]),
    /// One for each sphere.
    PerSphere(&'a [[f32; 3]]),
    /// One for each sphere, with its opacity: how much of what is behind it the sphere covers.
    WithOpacity(&'a [[f32; 4]]),
}

/// A uniform of the kernels.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
struct Stage {
    depth: u32,
    source: u32,
    counters: u32,
    last: u32,
}

/// A uniform of the kernels.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
struct Current {
    sample: u32,
    zeros: [u32; 3],
}

/// Renders one frame after another on a device, in memory that is kept.
#[derive(Debug)]
pub struct Renderer {
    tree: TreeBuilder,
    kernels: BTreeMap<Variant, Kernels>,
    arrays: TraceArrays,
    uniforms: Uniforms,
    denoiser: Denoiser,
    timer: Option<Timer>,
    downloads: Downloads,
    /// Rays that are traced together at most, if there are several of a pixel.
    most_rays: u64,
    has_colors: bool,
    has_opacity: bool,
    color: [f32; 3],
    /// The picture that was traced last.
    traced: Option<Traced>,
    /// Number of stages whose time was measured for it.
    stages: u32,
    /// Seconds of stages before these.
    seconds_before: f64,
}

impl Renderer {
    /// A renderer without a frame.
    pub fn new(device: &Device) -> Self {
        Self {
            tree: TreeBuilder::new(device),
            kernels: BTreeMap::new(),
            arrays: TraceArrays::default(),
            uniforms: Uniforms::default(),
            denoiser: Denoiser::default(),
            timer: Timer::new(device, MAX_STAGES),
            downloads: Downloads::default(),
            most_rays: MOST_RAYS,
            has_colors: false,
            has_opacity: false,
            color: [0.0; 3],
            traced: None,
            stages: 0,
            seconds_before: 0.0,
        }
    }

    /// The same, which traces at most that many rays together.
    #[cfg(test)]
    pub(crate) fn with_most_rays(self, most_rays: u64) -> Self {
        Self { most_rays, ..self }
    }

    /// The tree.
    #[cfg(test)]
    pub(crate) fn tree_mut(&mut self) -> &mut TreeBuilder {
        &mut self.tree
    }

    /// Copies a frame to the device, and starts to build its tree.
    ///
    /// # Errors
    /// If the frame does not fit, or if the device fails.
    ///
    /// # Panics
    /// If there are fewer radii than centres.
    pub fn prepare(
        &mut self,
        device: &Device,
        spheres: &Spheres<'_>,
        colors: Colors<'_>,
    ) -> Result<(), GpuError> {
        let bytes: &[u8] = match colors {
            Colors::Constant(color) => {
                self.color = color;
                &[]
            }
            Colors::PerSphere(colors) => bytemuck::cast_slice(colors),
            Colors::WithOpacity(colors) => bytemuck::cast_slice(colors),
        };
        self.arrays.colors.write(device, "colours", bytes)?;
        self.has_colors = !matches!(colors, Colors::Constant(_));
        self.has_opacity = matches!(colors, Colors::WithOpacity(_));
        self.tree.build(device, spheres, self.timer.as_ref())
    }

    /// Starts to build the tree of the frame that was prepared last once more: to measure it.
    ///
    /// # Errors
    /// If the device fails.
    pub fn rebuild(&mut self, device: &Device) -> Result<(), GpuError> {
        self.tree.start(device, self.timer.as_ref())
    }

    /// Starts to render a picture of the frame that was prepared last. [`Self::read`] has the result.
    ///
    /// # Errors
    /// If `is_stopped` returns true, or if the device fails. It is asked before each part of the picture, with the number
    /// of pixels that the device has done: of half the samples, half of them.
    ///
    /// # Panics
    /// If the picture has too many lights, or no set of samples for each pixel, or if it has an exposure and the spheres have
    /// no displacements, or the other way round.
    pub fn trace(
        &mut self,
        device: &Device,
        picture: &Picture<'_>,
        is_stopped: &dyn Fn(u64) -> bool,
    ) -> Result<(), GpuError> {
        let batch = self.reserve_batch(device, picture)?;
        let shape = *self.tree.shape();
        assert_eq!(shape.has_motion, picture.exposure.is_some(), "both move, or none");
        let variant = Variant::of(picture, &shape, self.has_opacity, batch.samples);
        let part = self.tree.part_constant();
        self.kernels.entry(variant).or_insert_with(|| Kernels::new(device, variant, &part));
        let plan = self.plan(picture, &shape, batch);
        self.uniforms.upload(device)?;
        // Trace batch by batch
        let per_stage = match plan.last {
            0 => plan.batches.len().div_ceil(MAX_STAGES as usize - 1).max(1),
            _ => 1,
        };
        (self.stages, self.seconds_before) = (1, 0.0);
        let parts = plan.batches.chunks(per_stage);
        let count = parts.len();
        let mut submitted = Vec::with_capacity(count);
        for (part, batches) in parts.enumerate() {
            let ended = (part + 1).saturating_sub(PARTS_AHEAD);
            if let Some(last) = ended.checked_sub(1) {
                device.wait_for(&submitted[last])?;
            }
            let is_stopped = || is_stopped(picture.film.pixels() * ended as u64 / count as u64);
            if is_stopped() {
                device.wait()?;
                return Err(GpuError::Interrupted);
            }
            let mut commands = Commands::new(device);
            for first in batches {
                self.add_batch(&mut commands, &self.kernels[&variant], &plan, *first);
            }
            submitted.push(self.submit_stage(device, commands)?);
            self.trace_kept(device, &plan, variant, batches, &is_stopped)?;
        }
        self.denoise(device, &plan, variant, picture)?;
        self.traced = Some(Traced {
            pixels: picture.film.pixels(),
            samples: picture.samples.count,
            sources: picture.sources(),
            queues: picture.ray_kinds().queues(),
            is_denoised: picture.denoising.is_some(),
            has_objects: picture.has_objects,
            layers: picture.layer_count(),
        });
        device.check()
    }

    /// Counts the rays of the last sample, and denoises the picture if it is to be: the last stage.
    fn denoise(
        &mut self,
        device: &Device,
        plan: &Plan,
        variant: Variant,
        picture: &Picture<'_>,
    ) -> Result<(), GpuError> {
        let mut commands = Commands::new(device);
        let kernels = &self.kernels[&variant];
        self.add_count(&mut commands, kernels, plan);
        let (Some(denoising), Some(store)) = (&picture.denoising, &kernels.store_features) else {
            commands.submit();
            return Ok(());
        };
        let array_of = |binding| self.array(binding, plan, [plan.batches[0], plan.depths[0]], 0);
        commands.add(store, &array_of, plan.film.pixels(), GROUP);
        self.denoiser.add(device, &mut commands, picture, denoising, &self.arrays.film)?;
        self.submit_stage(device, commands).map(drop)
    }

    /// Starts the dispatches of a stage, whose time is measured. If that of no more stages can be kept, adds up those so far.
    fn submit_stage(
        &mut self,
        device: &Device,
        mut commands: Commands<'_>,
    ) -> Result<SubmissionIndex, GpuError> {
        if let (MAX_STAGES, Some(timer)) = (self.stages, &self.timer) {
            self.seconds_before += timer.seconds(device, MAX_STAGES)?.iter().skip(1).sum::<f64>();
            self.stages = 1;
        }
        commands.end_stage(self.timer.as_ref().map(|timer| (timer, self.stages)));
        self.stages += 1;
        Ok(commands.submit())
    }

    /// Traces what is left of a sample with transmissive spheres, until the rays of all pixels have ended.
    fn trace_kept(
        &mut self,
        device: &Device,
        plan: &Plan,
        variant: Variant,
        batches: &[Uniform],
        is_stopped: &dyn Fn() -> bool,
    ) -> Result<(), GpuError> {
        let ([first], 1..) = (batches, plan.last) else { return Ok(()) };
        loop {
            let lengths: Vec<u32> = bytemuck::pod_collect_to_vec(&self.arrays.queued.read(device)?);
            if lengths[plan.last] == 0 {
                break;
            }
            if is_stopped() {
                device.wait()?;
                return Err(GpuError::Interrupted);
            }
            let mut commands = Commands::new(device);
            let kernels = &self.kernels[&variant];
            self.add_count(&mut commands, kernels, plan);
            self.add_depths(&mut commands, kernels, plan, *first, 1);
            self.submit_stage(device, commands)?;
        }
        let mut commands = Commands::new(device);
        self.add_sums(&mut commands, &self.kernels[&variant], plan, *first);
        commands.submit();
        Ok(())
    }

    /// The batches of a picture.
    fn batch_of(&self, device: &Device, picture: &Picture<'_>) -> Batch {
        let need = PixelNeed {
            samples: picture.samples.count,
            is_denoised: picture.denoising.is_some(),
            has_clamp: picture.has_clamp(),
        };
        let limits = [self.most_rays, device.adapter().max_array];
        Batch::new(picture.ray_kinds(), need, picture.film.pixels(), limits)
    }

    /// Starts to copy the picture that was started last, and what it and its frame have cost, to the host.
    ///
    /// # Errors
    /// If the device fails.
    ///
    /// # Panics
    /// Without a picture.
    pub fn start_read(&self, device: &Device) -> Result<PendingPixels, GpuError> {
        let Traced { pixels, samples, is_denoised, has_objects, layers, .. } = self.traced();
        let film = FILM_BYTES * pixels;
        self.download(
            device,
            [
                (&self.arrays.film, film),
                (self.denoiser.clean(), if is_denoised { film } else { 0 }),
                (&self.arrays.data, DATA_BYTES * pixels),
                (&self.arrays.objects, object_bytes(has_objects, samples) * pixels),
                (&self.arrays.layers, layer_bytes(layers, false) * pixels),
            ],
        )
    }

    /// Waits for the picture that was started last, and returns its pixels.
    ///
    /// # Errors
    /// If the device fails.
    ///
    /// # Panics
    /// Without a picture.
    pub fn read(&self, device: &Device) -> Result<HostPixels, GpuError> {
        Ok(self.start_read(device)?.wait(device)?.0)
    }

    /// Waits for the picture that was started last. Returns what it and its frame have cost.
    ///
    /// # Errors
    /// If the device fails.
    ///
    /// # Panics
    /// Without a picture.
    pub fn cost(&self, device: &Device) -> Result<Cost, GpuError> {
        let pending = self.download(device, [(&self.arrays.film, 0); 5])?;
        Ok(pending.wait(device)?.1)
    }

    fn traced(&self) -> Traced {
        self.traced.expect("a picture was traced")
    }

    /// Starts to copy the first bytes of arrays, then the counts of rays and the times of stages.
    fn download(
        &self,
        device: &Device,
        arrays: [(&Array, u64); 5],
    ) -> Result<PendingPixels, GpuError> {
        let lengths = arrays.map(|(_, length)| length);
        let counts = (&self.arrays.sums, self.arrays.sums.len());
        let copied = || arrays.into_iter().chain([counts]).filter(|(_, length)| *length > 0);
        let all: u64 = copied().map(|(_, length)| length).sum();
        let times = self.timer.as_ref().map_or(0, |_| times_bytes(self.stages));
        // Copies of times begin at multiples of eight bytes, as counts do
        let download = self.downloads.reserve(device, all + times)?;
        let mut commands = Commands::new(device);
        let mut at = 0;
        for (array, length) in copied() {
            commands.copy(array, &download, [at, length]);
            at += length;
        }
        if let Some(timer) = &self.timer {
            commands.copy_times(timer, self.stages, &download, at);
        }
        let content = download.after(commands.submit());
        let bytes = self.arrays.all().iter().map(|array| array.bytes()).sum::<u64>();
        let cost = KnownCost {
            traced: self.traced(),
            seconds_before: self.seconds_before,
            bytes: self.tree.bytes() + bytes + self.denoiser.bytes(),
            tree_bytes: self.tree.bytes(),
        };
        Ok(PendingPixels { content, lengths, counts: counts.1, cost })
    }

    /// Makes room for the batches of a picture. If memory is full, samples are traced one by one from then on.
    fn reserve_batch(&mut self, device: &Device, picture: &Picture<'_>) -> Result<Batch, GpuError> {
        let batch = self.batch_of(device, picture);
        match self.reserve(device, picture, batch) {
            Err(GpuError::OutOfMemory) if batch.samples > 1 => {
                // Free what was reserved, and the memory of the picture before
                let colors = take(&mut self.arrays.colors);
                self.arrays = TraceArrays::with_colors(colors);
                device.wait()?;
                self.most_rays = 0;
                let single = self.batch_of(device, picture);
                self.reserve(device, picture, single)?;
                Ok(single)
            }
            reserved => reserved.map(|()| batch),
        }
    }

    fn reserve(
        &mut self,
        device: &Device,
        picture: &Picture<'_>,
        batch: Batch,
    ) -> Result<(), GpuError> {
        let pixels = picture.film.pixels();
        let rays = picture.ray_kinds();
        if picture.denoising.is_some() {
            self.denoiser.reserve(device, picture)?;
        }
        let counters = vec![0; counter_count(picture) as usize];
        let arrays = &mut self.arrays;
        arrays.film.reserve(device, "pixels", batch.film_bytes() * pixels)?;
        arrays.data.reserve(device, "pixels", batch.data_bytes() * pixels)?;
        let objects = object_bytes(picture.has_objects, picture.samples.count);
        arrays.objects.reserve(device, "objects of all samples", objects * pixels)?;
        let layers = layer_bytes(picture.layer_count(), picture.has_clamp());
        arrays.layers.reserve(device, "layers of light", layers * pixels)?;
        for queue in &mut arrays.rays {
            queue.reserve(device, "rays", batch.ray_bytes(rays) * pixels)?;
        }
        for queues in &mut arrays.shadows[..rays.shadow_arrays()] {
            queues.reserve(device, "shadow rays", batch.shadow_bytes(rays) * pixels)?;
        }
        arrays.kept.reserve(device, "rays through glass", rays.kept_bytes() * pixels)?;
        if let Model::Paths(lighting) = picture.model {
            arrays.write_tables(device, lighting)?;
        }
        arrays.queued.write(device, "queues", bytemuck::cast_slice::<u32, u8>(&counters))?;
        arrays.sums.write(
            device,
            "counts",
            bytemuck::cast_slice(&[&counters[..], &counters].concat()),
        )?;
        // The pictures of a job have the same samples; other filters have other points
        let Samples { points, sets, .. } = picture.samples;
        let is_there =
            |(film, there): &(FilmSize, Vec<_>)| *film == picture.film && there == points;
        if !arrays.sampled.as_ref().is_some_and(is_there) {
            assert_eq!(sets.len() as u64, pixels, "one set of samples for each pixel");
            arrays.points.write(device, "samples", bytemuck::cast_slice(points))?;
            arrays.sets.write(device, "sets of samples", bytemuck::cast_slice(sets))?;
            arrays.sampled = Some((picture.film, points.to_vec()));
        }
        Ok(())
    }

    /// Fills the uniforms of a picture.
    fn plan(&mut self, picture: &Picture<'_>, shape: &TreeShape, batch: Batch) -> Plan {
        let uniforms = &mut self.uniforms;
        uniforms.clear();
        let pixels = picture.film.width * picture.film.height;
        let [first_film, first_data] = batch.before.map(|planes| planes * pixels);
        let view = View {
            levels: shape.levels,
            radius: shape.radius,
            padding: shape.padding,
            starts: shape.starts,
            sphere_count: u32::try_from(shape.count).expect("at most MAX_SPHERES"),
            wide_count: u32::try_from(shape.wide_count).expect("fewer than spheres"),
            color_kind: self.has_colors.into(),
            color: self.color,
            first_film,
            first_data,
            ..View::new(picture)
        };
        let view = uniforms.push(&view);
        let scene = match picture.model {
            Model::Whitted(ground) => {
                ground.as_ref().map(|of| uniforms.push(&SceneUniform::from(of)))
            }
            Model::Paths(lighting) => Some(uniforms.push(&SceneUniform::from(lighting))),
        };
        let counters = counter_count(picture);
        let firsts = (0..picture.samples.count).step_by(batch.samples as usize);
        let batches =
            firsts.map(|sample| uniforms.push(&Current { sample, ..Current::default() })).collect();
        let depth_count = depth_count(picture);
        let last = match picture.kept_rays() {
            Some(_) => (depth_count - 1) * picture.ray_kinds().queues(),
            None => 0,
        };
        let mut push = |stage: Stage| uniforms.push(&Stage { counters, last, ..stage });
        let mut all = |stages: &mut dyn Iterator<Item = Stage>| stages.map(&mut push).collect();
        let depths = 1..=depth_count;
        let rays = picture.ray_kinds();
        let sources = 0..picture.sources();
        let is_used = |depth, source: u32| has_shadows(picture, depth, source);
        let with_next = sources.clone().find(|source| rays.has_lit() && is_used(1, *source));
        let source = with_next.unwrap_or_default();
        Plan {
            view,
            scene,
            film: picture.film,
            counters,
            last: last as usize,
            batch: batch.samples,
            batches,
            depths: all(&mut depths.clone().map(|depth| Stage {
                depth,
                source,
                ..Stage::default()
            })),
            sources: depths
                .map(|depth| {
                    let has_next = |source| depth < depth_count && Some(source) == with_next;
                    let own = sources
                        .clone()
                        .filter(|source| is_used(depth, *source) && !has_next(*source));
                    all(&mut own.map(|source| Stage { depth, source, ..Stage::default() }))
                })
                .collect(),
            shadow_arrays: rays.shadow_arrays(),
        }
    }

    /// Adds the dispatches of the samples of a batch.
    fn add_batch(
        &self,
        commands: &mut Commands<'_>,
        kernels: &Kernels,
        plan: &Plan,
        first: Uniform,
    ) {
        self.add_count(commands, kernels, plan);
        self.add_depths(commands, kernels, plan, first, 0);
        // Those through glass have not ended yet
        if plan.last == 0 {
            self.add_sums(commands, kernels, plan, first);
        }
    }

    /// Adds the dispatch that adds the samples of a batch to their pixels, if they have several.
    fn add_sums(
        &self,
        commands: &mut Commands<'_>,
        kernels: &Kernels,
        plan: &Plan,
        first: Uniform,
    ) {
        let Some(add) = &kernels.add_batch else { return };
        let array_of = |binding| self.array(binding, plan, [first, plan.depths[0]], 0);
        commands.add(add, &array_of, plan.film.pixels(), GROUP);
    }

    /// Adds the dispatches of a batch from a depth on, which counts from 0.
    fn add_depths(
        &self,
        commands: &mut Commands<'_>,
        kernels: &Kernels,
        plan: &Plan,
        batch: Uniform,
        first: usize,
    ) {
        let rays = plan.film.pixels() * u64::from(plan.batch);
        let followers = rays.div_ceil(2);
        let depths = plan.depths.iter().zip(&plan.sources).enumerate();
        for (number, (depth, sources)) in depths.skip(first) {
            let array_of = |binding| self.array(binding, plan, [batch, *depth], number);
            if number == 0 {
                let [width, height] = tile_of(plan.batch);
                let tiles = [plan.film.width.div_ceil(width), plan.film.height.div_ceil(height)];
                commands.add_groups(&kernels.trace_camera, &array_of, tiles);
            } else {
                commands.add(&kernels.trace_next, &array_of, followers, GROUP);
            }
            for source in sources {
                // They read what this depth has written
                let array_of = |binding| self.array(binding, plan, [batch, *source], number + 1);
                commands.add(&kernels.trace_shadow, &array_of, followers, GROUP);
            }
            if let (Some(clamp), 1..) = (&kernels.clamp_indirect, number) {
                commands.add(clamp, &array_of, rays, GROUP);
            }
        }
    }

    /// Adds the dispatch that empties the queues, and counts the rays that they had.
    fn add_count(&self, commands: &mut Commands<'_>, kernels: &Kernels, plan: &Plan) {
        let array_of = |binding| self.array(binding, plan, [plan.batches[0], plan.depths[0]], 0);
        commands.add(&kernels.empty_queues, &array_of, plan.counters.into(), GROUP);
    }

    /// The argument of a kernel for a binding, in the dispatches of a depth: the queues of rays change places.
    fn array(
        &self,
        binding: u32,
        plan: &Plan,
        [batch, stage]: [Uniform; 2],
        depth: usize,
    ) -> BindingResource<'_> {
        let arrays = &self.arrays;
        let array = match binding {
            0 => return self.uniforms.binding(plan.view),
            15 => {
                return self
                    .uniforms
                    .binding(plan.scene.expect("only kernels that need it use it"));
            }
            13 => return self.uniforms.binding(stage),
            18 => return self.uniforms.binding(batch),
            4 => &arrays.points,
            5 => &arrays.sets,
            6 => &arrays.film,
            7 => &arrays.data,
            8 => &arrays.queued,
            9 => &arrays.rays[depth % 2],
            10 => &arrays.rays[1 - depth % 2],
            11 => &arrays.shadows[depth % plan.shadow_arrays],
            29 => &arrays.shadows[(depth + 1) % plan.shadow_arrays],
            12 => &arrays.colors,
            14 => &arrays.sums,
            16 => &arrays.texels,
            17 => &arrays.constants,
            19 => &arrays.detail,
            20 => &arrays.objects,
            21 => &arrays.layers,
            23 => &arrays.kept,
            28 => self.denoiser.guides(),
            _ => {
                return self
                    .tree
                    .traversal_array(binding)
                    .expect("the others are those of the tree");
            }
        };
        array.binding()
    }
}

/// Number of rays one after the other; with transmissive spheres, as many before the next question.
fn depth_count(picture: &Picture<'_>) -> u32 {
    match picture.model {
        _ if picture.kept_rays().is_some() => DEPTHS_OF_GLASS,
        Model::Whitted(_) if picture.material.reflection > 0.0 => picture.max_depth,
        Model::Whitted(_) => 1,
        // The last segment finds lights; without any, it is a shadow ray to the environment
        Model::Paths(lighting) => lighting.bounces + 1 + u32::from(picture.has_extents()),
    }
}

/// Whether there are shadow rays to a source at a depth.
fn has_shadows(picture: &Picture<'_>, depth: u32, source: u32) -> bool {
    let scene = match picture.model {
        Model::Whitted(_) => None,
        Model::Paths(lighting) => Some(lighting),
    };
    // The lights follow, then the environment and the lights of a catcher
    let rays = picture.ray_kinds();
    let lights = picture.lights;
    match (source.checked_sub(rays.first_light()), scene) {
        (Some(light), _) if light < rays.lights => lights[light as usize].casts_shadow,
        (Some(light), Some(scene)) => match light - rays.lights {
            0 => scene.environment.is_some(),
            light => lights[light as usize - 1].casts_shadow,
        },
        (Some(_), None) => false,
        (None, Some(scene)) if scene.environment.is_none() => false,
        (None, Some(scene)) if source == 1 => {
            depth > scene.bounces && !picture.has_extents() && rays.kept.is_none()
        }
        (None, _) => true,
    }
}

/// Number of counters of a sample: the lengths of its queues at each depth, then the light that is lost.
fn counter_count(picture: &Picture<'_>) -> u32 {
    #[expect(clippy::cast_possible_truncation, reason = "it is 2")]
    let lost = LOST_WORDS as u32;
    depth_count(picture) * picture.ray_kinds().queues() + lost
}

/// The uniforms of a picture.
struct Plan {
    view: Uniform,
    /// The lighting of paths, or a ground.
    scene: Option<Uniform>,
    film: FilmSize,
    /// Number of counters of a sample.
    counters: u32,
    /// The queue of the rays that go on behind the last depth, or 0.
    last: usize,
    /// Samples of a batch.
    batch: u32,
    /// The first sample of each batch.
    batches: Vec<Uniform>,
    depths: Vec<Uniform>,
    /// The sources of shadow rays of each depth that have dispatches of their own.
    sources: Vec<Vec<Uniform>>,
    /// Number of arrays for shadow rays.
    shadow_arrays: usize,
}
