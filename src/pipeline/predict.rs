//! Predicts the memory of a job: the model behind `--memory-limit`, `check`, and the rejection of frames and images
//! that cannot fit.
//!
//! It adds up what the stages hold at the same time (see the parent module). While the tree of frame i is built,
//! frame i-1 is encoded, and the planes of frame i-2 are kept for frame i. While frame i is traced, frame i+1 is
//! read, and frame i-1 may still be encoded. Both are usually done when frame i is denoised; [`MemoryModel::bound`] is
//! what is needed if they are not. Only anonymous memory counts, not the pages of mapped files. Particle
//! counts of frames that have not been opened are estimated from the length of their files and the heaviest frame of
//! the survey. Native frames that are traced in place need almost no memory.

use std::fmt;

use serde::Serialize;
use spherule_formats::native::Access;
use spherule_formats::open::unpacked_len;
use spherule_formats::sequence::Sequence;

use super::bonds::MAX_BONDS_EACH;
use super::read_threads::needs_many;
use super::setup::{RadiusRule, Setup};
use super::{ImageTask, mattes};
use crate::accel::moving::MovingTree;
use crate::accel::{BuildBytes, BuildSettings, Structure, predicted_bytes, predicted_stored_bytes};
use crate::denoise;
use crate::metrics::Bytes;
use crate::output::{PackBuffers, PreviewBackground};
use crate::overlay;
use crate::render::{Film, floor_light_bytes, scratch_bytes};
use crate::scene::ground::Pattern;
use crate::scene::{Environment, Ground};
use crate::surface::SurfaceKind;
use crate::surface::rods::RodTree;
use crate::surface::spray::SOFT_DROPS;
use crate::survey::FrameWeight;

/// Estimated size of a frame before it is read; everything except counts in bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FrameSize {
    /// Particle count.
    pub particles: u64,
    /// Size of its largest file, uncompressed.
    pub content: u64,
    /// Size of the numbers in its files.
    pub raw: u64,
    /// Size of the positions among them.
    pub positions: u64,
    /// Number of files.
    pub files: u64,
    /// Whether its file contains other frames too, and stays in memory for them.
    pub is_shared: bool,
    /// Size of the files of the meshes that only this frame has.
    pub meshes: u64,
}

impl FrameSize {
    /// Size of frame `index` of `sequence`, from the length of its files and a known frame.
    pub fn of(sequence: &Sequence, index: usize, known: Option<&FrameWeight>) -> Self {
        let sizes = sequence.inputs(index).into_iter().map(unpacked_len);
        let stored = sizes.filter_map(Result::ok).sum();
        let parts = sequence.frames().get(index).map(|f| f.parts.as_slice());
        let is_shared = parts.is_some_and(|parts| parts.iter().any(|p| p.step.is_some()));
        Self::estimate(stored, is_shared, known)
    }

    /// Size of the frame of `task`, and of its own meshes.
    pub fn of_task(sequence: &Sequence, task: &ImageTask, setup: &Setup) -> Self {
        let meshes = task.meshes.iter().map(|path| unpacked_len(path));
        Self {
            meshes: meshes.filter_map(Result::ok).sum(),
            ..Self::of(sequence, task.index, setup.run.weight.as_ref())
        }
    }

    /// Bytes to process when reading: the size of its file, or of the numbers in it if that is larger.
    pub(super) fn read_bytes(&self) -> u64 {
        self.content.max(self.raw).max(self.meshes)
    }

    /// Whether it is read by as many threads as trace.
    fn needs_many(&self) -> bool {
        needs_many(self.read_bytes())
    }

    /// Size of a frame with files of `stored` bytes (unpacked), in proportion to a known frame. Jobs of the first
    /// versions have no known frame; plain single-precision positions are assumed for them.
    pub fn estimate(stored: u64, is_shared: bool, known: Option<&FrameWeight>) -> Self {
        let Some(known) = known.filter(|k| k.stored > 0) else {
            return Self {
                particles: stored / 12,
                content: stored,
                raw: stored,
                positions: stored,
                files: 1,
                is_shared,
                meshes: 0,
            };
        };
        let scaled = |value: u64| {
            let product = u128::from(value) * u128::from(stored) / u128::from(known.stored);
            u64::try_from(product).unwrap_or(u64::MAX)
        };
        Self {
            particles: scaled(known.particles),
            content: scaled(known.content),
            raw: scaled(known.raw),
            positions: scaled(known.positions),
            files: known.files,
            is_shared,
            meshes: 0,
        }
    }
}

