//! Adds up what the stages hold at the same time.

use super::super::{gpu, mattes};
use super::{FrameSize, MemoryModel, MemoryNeed, Neighbours};
use crate::denoise;
use crate::render::{GroundLightBytes, RendererKind, ground_light_bytes, sampler_bytes};
use crate::scene::Ground;
use crate::scene::ground::Pattern;
use crate::surface::SurfaceKind;
use crate::surface::mesh::MeshTree;

/// Memory of the program: its data (a mebibyte of them is relocated), the stacks of its threads and small allocations;
/// large allocations are returned to the system when they are freed. Measured on sequences of up to 1e6 particles, as the
/// remainder of the other parts.
const PROGRAM: u64 = 6 << 20;
/// Additional memory per thread.
const THREAD: u64 = 256 << 10;

/// A frame of a run.
struct Place<'a> {
    frame: &'a FrameSize,
    /// The next frame.
    after: Option<&'a FrameSize>,
    /// Number of frames before it.
    before: u64,
    /// Memory of its tree.
    tree: u64,
    neighbours: Neighbours,
    /// Memory of the program, and what stays of reading the frame.
    idle: MemoryNeed,
}

impl MemoryModel<'_> {
    /// Peak memory while `frame` is built and traced, with a tree that occupies `tree` bytes. `before` is the number
    /// of previous frames: the images of the last ones are being encoded, and that of the one before them is kept for
    /// reuse. Frame `after` is being read.
    pub(super) fn peak_around(
        &self,
        before: u64,
        frame: &FrameSize,
        after: Option<&FrameSize>,
        tree: u64,
        neighbours: Neighbours,
    ) -> MemoryNeed {
        // Estimate what stays the same in all phases
        let idle = self.idle(frame, after);
        let place = Place { frame, after, before, tree, neighbours, idle };
        let tracing = self.tracing(&place);
        // The peak is that of the largest phase
        [
            self.starting(),
            MemoryNeed { reading: self.reading_with_meshes(frame), surface: self.meshes, ..idle },
            self.building(&place),
            self.lighting(&place, tracing),
            tracing,
            self.denoising(&place, tracing),
            MemoryNeed {
                surface: self.meshes,
                images: self.film(),
                encoding: self.encoding() + self.names(frame),
                ..idle
            },
        ]
        .into_iter()
        .fold(MemoryNeed::default(), MemoryNeed::larger)
    }

    /// Before the first frame: meshes are read.
    fn starting(&self) -> MemoryNeed {
        let threads = rayon::current_num_threads() as u64;
        MemoryNeed {
            surface: self.reading_meshes,
            program: PROGRAM + THREAD * threads,
            ..MemoryNeed::default()
        }
    }

    /// What there is in every phase.
    fn idle(&self, frame: &FrameSize, after: Option<&FrameSize>) -> MemoryNeed {
        let scene = &self.setup.picture.scene;
        // A shadow catcher has a table of its own
        let catches = scene.ground.as_ref().is_some_and(|g| g.shadow_catcher.is_some());
        let environment = scene.environment.as_deref().map_or(0, |environment| {
            let of_catcher = if catches { environment.table().byte_len() } else { 0 };
            environment.byte_len() + of_catcher
        });
        let picture = scene.ground.as_ref().map_or(0, ground_image_bytes);
        // Count the threads, including those for reading
        let threads = rayon::current_num_threads() as u64;
        let has_read_pool = [Some(frame), after].into_iter().flatten().any(FrameSize::needs_many);
        let pools = 1 + u64::from(has_read_pool);
        MemoryNeed {
            program: PROGRAM + environment + picture + THREAD * threads * pools,
            reading: shared(frame).max(self.retained(frame)),
            ..MemoryNeed::default()
        }
    }

    fn building(&self, place: &Place<'_>) -> MemoryNeed {
        let frame = place.frame;
        let kept = self.kept(frame);
        let next_read = |next| self.reading_with_meshes(next);
        let surface = self.surface(frame);
        let encoded = place.before.min(place.neighbours.encoders);
        let meshes = self.meshes_beside(frame);
        let all = MemoryNeed {
            particles: kept,
            // The kept data are in the memory that the allocator retains.
            reading: shared(frame).max(self.retained(frame).saturating_sub(kept))
                + place.after.filter(|_| self.setup.reads_while_building()).map_or(0, next_read),
            images: self.film() * place.before.min(place.neighbours.encoders + 1)
                + self.unfinished(frame, encoded),
            encoding: encoded * self.encoding(),
            ..place.idle
        };
        // The tree is built beside the spray, and beside it what replaces or completes it
        let tree = MemoryNeed {
            tree: place.tree + self.build(frame).scratch,
            surface: self.drops(frame).kept + meshes,
            ..all
        };
        tree.larger(MemoryNeed { tree: place.tree, surface: surface.building + meshes, ..all })
    }

    fn tracing(&self, place: &Place<'_>) -> MemoryNeed {
        let (frame, idle) = (place.frame, place.idle);
        let picture = &self.setup.picture;
        let threads = rayon::current_num_threads() as u64;
        let encoded = place.before.min(place.neighbours.encoders);
        let reading = place.after.map(|after| self.reading_with_meshes(after));
        MemoryNeed {
            program: idle.program + self.floor().kept + sampler_bytes(&picture.render),
            reading: reading.map_or(idle.reading, |reading| reading.max(idle.reading)),
            particles: self.shading(frame),
            // Spheres in motion have a tree of their own instead
            tree: match (picture.surface.kind, self.setup.has_motion()) {
                (SurfaceKind::Spheres, true) => 0,
                _ => place.tree,
            },
            surface: self.surface(frame).kept + self.meshes_beside(frame),
            images: self.film() * (1 + encoded)
                + self.tracing_scratch() * threads
                + self.unfinished(frame, 1 + encoded),
            encoding: encoded * self.encoding() + self.names(frame),
        }
    }

    /// Before `tracing`: the light of photons is computed. Of the planes of the image, only those of an earlier one are
    /// in memory, and the next frame is usually read by the time the maps are made.
    fn lighting(&self, place: &Place<'_>, tracing: MemoryNeed) -> MemoryNeed {
        let floor = self.floor();
        // Photons are focused by the body, not by drops
        let is_dark = self.is_spray_alone(place.frame);
        let computing = if is_dark { floor.without_photons } else { floor.computing };
        if computing == 0 {
            return MemoryNeed::default();
        }
        let Neighbours { encoders, are_slow } = place.neighbours;
        let new_film = if place.before > encoders { 0 } else { self.film() };
        MemoryNeed {
            program: place.idle.program + computing,
            reading: if are_slow { tracing.reading } else { self.next_kept(place) },
            images: tracing.images - new_film,
            ..tracing
        }
    }

    /// What is kept of the next frame after it was read.
    fn next_kept(&self, place: &Place<'_>) -> u64 {
        place.after.map_or(0, |next| self.kept(next)).max(place.idle.reading)
    }

    /// Memory of the light on the ground.
    fn floor(&self) -> GroundLightBytes {
        ground_light_bytes(&self.setup.picture.scene, &self.setup.picture.render)
    }

    /// Memory of so many images like that of `frame` that were rendered on a device, until they are in a film: their
    /// pixels, and what the particles show.
    fn unfinished(&self, frame: &FrameSize, images: u64) -> u64 {
        let render = &self.setup.picture.render;
        let pixels = u64::from(render.width) * u64::from(render.height);
        match self.setup.picture.renderer {
            RendererKind::Cpu => 0,
            RendererKind::Gpu => {
                images * (pixels * gpu::host_bytes(self.setup) + self.shading(frame))
            }
        }
    }

    /// Memory for denoising an image.
    fn filtering(&self) -> u64 {
        let picture = &self.setup.picture;
        let threads = rayon::current_num_threads() as u64;
        let [width, height] = [picture.render.width, picture.render.height];
        picture
            .denoise
            .map_or(0, |settings| denoise::predicted_bytes(width, height, &settings, threads))
    }

    /// After `tracing`: the frames before and after are usually done, except with several encoders, which are there
    /// because encoding takes longer. A device denoises in its own memory.
    fn denoising(&self, place: &Place<'_>, tracing: MemoryNeed) -> MemoryNeed {
        let is_on_device = self.setup.picture.renderer == RendererKind::Gpu;
        if self.setup.picture.denoise.is_none() || is_on_device {
            return MemoryNeed::default();
        }
        // Count the images that exist at this time
        let Neighbours { encoders, are_slow } = place.neighbours;
        let encoded = place.before.min(encoders);
        MemoryNeed {
            program: place.idle.program,
            reading: if are_slow { tracing.reading } else { self.next_kept(place) },
            images: self.film() * (1 + encoded) + self.filtering(),
            encoding: if are_slow || encoders > 1 {
                tracing.encoding
            } else {
                self.names(place.frame)
            },
            ..tracing
        }
    }

    /// Memory of all meshes, arrows, trails and bonds of a frame.
    fn meshes_beside(&self, frame: &FrameSize) -> u64 {
        let own = MeshTree::predicted_bytes(frame.meshes).kept * u64::from(self.setup.slices());
        self.meshes + own + self.arrows(frame).kept
    }

    /// Memory of the names in mattes.
    fn names(&self, frame: &FrameSize) -> u64 {
        mattes::predicted_bytes(self.setup, frame.particles)
    }
}

/// Memory of a file that has other frames too.
const fn shared(frame: &FrameSize) -> u64 {
    if frame.is_shared { frame.content } else { 0 }
}

/// Memory of the picture on the ground.
fn ground_image_bytes(ground: &Ground) -> u64 {
    match &ground.pattern {
        Pattern::Image(image) => image.texture.byte_len(),
        Pattern::Plain | Pattern::Checker { .. } | Pattern::Sand { .. } => 0,
    }
}
