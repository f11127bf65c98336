//! Traces pictures by Whitted's model, see `shaders/whitted.wgsl`.

use std::collections::BTreeMap;

use bytemuck::{Pod, Zeroable};
use wgpu::BindingResource;

use crate::arrays::{Array, Download, Uniform, Uniforms};
use crate::commands::{Commands, Kernel, Timer};
use crate::picture::{FilmSize, Picture, Samples, View};
use crate::tree::{Spheres, TreeBuilder, TreeShape, tree_constants};
use crate::{Device, GpuError};

/// Entries of the traversal's stack for each level of nodes: all children but the one that is visited next.
const STACK_PER_LEVEL: u32 = 7;
/// Levels that the shortest stack holds. Fewer levels do not make it faster.
const MIN_STACK_LEVELS: u32 = 6;
/// Invocations in a workgroup.
const GROUP: u64 = 64;
/// Largest number of stages whose time is measured; pictures with more samples have several in a stage.
const MAX_STAGES: u32 = 257;

/// Base colours of spheres, linear RGB.
#[derive(Debug, Clone, Copy)]
pub enum Colors<'a> {
    /// All have this one.
    Constant([f32; 3]),
    /// One for each sphere.
    PerSphere(&'a [[f32; 3]]),
}

/// The pixels of a picture, row by row.
#[derive(Debug, Clone, Copy)]
pub struct Pixels<'a> {
    /// Red, green, blue and coverage, each the sum over the samples.
    pub sums: &'a [[f32; 4]],
    /// The nearest sample.
    pub nearest: &'a [NearestSample],
}

/// The nearest intersection of a pixel.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct NearestSample {
    /// Distance along the view axis.
    pub depth: f32,
    /// Index of the sphere, or [`NearestSample::NONE`].
    pub index: u32,
    /// Unit normal on the side of the camera.
    pub normal: [f32; 3],
    /// The point.
    pub position: [f32; 3],
}

impl NearestSample {
    /// The index of a pixel without a sphere; its other values mean nothing.
    pub const NONE: u32 = u32::MAX;
}

/// What a picture has cost.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Cost {
    /// Seconds on the device to build the tree; 0 if it has no clock.
    pub build_seconds: f64,
    /// Seconds on the device to trace the picture; 0 if it has no clock.
    pub trace_seconds: f64,
    /// Rays from the camera.
    pub primary_rays: u64,
    /// Shadow rays.
    pub shadow_rays: u64,
    /// Reflected rays.
    pub reflected_rays: u64,
    /// Memory of the device, bytes.
    pub bytes: u64,
    /// That of the tree and its build.
    pub tree_bytes: u64,
}

/// A uniform of the kernels.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
struct Stage {
    sample: u32,
    depth: u32,
    light: u32,
    queues: u32,
}

/// Kernels for trees of one kind.
#[derive(Debug)]
struct Kernels {
    empty_queues: Kernel,
    trace_camera: Kernel,
    trace_reflected: Kernel,
    trace_shadow: Kernel,
}

/// What the source of the kernels depends on: whether radii are equal, and the levels that the stack holds.
type Variant = (bool, u32);

impl Kernels {
    fn new(device: &Device, (is_common, levels): Variant) -> Self {
        let append = if device.has_subgroups() {
            include_str!("shaders/append_subgroup.wgsl")
        } else {
            include_str!("shaders/append_atomic.wgsl")
        };
        let source = [
            device.arithmetic().source(),
            &tree_constants(is_common),
            &format!("const STACK: u32 = {}u;\n", STACK_PER_LEVEL * levels),
            include_str!("shaders/view.wgsl"),
            include_str!("shaders/arithmetic.wgsl"),
            include_str!("shaders/traverse.wgsl"),
            include_str!("shaders/camera.wgsl"),
            append,
            include_str!("shaders/whitted.wgsl"),
        ];
        let module = device.module(&source.concat());
        let kernel = |entry, bindings| Kernel::new(device, &module, entry, bindings);
        Self {
            empty_queues: kernel("empty_queues", &[8, 13, 14]),
            trace_camera: kernel("trace_camera", &[0, 1, 2, 3, 4, 5, 6, 7, 8, 10, 11, 12, 13]),
            trace_reflected: kernel("trace_reflected", &[0, 1, 2, 3, 6, 7, 8, 9, 10, 11, 12, 13]),
            trace_shadow: kernel("trace_shadow", &[0, 1, 2, 6, 8, 11, 13]),
        }
    }
}