/// Anonymous memory by purpose, bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct MemoryNeed {
    /// The program and its threads.
    pub program: u64,
    /// Reading a frame: its file, the numbers in it, and the part that is kept.
    pub reading: u64,
    /// Particle data of the current frame next to its tree: colours, ids, velocities; positions as well during the
    /// build.
    pub particles: u64,
    /// The tree, and the scratch memory of its build.
    pub tree: u64,
    /// The surface, without the tree, and meshes.
    pub surface: u64,
    /// The planes of the images that are traced and encoded.
    pub images: u64,
    /// Encoding, without the planes.
    pub encoding: u64,
}

impl MemoryNeed {
    /// The sum of all parts.
    pub const fn total(&self) -> u64 {
        self.program
            + self.reading
            + self.particles
            + self.tree
            + self.surface
            + self.images
            + self.encoding
    }

    /// The parts by name.
    pub fn parts(&self) -> [(&'static str, u64); 7] {
        [
            ("images", self.images),
            ("encoding", self.encoding),
            ("tree", self.tree),
            ("surface", self.surface),
            ("particles", self.particles),
            ("reading the next frame", self.reading),
            ("program", self.program),
        ]
    }

    pub(super) fn larger(self, other: Self) -> Self {
        if other.total() > self.total() { other } else { self }
    }
}

impl fmt::Display for MemoryNeed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts = self.parts();
        parts.sort_by_key(|(_, bytes)| std::cmp::Reverse(*bytes));
        for (index, (name, bytes)) in parts.iter().filter(|(_, b)| *b > 0).enumerate() {
            let comma = if index > 0 { ", " } else { "" };
            write!(f, "{comma}{name} {}", Bytes(*bytes))?;
        }
        Ok(())
    }
}

/// Predicts the memory of the frames of a job.
#[derive(Debug, Clone, Copy)]
pub struct MemoryModel<'a> {
    pub(super) setup: &'a Setup,
    own_radii: bool,
    has_ids: bool,
    has_velocities: bool,
    in_place: bool,
    /// Memory of the meshes that all frames share.
    meshes: u64,
    /// The same while they are read, before the first frame.
    reading_meshes: u64,
}

/// Memory of the program: its data, the stacks of its threads and small allocations; large allocations are returned
/// to the system when they are freed ([`RETURN_THRESHOLD`]). Measured on sequences of up to 1e6 particles, as the
/// remainder of the other parts.
const PROGRAM: u64 = 3 << 20;
/// Additional memory per thread.
const THREAD: u64 = 256 << 10;

/// Allocations of at least this size are returned to the system when they are freed (`cli/allocator.rs`).
const RETURN_THRESHOLD: u64 = 1 << 20;

/// One in this many particles is assumed to be spray.
const PARTICLES_PER_DROP: u64 = 10;

/// The frames before and after one that is denoised.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Neighbours {
    /// One is written, the other is read.
    Ready,
    /// One is still being encoded, the other read.
    InWork,
}

/// Memory of a surface, without the tree.
#[derive(Debug, Clone, Copy, Default)]
struct SurfaceBytes {
    /// During its build.
    building: u64,
    /// During tracing.
    kept: u64,
}

impl<'a> MemoryModel<'a> {
    /// A model for the pictures of `setup`.
    pub fn new(setup: &'a Setup) -> Self {
        let known = setup.run.weight.unwrap_or_default();
        Self {
            setup,
            own_radii: match setup.picture.radius {
                RadiusRule::Common(_) => false,
                RadiusRule::FileOr(_) => known.own_radii,
                RadiusRule::Attribute { .. } | RadiusRule::Table { .. } => true,
            },
            has_ids: known.ids,
            has_velocities: known.velocities,
            in_place: known.in_place && setup.traces_in_place(),
            meshes: shared_meshes(setup),
            reading_meshes: reading_shared_meshes(setup),
        }
    }

