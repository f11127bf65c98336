//! How much memory a job will take: the one model behind `--memory-limit`, `check` and the refusal
//! of frames and images that cannot fit.
//!
//! It adds up what the stages hold at once (see the module above): while the tree over frame i is
//! built, frame i-1 is encoded and the planes of frame i-2 are there for frame i; while frame i is traced, frame
//! i+1 is read and frame i-1 may still be encoded. What is counted is anonymous memory, not the pages of
//! mapped files. Particle counts of frames that nobody has looked at are estimated from the length of
//! their files and the frame that the survey found heaviest. Native frames that are traced where they lie take next to nothing.

use std::fmt;

use serde::Serialize;
use spherule_formats::native::Access;
use spherule_formats::open::unpacked_len;
use spherule_formats::sequence::Sequence;

use super::read_threads::needs_many;
use super::setup::{RadiusRule, Setup};
use crate::accel::{BuildBytes, BuildSettings, Structure, predicted_bytes, predicted_stored_bytes};
use crate::metrics::Bytes;
use crate::output::PackBuffers;
use crate::render::{Film, scratch_bytes};
use crate::surface::SurfaceKind;
use crate::survey::FrameWeight;

/// What a frame is thought to weigh before it is read; all but the counts in bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FrameSize {
    /// Particles.
    pub particles: u64,
    /// The largest of its files, uncompressed.
    pub content: u64,
    /// The numbers read from them.
    pub raw: u64,
    /// The positions among those.
    pub positions: u64,
    /// Files.
    pub files: u64,
    /// Whether its file has other frames too and stays in memory for them.
    pub is_shared: bool,
}

impl FrameSize {
    /// Of frame `index` of `sequence`, by the length of its files and a known frame.
    pub fn of(sequence: &Sequence, index: usize, known: Option<&FrameWeight>) -> Self {
        let sizes = sequence.inputs(index).into_iter().map(unpacked_len);
        let stored = sizes.filter_map(Result::ok).sum();
        let parts = sequence.frames().get(index).map(|f| f.parts.as_slice());
        let is_shared = parts.is_some_and(|parts| parts.iter().any(|p| p.step.is_some()));
        Self::estimate(stored, is_shared, known)
    }

    /// The bytes that reading it goes through: its file, or the numbers in it if they are more.
    pub(super) fn read_bytes(&self) -> u64 {
        self.content.max(self.raw)
    }

    /// Whether it is read by as many threads as trace.
    fn needs_many(&self) -> bool {
        needs_many(self.read_bytes())
    }

    /// Of a frame whose files have `stored` bytes once unpacked, in proportion to a known one. Nothing is
    /// known in jobs of the first versions: then as for plain single-precision positions.
    pub fn estimate(stored: u64, is_shared: bool, known: Option<&FrameWeight>) -> Self {
        let Some(known) = known.filter(|k| k.stored > 0) else {
            return Self {
                particles: stored / 12,
                content: stored,
                raw: stored,
                positions: stored,
                files: 1,
                is_shared,
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
        }
    }
}

/// Bytes of anonymous memory by what they are for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct MemoryNeed {
    /// The program and its threads.
    pub program: u64,
    /// A frame being read: its file, the numbers in it, and what is kept of them.
    pub reading: u64,
    /// What is kept of the frame in hand beside its tree: colours, ids, velocities; while it is
    /// built, positions too.
    pub particles: u64,
    /// The tree, and what building it takes.
    pub tree: u64,
    /// The surface, apart from the tree.
    pub surface: u64,
    /// The planes of the images being traced and encoded.
    pub images: u64,
    /// What encoding takes beside the planes.
    pub encoding: u64,
}

impl MemoryNeed {
    /// All together.
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
        if other.total() > self.total() {
            other
        } else {
            self
        }
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

/// The need of a job's frames.
#[derive(Debug, Clone, Copy)]
pub struct MemoryModel<'a> {
    setup: &'a Setup,
    own_radii: bool,
    has_ids: bool,
    has_velocities: bool,
    in_place: bool,
}

/// Data of the program, its threads' stacks and small allocations; large pieces go back to the system when they are
/// freed ([`RETURNED`]). Measured on sequences of up to 1e6 particles, by what the other parts leave.
const PROGRAM: u64 = 3 << 20;
/// The same for each thread.
const THREAD: u64 = 256 << 10;

/// Pieces from this size on go back to the system when they are freed: `cli/allocator.rs` sees to that.
const RETURNED: u64 = 1 << 20;

/// One particle of so many is taken to be spray.
const SPRAY_PART: u64 = 10;

/// What a surface takes apart from the tree.
#[derive(Debug, Clone, Copy, Default)]
struct SurfaceBytes {
    /// While it is built.
    building: u64,
    /// While it is traced.
    kept: u64,
}

impl<'a> MemoryModel<'a> {
    /// For the pictures of `setup`.
    pub fn new(setup: &'a Setup) -> Self {
        let known = setup.run.weight.unwrap_or_default();
        Self {
            setup,
            own_radii: match setup.picture.radius {
                RadiusRule::Common(_) => false,
                RadiusRule::FileOr(_) => known.own_radii,
                RadiusRule::Attribute { .. } => true,
            },
            has_ids: known.ids,
            has_velocities: known.velocities,
            in_place: known.in_place && setup.traces_in_place(),
        }
    }