/// Renders one frame after another on a device, in memory that is kept.
#[derive(Debug)]
pub struct Renderer {
    tree: TreeBuilder,
    kernels: BTreeMap<Variant, Kernels>,
    arrays: TraceArrays,
    uniforms: Uniforms,
    timer: Option<Timer>,
    download: Download,
    has_colors: bool,
    color: [f32; 3],
    /// The picture that was traced last.
    traced: Option<Traced>,
    /// Number of stages whose time was measured for it.
    stages: u32,
}

/// What is known of a picture on the device.
#[derive(Debug, Clone, Copy)]
struct Traced {
    pixels: u64,
    samples: u32,
    lights: usize,
}

#[derive(Debug, Default)]
struct TraceArrays {
    colors: Array,
    points: Array,
    sets: Array,
    /// The film that `sets` belongs to, and the content of `points`.
    sampled: Option<(FilmSize, Vec<[f32; 2]>)>,
    film: Array,
    data: Array,
    queued: Array,
    rays: [Array; 2],
    shadows: Array,
    sums: Array,
}

impl TraceArrays {
    fn all(&self) -> [&Array; 10] {
        let [rays, other_rays] = &self.rays;
        [
            &self.colors,
            &self.points,
            &self.sets,
            &self.film,
            &self.data,
            &self.queued,
            rays,
            other_rays,
            &self.shadows,
            &self.sums,
        ]
    }
}

/// Memory of the device for the film and the queues of each pixel with that many lights, bytes.
pub const fn bytes_per_pixel(lights: u64) -> u64 {
    4 + 16 + 32 + 2 * 32 + 32 * lights
}