    /// Peak memory while these frames are rendered one after another, if reading and encoding a frame take less time
    /// than tracing its neighbour.
    pub fn peak(&self, frames: &[FrameSize]) -> MemoryNeed {
        self.peak_of(frames, Neighbours::Ready)
    }

    /// The same, however long reading and encoding take.
    pub fn bound(&self, frames: &[FrameSize]) -> MemoryNeed {
        self.peak_of(frames, Neighbours::InWork)
    }

    fn peak_of(&self, frames: &[FrameSize], neighbours: Neighbours) -> MemoryNeed {
        let mut need = MemoryNeed::default();
        let mut tree = 0;
        for (i, frame) in frames.iter().enumerate() {
            // The memory of the tree is reused from frame to frame, and never shrinks.
            tree = self.tree(frame).max(tree);
            let after = frames.get(i + 1);
            need = need.larger(self.peak_around(i, frame, after, tree, neighbours));
        }
        need
    }

    /// Memory for a frame that is rendered alone.
    pub fn alone(&self, frame: &FrameSize) -> MemoryNeed {
        self.peak(std::slice::from_ref(frame))
    }

    /// Peak memory for reading a frame.
    pub fn reading(&self, frame: &FrameSize) -> u64 {
        if self.in_place { self.held_file(frame) } else { self.decoding(frame) }
    }

    /// Upper bounds of the memory of the arrows, trails and bonds of a frame: while they are made, and afterwards.
    fn arrows(&self, frame: &FrameSize) -> SurfaceBytes {
        let picture = &self.setup.picture;
        let share = |every: u32| frame.particles.div_ceil(u64::from(every.max(1)));
        let none = [0_u64; 2];
        // Rods, and their colours
        let arrows = picture.arrows.iter().map(|style| {
            let arrows = share(style.every);
            [2 * arrows, style.color.as_ref().map_or(0, |_| arrows)]
        });
        let trails = picture.trails.as_ref().map_or(none, |style| {
            let trails = share(style.every);
            let rods = trails.saturating_mul(style.frames.into());
            [rods, style.color.as_ref().map_or(0, |_| trails)]
        });
        let bonds = picture.bonds.as_ref().map_or(none, |_| {
            let rods = frame.particles.saturating_mul(MAX_BONDS_EACH);
            [rods, frame.particles]
        });
        let [rods, colors] = arrows
            .chain([trails, bonds])
            .fold(none, |sum, more| [0, 1].map(|i| sum[i].saturating_add(more[i])));
        let [building, kept] = RodTree::predicted_bytes(rods, colors);
        SurfaceBytes { building, kept }
    }

    /// The same, with the arrows and the meshes of the frame, which are made and read after its particles.
    fn reading_with_meshes(&self, frame: &FrameSize) -> u64 {
        let reading = self.reading(frame).max(self.making_rods(frame));
        if frame.meshes == 0 {
            return reading;
        }
        // Those of the next frame are read beside them
        let slices = u64::from(self.setup.slices());
        let slices = match slices {
            1 => 0,
            _ => (slices * KEPT_PER_MESH_BYTE + READ_PER_MESH_BYTE).saturating_mul(frame.meshes),
        };
        let meshes = READ_PER_MESH_BYTE.saturating_mul(frame.meshes) + slices;
        reading.max(self.kept(frame) + self.arrows(frame).kept + meshes)
    }

    /// Memory while arrows, trails and bonds are made from the particles of a frame, which were read; and while what
    /// is kept of these is taken from them.
    fn making_rods(&self, frame: &FrameSize) -> u64 {
        let rods = self.arrows(frame);
        if rods.building == 0 {
            return 0;
        }
        let held = frame.raw + self.file_indices(frame);
        held + rods.building.max(rods.kept + self.kept(frame))
    }

    /// Bytes of a native frame that is not mapped.
    fn held_file(&self, frame: &FrameSize) -> u64 {
        match self.setup.run.access {
            Access::Map => 0,
            Access::Read => frame.content,
        }
    }