    /// The most that is held at any time while these frames are rendered in turn.
    pub fn peak(&self, frames: &[FrameSize]) -> MemoryNeed {
        let mut need = MemoryNeed::default();
        let mut tree = 0;
        for (i, frame) in frames.iter().enumerate() {
            // Its memory lives on from frame to frame.
            tree = self.tree(frame).max(tree);
            need = need.larger(self.around(i, frame, frames.get(i + 1), tree));
        }
        need
    }

    /// What a frame needs that is rendered alone.
    pub fn alone(&self, frame: &FrameSize) -> MemoryNeed {
        self.peak(std::slice::from_ref(frame))
    }

    /// What reading a frame takes at its peak.
    pub fn reading(&self, frame: &FrameSize) -> u64 {
        if self.in_place {
            self.held_file(frame)
        } else {
            self.decoding(frame)
        }
    }

    /// The bytes of a native frame where they are not those of a map.
    fn held_file(&self, frame: &FrameSize) -> u64 {
        match self.setup.run.access {
            Access::Map => 0,
            Access::Read => frame.content,
        }
    }

    /// What reading a frame into plain particles takes at its peak.
    pub fn decoding(&self, frame: &FrameSize) -> u64 {
        let n = frame.particles;
        // Several files are read in turn and then put together.
        let files = if frame.files > 1 {
            frame.content.max(frame.raw)
        } else {
            frame.content
        };
        let attributes = frame.raw.saturating_sub(frame.positions);
        // Double precision is rounded into a copy, single is taken as it is.
        let is_double = frame.positions >= 24 * n;
        let rounding = if is_double { frame.raw + 12 * n } else { 0 };
        let shared = if frame.is_shared { frame.content } else { 0 };
        // One byte each tells which are finite.
        let keeping = attributes + self.kept(frame) + n;
        (files + frame.raw).max(shared + rounding.max(keeping))
    }

    /// What the allocator keeps of the memory that a frame was read in, after it is freed: all of it
    /// if there are only small pieces.
    fn retained(&self, frame: &FrameSize) -> u64 {
        if frame.content.max(frame.positions) < RETURNED {
            self.reading(frame)
        } else {
            0
        }
    }

    /// What is kept of a frame that was read, until its tree is built.
    fn kept(&self, frame: &FrameSize) -> u64 {
        if self.in_place {
            return self.held_file(frame);
        }
        let radii = if self.own_radii { 4 } else { 0 };
        frame.particles * (12 + radii) + self.shading(frame)
    }

    /// What is kept of it while it is traced.
    fn shading(&self, frame: &FrameSize) -> u64 {
        if self.in_place {
            return self.held_file(frame);
        }
        let channels = self.setup.picture.render.channels;
        let color = self.setup.picture.color.bytes();
        // Particles that are put elsewhere need a number.
        let ids = channels.id && (self.has_ids || self.setup.picture.surface.spray);
        let each = [
            (true, color),
            (ids, 4),
            (channels.velocity && self.has_velocities, 12),
        ];
        let each: u64 = each.iter().filter(|(has, _)| *has).map(|(_, b)| b).sum();
        frame.particles * each
    }

    fn build(&self, frame: &FrameSize) -> BuildBytes {
        if self.in_place {
            return predicted_stored_bytes(frame.particles);
        }
        let values = self.setup.picture.color.is_by_particle();
        // A smooth surface has no tree over particles.
        let particles = match self.setup.picture.surface.kind {
            SurfaceKind::Smooth => 0,
            SurfaceKind::Spheres | SurfaceKind::Union => frame.particles,
        };
        let count = usize::try_from(particles).unwrap_or(usize::MAX);
        let settings = self.setup.build_settings(count, values);
        let build = predicted_bytes(&settings, particles, self.own_radii);
        if !self.setup.picture.surface.spray {
            return build;
        }
        // Spray is looked for in a tree of its own, in the same memory.
        let first = self.plain_tree(frame.particles);
        BuildBytes {
            tree: build.tree.max(first.tree),
            scratch: build.scratch.max(first.scratch),
        }
    }

    /// The tree that is soonest built.
    fn plain_tree(&self, particles: u64) -> BuildBytes {
        let settings = BuildSettings::new(Structure::Lbvh);
        predicted_bytes(&settings, particles, self.own_radii)
    }

    /// The surface over a frame: normals are found hit by hit; spray has a tree, and a smooth surface its grid.
    fn surface(&self, frame: &FrameSize) -> SurfaceBytes {
        let spray = if self.setup.picture.surface.spray {
            self.plain_tree(frame.particles / SPRAY_PART).tree
        } else {
            0
        };
        let smooth = match self.setup.picture.surface.kind {
            SurfaceKind::Smooth => smooth_bytes(self.setup, frame.particles),
            SurfaceKind::Spheres | SurfaceKind::Union => SurfaceBytes::default(),
        };
        SurfaceBytes {
            building: spray + smooth.building,
            kept: spray + smooth.kept,
        }
    }