impl Renderer {
    /// A renderer without a frame.
    pub fn new(device: &Device) -> Self {
        Self {
            tree: TreeBuilder::new(device),
            kernels: BTreeMap::new(),
            arrays: TraceArrays::default(),
            uniforms: Uniforms::default(),
            timer: Timer::new(device, MAX_STAGES),
            download: Download::default(),
            has_colors: false,
            color: [0.0; 3],
            traced: None,
            stages: 0,
        }
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
        match colors {
            Colors::Constant(color) => {
                self.color = color;
                self.arrays.colors.reserve(device, "colours", 0)?;
            }
            Colors::PerSphere(colors) => {
                let bytes = bytemuck::cast_slice(colors);
                self.arrays.colors.write(device, "colours", bytes)?;
            }
        }
        self.has_colors = matches!(colors, Colors::PerSphere(_));
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
    /// If `is_stopped` returns true, which is asked after each part of the picture, or if the device fails.
    ///
    /// # Panics
    /// If the picture has too many lights, or no set of samples for each pixel.
    pub fn trace(
        &mut self,
        device: &Device,
        picture: &Picture<'_>,
        is_stopped: &dyn Fn() -> bool,
    ) -> Result<(), GpuError> {
        self.reserve(device, picture)?;
        let shape = *self.tree.shape();
        let variant = (shape.is_common, shape.levels.max(MIN_STACK_LEVELS));
        self.kernels.entry(variant).or_insert_with(|| Kernels::new(device, variant));
        let plan = self.plan(picture, &shape);
        self.uniforms.upload(device)?;
        // Trace sample by sample
        let per_stage = picture.samples.count.div_ceil(MAX_STAGES - 1).max(1);
        self.stages = 1;
        for samples in plan.samples.chunks(per_stage as usize) {
            if is_stopped() {
                device.wait()?;
                return Err(GpuError::Interrupted);
            }
            let mut commands = Commands::new(device);
            for sample in samples {
                self.add_sample(&mut commands, &self.kernels[&variant], &plan, *sample);
            }
            commands.end_stage(self.timer.as_ref().map(|timer| (timer, self.stages)));
            commands.submit();
            self.stages += 1;
        }
        let mut commands = Commands::new(device);
        self.add_count(&mut commands, &self.kernels[&variant], &plan);
        commands.submit();
        self.traced = Some(Traced {
            pixels: picture.film.pixels(),
            samples: picture.samples.count,
            lights: picture.lights.len(),
        });
        device.check()
    }

    /// Waits for the picture that was started last, and passes its pixels to `store`.
    ///
    /// # Errors
    /// If the device fails.
    ///
    /// # Panics
    /// Without a picture.
    pub fn read<T>(
        &mut self,
        device: &Device,
        store: impl FnOnce(&Pixels<'_>) -> T,
    ) -> Result<T, GpuError> {
        let pixels = self.traced.expect("a picture was traced").pixels;
        self.download.reserve(device, 48 * pixels)?;
        let mut commands = Commands::new(device);
        commands.copy(&self.arrays.film, &self.download, [0, 16 * pixels]);
        commands.copy(&self.arrays.data, &self.download, [16 * pixels, 32 * pixels]);
        commands.submit();
        self.download.with_content(device, |bytes| {
            #[expect(clippy::cast_possible_truncation, reason = "the host has mapped it")]
            let (sums, nearest) = bytes.split_at(16 * pixels as usize);
            store(&Pixels {
                sums: bytemuck::cast_slice(sums),
                nearest: bytemuck::cast_slice(nearest),
            })
        })
    }

    /// Waits for the picture that was started last. Returns what it and its frame have cost.
    ///
    /// # Errors
    /// If the device fails.
    ///
    /// # Panics
    /// Without a picture.
    pub fn cost(&self, device: &Device) -> Result<Cost, GpuError> {
        let Traced { pixels, samples, lights } = self.traced.expect("a picture was traced");
        // The first queue of each depth has reflected rays, the others shadow rays
        let lengths: Vec<u64> = bytemuck::pod_collect_to_vec(&self.arrays.sums.read(device)?);
        let reflected = lengths.iter().step_by(1 + lights).sum();
        let seconds = match &self.timer {
            Some(timer) => timer.seconds(device, self.stages)?,
            None => Vec::new(),
        };
        let arrays = self.arrays.all().iter().map(|array| array.bytes()).sum::<u64>();
        Ok(Cost {
            build_seconds: seconds.first().copied().unwrap_or_default(),
            trace_seconds: seconds.iter().skip(1).sum(),
            primary_rays: pixels * u64::from(samples),
            reflected_rays: reflected,
            shadow_rays: lengths.iter().sum::<u64>() - reflected,
            bytes: self.tree.bytes() + arrays,
            tree_bytes: self.tree.bytes(),
        })
    }

    fn reserve(&mut self, device: &Device, picture: &Picture<'_>) -> Result<(), GpuError> {
        let pixels = picture.film.pixels();
        let lights = picture.lights.len() as u64;
        let queues = vec![0; queue_count(picture) as usize];
        let arrays = &mut self.arrays;
        arrays.film.reserve(device, "pixels", 16 * pixels)?;
        arrays.data.reserve(device, "pixels", 32 * pixels)?;
        for queue in &mut arrays.rays {
            queue.reserve(device, "rays", 32 * pixels)?;
        }
        arrays.shadows.reserve(device, "shadow rays", 32 * pixels * lights)?;
        arrays.queued.write(device, "queues", bytemuck::cast_slice::<u32, u8>(&queues))?;
        arrays.sums.write(
            device,
            "counts",
            bytemuck::cast_slice(&[&queues[..], &queues].concat()),
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
    fn plan(&mut self, picture: &Picture<'_>, shape: &TreeShape) -> Plan {
        let uniforms = &mut self.uniforms;
        uniforms.clear();
        let view = View {
            levels: shape.levels,
            radius: shape.radius,
            padding: shape.padding,
            starts: shape.starts,
            color_kind: self.has_colors.into(),
            color: self.color,
            ..View::new(picture)
        };
        let view = uniforms.push(&view);
        let mut push = |stage: Stage| uniforms.push(&stage);
        let queues = queue_count(picture);
        let light_count = narrow_count(picture.lights.len());
        let mut all = |stages: &mut dyn Iterator<Item = Stage>| stages.map(&mut push).collect();
        let max_depth = if picture.material.reflection > 0.0 { picture.max_depth } else { 1 };
        let depths = 1..=max_depth;
        let lights = 0..light_count;
        Plan {
            view,
            film: picture.film,
            queues,
            samples: all(&mut (0..picture.samples.count).map(|sample| Stage {
                sample,
                depth: 1,
                queues,
                light: 0,
            })),
            depths: all(&mut depths.clone().map(|depth| Stage { depth, ..Stage::default() })),
            lights: depths
                .map(|depth| {
                    all(&mut lights.clone().map(|light| Stage { depth, light, ..Stage::default() }))
                })
                .collect(),
            casts_shadow: picture.lights.iter().map(|light| light.casts_shadow).collect(),
        }
    }

    /// Adds the dispatches of one sample of all pixels.
    fn add_sample(
        &self,
        commands: &mut Commands<'_>,
        kernels: &Kernels,
        plan: &Plan,
        sample: Uniform,
    ) {
        let pixels = plan.film.pixels();
        let array_of = |binding| self.array(binding, plan.view, sample, 0);
        commands.add(&kernels.empty_queues, &array_of, plan.queues.into(), GROUP);
        for (number, (stage, lights)) in plan.depths.iter().zip(&plan.lights).enumerate() {
            if number == 0 {
                let squares = [plan.film.width.div_ceil(8), plan.film.height.div_ceil(8)];
                commands.add_groups(&kernels.trace_camera, &array_of, squares);
            } else {
                let array_of = |binding| self.array(binding, plan.view, *stage, number);
                commands.add(&kernels.trace_reflected, &array_of, pixels, GROUP);
            }
            let shadowed = lights.iter().zip(&plan.casts_shadow).filter(|(_, casts)| **casts);
            for (light, _) in shadowed {
                let array_of = |binding| self.array(binding, plan.view, *light, number);
                commands.add(&kernels.trace_shadow, &array_of, pixels, GROUP);
            }
        }
    }

    /// Adds the dispatch that counts the rays of the last sample.
    fn add_count(&self, commands: &mut Commands<'_>, kernels: &Kernels, plan: &Plan) {
        let array_of = |binding| self.array(binding, plan.view, plan.samples[0], 0);
        commands.add(&kernels.empty_queues, &array_of, plan.queues.into(), GROUP);
    }

    /// The argument of a kernel for a binding, in the dispatches of a depth: the queues of rays change places.
    fn array(
        &self,
        binding: u32,
        view: Uniform,
        stage: Uniform,
        depth: usize,
    ) -> BindingResource<'_> {
        let arrays = &self.arrays;
        let array = match binding {
            0 => return self.uniforms.binding(view),
            13 => return self.uniforms.binding(stage),
            4 => &arrays.points,
            5 => &arrays.sets,
            6 => &arrays.film,
            7 => &arrays.data,
            8 => &arrays.queued,
            9 => &arrays.rays[depth % 2],
            10 => &arrays.rays[1 - depth % 2],
            11 => &arrays.shadows,
            12 => &arrays.colors,
            14 => &arrays.sums,
            _ => return self.tree.traversal_array(binding).expect("1 to 3 are those of the tree"),
        };
        array.binding()
    }
}

/// Number of queues of a sample: for each depth, one of reflected rays, and one of shadow rays for each light.
fn queue_count(picture: &Picture<'_>) -> u32 {
    picture.max_depth * (1 + narrow_count(picture.lights.len()))
}

/// A number of lights.
fn narrow_count(count: usize) -> u32 {
    u32::try_from(count).expect("at most MAX_LIGHTS")
}

/// The uniforms of a picture.
struct Plan {
    view: Uniform,
    film: FilmSize,
    /// Number of queues of a sample.
    queues: u32,
    samples: Vec<Uniform>,
    depths: Vec<Uniform>,
    /// The lights of each depth.
    lights: Vec<Vec<Uniform>>,
    /// For each light.
    casts_shadow: Vec<bool>,
}