    /// Peak memory for reading a frame into plain particles.
    pub fn decoding(&self, frame: &FrameSize) -> u64 {
        let n = frame.particles;
        // Several files are read one after another, then combined.
        let files = if frame.files > 1 { frame.content.max(frame.raw) } else { frame.content };
        let attributes = frame.raw.saturating_sub(frame.positions);
        // Double precision is rounded to a copy, single precision is used as it is.
        let is_double = frame.positions >= 24 * n;
        let rounding = if is_double { frame.raw + 12 * n } else { 0 };
        let shared = if frame.is_shared { frame.content } else { 0 };
        // One byte per particle marks which are finite.
        let keeping = attributes + self.kept(frame) + n;
        // Indices of those that are drawn, with a mark for each particle while they are found; and a copy of one array
        // after the other, for allocators that cannot shrink one in its place
        let selecting = match self.setup.picture.selection.is_all() {
            true => 0,
            false => frame.raw + (4 * n + frame.positions.max(attributes)).max(5 * n),
        };
        let held = rounding.max(keeping) + self.file_indices(frame);
        let reading = (files + frame.raw).max(shared + held.max(selecting));
        // Neighbouring frames are read beside it one at a time, and their ids are sorted
        let beside = frame.raw + 12 * n + reading + 16 * n;
        match (self.setup.moves_to_next_frame(), &self.setup.picture.trails) {
            // Ids of the frame, and the ends of trails
            (_, Some(_)) => beside + 32 * n,
            (true, None) => beside,
            (false, None) => reading,
        }
    }

    /// Bytes of the places of particles in their file, if some of them are not drawn.
    fn file_indices(&self, frame: &FrameSize) -> u64 {
        match self.setup.picture.selection.is_all() {
            true => 0,
            false => 4 * frame.particles,
        }
    }

    /// Memory that the allocator retains after the buffers for reading a frame are freed: all of it, if there are
    /// only small allocations.
    fn retained(&self, frame: &FrameSize) -> u64 {
        if frame.content.max(frame.positions) < RETURN_THRESHOLD { self.reading(frame) } else { 0 }
    }

    /// Memory of a frame between reading and the end of its build.
    fn kept(&self, frame: &FrameSize) -> u64 {
        if self.in_place {
            return self.held_file(frame);
        }
        let radii = if self.own_radii { 4 } else { 0 };
        // Velocities become displacements, and stay only for channels
        let motion = if self.setup.has_motion() { 12 } else { 0 };
        frame.particles * (12 + radii + motion) + self.shading(frame)
    }

    /// Memory of its attributes during tracing.
    fn shading(&self, frame: &FrameSize) -> u64 {
        if self.in_place {
            return self.held_file(frame);
        }
        let channels = self.setup.picture.render.channels;
        let color = self.setup.picture.color.bytes();
        // Particles that are moved need an explicit id.
        let picture = &self.setup.picture;
        let has_ids = self.has_ids || picture.surface.spray || !picture.selection.is_all();
        let ids = picture.needs_ids() && has_ids;
        let each = [
            (true, color),
            (picture.opacity.is_by_particle(), 4),
            (ids, 4),
            (channels.needs_velocities() && self.has_velocities, 12),
            // Whether there are parts is not known in advance
            (self.setup.needs_parts(), 4),
            (true, 4 * u64::from(channels.layers.attributes)),
        ];
        let each: u64 = each.iter().filter(|(has, _)| *has).map(|(_, b)| b).sum();
        frame.particles * each
    }

    fn build(&self, frame: &FrameSize) -> BuildBytes {
        if self.in_place {
            return predicted_stored_bytes(frame.particles);
        }
        // A smooth surface needs no tree over particles, and a union in motion has its own trees.
        let particles = match (self.setup.picture.surface.kind, self.setup.has_motion()) {
            (SurfaceKind::Smooth, _) | (SurfaceKind::Union, true) => 0,
            (SurfaceKind::Spheres, _) | (SurfaceKind::Union, false) => frame.particles,
        };
        let build = self.body_tree(particles);
        if !self.setup.picture.surface.spray {
            return build;
        }
        // Spray is searched in a separate tree, in the same memory.
        let first = self.plain_tree(frame.particles);
        BuildBytes { tree: build.tree.max(first.tree), scratch: build.scratch.max(first.scratch) }
    }