    fn tree(&self, frame: &FrameSize) -> u64 {
        self.build(frame).tree
    }

    /// The peak of the time that `frame` is built and traced in memory for a tree of `tree` bytes, with so many
    /// frames `before`: the image of the last of them is encoded then, that of the one before it is kept for
    /// this frame's, and the frame `after` is read.
    fn around(
        &self,
        before: usize,
        frame: &FrameSize,
        after: Option<&FrameSize>,
        tree: u64,
    ) -> MemoryNeed {
        let render = &self.setup.picture.render;
        let film = Film::bytes_for(render.width, render.height, render.channels);
        let threads = rayon::current_num_threads() as u64;
        let film_before = if before > 0 { film } else { 0 };
        let film_kept = if before > 1 { film } else { 0 };
        let encoding_before = if before > 0 { self.encoding() } else { 0 };
        let shared = if frame.is_shared { frame.content } else { 0 };
        // Those that read, too.
        let are_twice = [Some(frame), after]
            .into_iter()
            .flatten()
            .any(FrameSize::needs_many);
        let idle = MemoryNeed {
            program: PROGRAM + THREAD * threads * if are_twice { 2 } else { 1 },
            reading: shared.max(self.retained(frame)),
            ..MemoryNeed::default()
        };
        let kept = self.kept(frame);
        let surface = self.surface(frame);
        let first_read = MemoryNeed {
            reading: self.reading(frame),
            ..idle
        };
        let building = MemoryNeed {
            particles: kept,
            // They lie in what the allocator keeps.
            reading: shared.max(self.retained(frame).saturating_sub(kept)),
            tree: tree + self.build(frame).scratch,
            surface: surface.building,
            images: film_before + film_kept,
            encoding: encoding_before,
            ..idle
        };
        let tracing = MemoryNeed {
            reading: after.map_or(idle.reading, |after| self.reading(after).max(idle.reading)),
            particles: self.shading(frame),
            tree,
            surface: surface.kept,
            images: film + film_before + self.tracing_scratch() * threads,
            encoding: encoding_before,
            ..idle
        };
        let encoding = MemoryNeed {
            images: film,
            encoding: self.encoding(),
            ..idle
        };
        first_read.larger(building).larger(tracing).larger(encoding)
    }

    /// What a thread takes while it traces.
    fn tracing_scratch(&self) -> u64 {
        let is_body = self.setup.picture.surface.kind != SurfaceKind::Spheres;
        scratch_bytes(
            &self.setup.picture.render,
            &self.setup.picture.scene.material,
            is_body,
        )
    }

    /// What encoding an image takes beside its planes: the bands that are packed just then, or wait to be
    /// written; or, before, the bytes of the preview plain, filtered and compressed.
    fn encoding(&self) -> u64 {
        let render = &self.setup.picture.render;
        let pixels = u64::from(render.width) * u64::from(render.height);
        let film = Film::bytes_for(render.width, render.height, render.channels);
        // Bands have 32 rows at most, blocks that pack well 16. Colours are kept in half precision.
        let band = 16 * (film - 8 * pixels) / u64::from(render.height.max(16));
        let threads = rayon::current_num_threads() as u64;
        // Each thread packs one, and some are packed, at worst as large as they were.
        let bands = (threads + 1) * PackBuffers::predicted_bytes(band) + (threads + 2) * band;
        (9 * pixels).max(bands)
    }
}

/// A sorted particle with its volume and its share of the bins, as few as they are.
const SORTED: f64 = 17.0;
/// Its way back to attributes.
const WAY_BACK: f64 = 4.0;
/// Bytes of the grid that particles at the surface have each, voxels being as large as radii; and beside that
/// of the field that bricks are made of. Measured on splashing dam breaks of 1e4 and 2e4 particles; a calm
/// block needs a third to a half.
const GRID: f64 = 5000.0;
const FIELD: f64 = 3500.0;
/// Most of the grid that one particle can have: one that is alone in the corner of eight bricks.
const MOST_GRID: f64 = 22_000.0;

/// What a smooth surface takes over particles that splash, as they do in most frames. Of so many in a body a
/// part lies at its surface that goes down with their cubic root. Too small a radius makes all of them lie at a
/// surface of their own: that is found out, and refused, when the grid is planned.
fn smooth_bytes(setup: &Setup, particles: u64) -> SurfaceBytes {
    let surface = &setup.picture.surface;
    let channels = setup.picture.render.channels;
    let is_colored = setup.picture.color.is_by_particle();
    let keeps = surface.exact || channels.id || channels.velocity || is_colored;
    #[expect(clippy::cast_precision_loss, reason = "an estimate")]
    let count = particles as f64;
    let voxels = f64::from(surface.voxel).powi(-2) / count.cbrt().max(1.0);
    let grid = count * (GRID * voxels).min(MOST_GRID);
    let field = count * (FIELD * voxels).min(MOST_GRID);
    let sorted = count * (SORTED + if keeps { WAY_BACK } else { 0.0 });
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