    /// The tree of a body.
    fn body_tree(&self, particles: u64) -> BuildBytes {
        let values = self.setup.picture.color.is_by_particle();
        let count = usize::try_from(particles).unwrap_or(usize::MAX);
        let settings = self.setup.build_settings(count, values);
        predicted_bytes(&settings, particles, self.own_radii)
    }

    /// The tree that is fastest to build.
    fn plain_tree(&self, particles: u64) -> BuildBytes {
        let settings = BuildSettings::new(Structure::Lbvh);
        predicted_bytes(&settings, particles, self.own_radii)
    }

    /// Memory of the tree of `particles` particles of spray. Soft ones have several drops, with radii of their own.
    fn spray_tree(&self, particles: u64) -> u64 {
        let is_soft = self.setup.picture.scene.is_spray_soft;
        let drops = particles * if is_soft { u64::from(SOFT_DROPS) } else { 1 };
        let still = match is_soft {
            true => predicted_bytes(&BuildSettings::new(Structure::Lbvh), drops, true).tree,
            false => self.plain_tree(drops).tree,
        };
        still + self.moving_tree(drops)
    }

    /// Memory of a tree of moving spheres; none without motion blur.
    fn moving_tree(&self, particles: u64) -> u64 {
        match self.setup.has_motion() {
            true => MovingTree::predicted_bytes(particles),
            false => 0,
        }
    }

    /// Memory of the surface of a frame: normals need none, spray has a tree, and a smooth surface has its grid. With
    /// motion blur, spheres have a tree that moves, and other surfaces are there several times.
    fn surface(&self, frame: &FrameSize) -> SurfaceBytes {
        let (surface, n) = (&self.setup.picture.surface, frame.particles);
        let slices = u64::from(self.setup.slices());
        let moving = self.moving_tree(n);
        let spray = match surface.spray {
            true => self.spray_tree(n / PARTICLES_PER_DROP),
            false => 0,
        };
        let body = match surface.kind {
            SurfaceKind::Smooth => {
                let one = smooth_bytes(self.setup, n);
                SurfaceBytes {
                    building: (slices - 1) * one.kept + one.building,
                    kept: slices * one.kept,
                }
            }
            SurfaceKind::Union if self.setup.has_motion() => {
                let one = self.body_tree(n);
                SurfaceBytes { building: slices * one.tree + one.scratch, kept: slices * one.tree }
            }
            SurfaceKind::Spheres | SurfaceKind::Union => {
                SurfaceBytes { building: moving, kept: moving }
            }
        };
        SurfaceBytes { building: spray + body.building, kept: spray + body.kept }
    }

    fn tree(&self, frame: &FrameSize) -> u64 {
        self.build(frame).tree
    }

    /// Peak memory while `frame` is built and traced, with a tree that occupies `tree` bytes. `before` is the number
    /// of previous frames: the image of the last one is being encoded, and the image of the one before that is kept
    /// for reuse. Frame `after` is being read.
    fn peak_around(
        &self,
        before: usize,
        frame: &FrameSize,
        after: Option<&FrameSize>,
        tree: u64,
        neighbours: Neighbours,
    ) -> MemoryNeed {
        let render = &self.setup.picture.render;
        let film = self.film();
        let threads = rayon::current_num_threads() as u64;
        let film_before = if before > 0 { film } else { 0 };
        let film_kept = if before > 1 { film } else { 0 };
        let encoding_before = if before > 0 { self.encoding() } else { 0 };
        let shared = if frame.is_shared { frame.content } else { 0 };
        let scene = &self.setup.picture.scene;
        // A shadow catcher has a table of its own
        let tables =
            1 + u64::from(scene.ground.as_ref().is_some_and(|g| g.shadow_catcher.is_some()));
        let environment = scene.environment.as_deref();
        let environment = tables * environment.map_or(0, Environment::byte_len);
        let picture = scene.ground.as_ref().map_or(0, ground_image_bytes);
        // Count the threads, including those for reading
        let has_read_pool = [Some(frame), after].into_iter().flatten().any(FrameSize::needs_many);
        let idle = MemoryNeed {
            program: PROGRAM
                + environment
                + picture
                + THREAD * threads * if has_read_pool { 2 } else { 1 },
            reading: shared.max(self.retained(frame)),
            ..MemoryNeed::default()
        };
        // Add up each phase: reading, building, tracing, denoising, encoding
        let kept = self.kept(frame);
        let surface = self.surface(frame);
        let meshes = self.meshes
            + KEPT_PER_MESH_BYTE * frame.meshes * u64::from(self.setup.slices())
            + self.arrows(frame).kept;
        let names = mattes::predicted_bytes(self.setup, frame.particles);
        let first_read =
            MemoryNeed { reading: self.reading_with_meshes(frame), surface: self.meshes, ..idle };
        let building = MemoryNeed {
            particles: kept,
            // The kept data are in the memory that the allocator retains.
            reading: shared.max(self.retained(frame).saturating_sub(kept)),
            tree: tree + self.build(frame).scratch,
            surface: surface.building + meshes,
            images: film_before + film_kept,
            encoding: encoding_before,
            ..idle
        };
        let tracing = MemoryNeed {
            program: idle.program + floor_light_bytes(scene, render),
            reading: after
                .map_or(idle.reading, |after| self.reading_with_meshes(after).max(idle.reading)),
            particles: self.shading(frame),
            // Spheres in motion have a tree of their own instead
            tree: match (self.setup.picture.surface.kind, self.setup.has_motion()) {
                (SurfaceKind::Spheres, true) => 0,
                _ => tree,
            },
            surface: surface.kept + meshes,
            images: film + film_before + self.tracing_scratch() * threads,
            encoding: encoding_before + names,
        };
        let denoising = match self.setup.picture.denoise {
            Some(settings) => MemoryNeed {
                program: idle.program,
                reading: match neighbours {
                    Neighbours::Ready => {
                        after.map_or(idle.reading, |next| self.kept(next).max(idle.reading))
                    }
                    Neighbours::InWork => tracing.reading,
                },
                images: film
                    + film_before
                    + denoise::predicted_bytes(render.width, render.height, &settings, threads),
                encoding: match neighbours {
                    Neighbours::Ready => names,
                    Neighbours::InWork => tracing.encoding,
                },
                ..tracing
            },
            None => MemoryNeed::default(),
        };
        let encoding = MemoryNeed {
            surface: self.meshes,
            images: film,
            encoding: self.encoding() + names,
            ..idle
        };
        let starting = MemoryNeed {
            surface: self.reading_meshes,
            program: PROGRAM + THREAD * threads,
            ..MemoryNeed::default()
        };
        [first_read, building, tracing, denoising, encoding]
            .into_iter()
            .fold(starting, MemoryNeed::larger)
    }

    /// Memory of the planes of an image.
    fn film(&self) -> u64 {
        let render = &self.setup.picture.render;
        Film::bytes_for(render.width, render.height, render.channels, render.has_features)
    }

    /// Memory of a thread during tracing.
    fn tracing_scratch(&self) -> u64 {
        let is_body = self.setup.picture.surface.kind != SurfaceKind::Spheres;
        scratch_bytes(
            &self.setup.picture.render,
            &self.setup.picture.scene.material,
            is_body,
            self.setup.slices(),
        )
    }

    /// Memory for encoding an image, without its planes: the bands that are being compressed or wait to be written;
    /// or, before that, the bytes of the preview: plain, filtered and compressed.
    fn encoding(&self) -> u64 {
        let render = &self.setup.picture.render;
        let pixels = u64::from(render.width) * u64::from(render.height);
        let film = self.film();
        // Bands have 32 rows at most, and 16 for compression methods with large blocks. Colours are in half precision.
        let band = 16 * (film - 8 * pixels) / u64::from(render.height.max(16));
        let threads = rayon::current_num_threads() as u64;
        // Each thread compresses one band, and some compressed bands wait, at worst at their original size.
        let bands = (threads + 1) * PackBuffers::predicted_bytes(band) + (threads + 2) * band;
        let preview = match self.setup.picture.preview.background {
            PreviewBackground::Transparent => 12 * pixels,
            PreviewBackground::Included | PreviewBackground::Color(_) => 9 * pixels,
        };
        let overlays = overlay::bytes(&self.setup.picture.overlays, render.width, render.height);
        (preview + overlays).max(bands)
    }
}

/// Memory of a mesh with its hierarchy, in bytes per byte of its file: the largest of the formats, binary PLY, where a
/// triangle has 19 bytes in the file and about 84 in memory.
const KEPT_PER_MESH_BYTE: u64 = 5;
/// The same while it is read and its hierarchy is built.
const READ_PER_MESH_BYTE: u64 = 16;

/// Memory of the picture on the ground.
fn ground_image_bytes(ground: &Ground) -> u64 {
    match &ground.pattern {
        Pattern::Image(image) => image.texture.byte_len(),
        Pattern::Plain | Pattern::Checker { .. } | Pattern::Sand { .. } => 0,
    }
}

/// Memory of the meshes that all frames share.
fn shared_meshes(setup: &Setup) -> u64 {
    let trees = (setup.picture.meshes.iter()).filter_map(|mesh| mesh.tree.as_ref());
    trees.map(|tree| tree.bytes() as u64).sum()
}

/// Memory for reading the meshes that all frames share: each of them is built next to those before it.
fn reading_shared_meshes(setup: &Setup) -> u64 {
    let trees = (setup.picture.meshes.iter()).filter_map(|mesh| mesh.tree.as_ref());
    let sums = trees.scan(0, |before, tree| {
        let need = *before + tree.building_bytes();
        *before += tree.bytes() as u64;
        Some(need)
    });
    sums.max().unwrap_or(0)
}

/// Bytes of a sorted particle, with its volume and its share of the bins.
const SORTED_BYTES: f64 = 17.0;
/// Bytes of its index, for attributes.
const INDEX_BYTES: f64 = 4.0;
/// Bytes of the grid per particle at the surface, for voxels of the size of the radius. Measured on splashing dam
/// breaks of 1e4 and 2e4 particles; a calm block needs a third to a half.
const GRID_BYTES: f64 = 5000.0;
/// Additional bytes of the field from which bricks are made, measured in the same way.
const FIELD_BYTES: f64 = 3500.0;
/// Maximum bytes of the grid per particle: an isolated particle at the common corner of eight bricks.
const MAX_GRID_BYTES: f64 = 22_000.0;

/// Memory of a smooth surface of splashing particles, which are in most frames. The fraction of the particles that is
/// at the surface of a body decreases with the cube root of their number. With a radius that is too small, all of
/// them are at a surface of their own; that is detected and rejected when the grid is planned.
fn smooth_bytes(setup: &Setup, particles: u64) -> SurfaceBytes {
    let surface = &setup.picture.surface;
    let channels = setup.picture.render.channels;
    let is_colored = setup.picture.color.is_by_particle();
    let keeps = surface.exact || channels.needs_particles() || is_colored;
    #[expect(clippy::cast_precision_loss, reason = "an estimate")]
    let count = particles as f64;
    let voxels = f64::from(surface.voxel).powi(-2) / count.cbrt().max(1.0);
    let grid = count * (GRID_BYTES * voxels).min(MAX_GRID_BYTES);
    let field = count * (FIELD_BYTES * voxels).min(MAX_GRID_BYTES);
    let sorted = count * (SORTED_BYTES + if keeps { INDEX_BYTES } else { 0.0 });
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "saturates; not negative"
    )]
    let bytes = |value: f64| value as u64;
    SurfaceBytes {
        building: bytes(sorted + grid + field),
        kept: bytes(grid + if keeps { sorted } else { 0.0 }),
    }
}

#[cfg(test)]
#[path = "predict_tests.rs"]
mod tests;
