//! Memory of particles: while they are read, and afterwards.

use std::collections::BTreeSet;

use spherule_formats::native::Access;

use super::super::bonds::MAX_BONDS_EACH;
use super::{FrameSize, MemoryModel};
use crate::surface::SurfaceBytes;
use crate::surface::mesh::MeshTree;
use crate::surface::rods::RodTree;

/// Allocations of at least this size are returned to the system when they are freed (`cli/allocator.rs`).
const RETURN_THRESHOLD: u64 = 1 << 20;

impl MemoryModel<'_> {
    /// Peak memory for reading a frame.
    pub fn reading(&self, frame: &FrameSize) -> u64 {
        if self.in_place { self.held_file(frame) } else { self.decoding(frame) }
    }

    /// Upper bounds of the memory of the arrows, trails and bonds of a frame: while they are made, and afterwards.
    pub(super) fn arrows(&self, frame: &FrameSize) -> SurfaceBytes {
        let picture = &self.setup.picture;
        let share = |every: u32| frame.particles.div_ceil(u64::from(every.max(1)));
        let none = [0_u64; 2];
        // Rods, and their colours
        let arrows = picture.things.arrows.iter().map(|style| {
            let arrows = share(style.every);
            [2 * arrows, style.look.color.as_ref().map_or(0, |_| arrows)]
        });
        let trails = picture.things.trails.iter().map(|style| {
            let trails = share(style.every);
            let rods = trails.saturating_mul(style.frames.into());
            [rods, style.look.color.as_ref().map_or(0, |_| trails)]
        });
        let styles = picture.particles.styles.iter().filter_map(|style| style.bonds.as_ref());
        let bonds = styles.map(|_| {
            let rods = frame.particles.saturating_mul(MAX_BONDS_EACH);
            [rods, frame.particles]
        });
        // Sum them, and estimate the tree
        let [rods, colors] = arrows
            .chain(trails)
            .chain(bonds)
            .fold(none, |sum, more| [0, 1].map(|i| sum[i].saturating_add(more[i])));
        let [building, kept] = RodTree::predicted_bytes(rods, colors);
        SurfaceBytes { building, kept }
    }

    /// The same, with the arrows and the meshes of the frame, which are made and read after its particles.
    pub(super) fn reading_with_meshes(&self, frame: &FrameSize) -> u64 {
        let reading = self.reading(frame).max(self.making_rods(frame));
        if frame.meshes == 0 {
            return reading;
        }
        let mesh = MeshTree::predicted_bytes(frame.meshes);
        // Those of the next frame are read beside them
        let number = u64::from(self.setup.slices());
        let slices = match number {
            1 => 0,
            _ => (number * mesh.kept).saturating_add(mesh.building),
        };
        let meshes = mesh.building.saturating_add(slices);
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
        let selecting = if self.setup.picture.particles.selection.is_all() {
            0
        } else {
            frame.raw + (4 * n + frame.positions.max(attributes)).max(5 * n)
        };
        let held = rounding.max(keeping) + self.file_indices(frame);
        let reading = (files + frame.raw).max(shared + held.max(selecting));
        // Neighbouring frames are read beside it one at a time, and their ids are sorted
        let beside = frame.raw + 12 * n + reading + 16 * n;
        match (self.setup.moves_to_next_frame(), self.setup.picture.things.trails.is_empty()) {
            // Ids of the frame, and the ends of trails
            (_, false) => beside + 32 * n,
            (true, true) => beside,
            (false, true) => reading,
        }
    }

    /// Bytes of the places of particles in their file, if some of them are not drawn.
    fn file_indices(&self, frame: &FrameSize) -> u64 {
        let rules = &self.setup.picture.particles;
        match (rules.selection.is_all(), rules.is_divided()) {
            (true, false) => 0,
            (false, false) => 4 * frame.particles,
            // The groups of particles, and their order
            (_, true) => 10 * frame.particles,
        }
    }

    /// Memory that the allocator retains after the buffers for reading a frame are freed: all of it, if there are
    /// only small allocations.
    pub(super) fn retained(&self, frame: &FrameSize) -> u64 {
        if frame.content.max(frame.positions) < RETURN_THRESHOLD { self.reading(frame) } else { 0 }
    }

    /// Memory of a frame between reading and the end of its build.
    pub(super) fn kept(&self, frame: &FrameSize) -> u64 {
        if self.in_place {
            return self.held_file(frame);
        }
        let radii = if self.own_radii { 4 } else { 0 };
        // Velocities become displacements, and stay only for channels
        let has_velocities = self.setup.has_motion() || self.setup.picture.surface.whitewater;
        let motion = if has_velocities { 12 } else { 0 };
        frame.particles * (12 + radii + motion) + self.shading(frame)
    }

    /// Memory of its attributes during tracing.
    pub(super) fn shading(&self, frame: &FrameSize) -> u64 {
        if self.in_place {
            return self.held_file(frame);
        }
        let channels = self.setup.picture.render.channels;
        let rules = &self.setup.picture.particles;
        let styles = &rules.styles;
        let colors = styles.iter().map(|style| style.color.bytes());
        let color = colors.collect::<BTreeSet<u64>>().into_iter().sum();
        let has_opacities = styles.iter().any(|style| style.opacity.is_by_particle());
        // Particles that are moved need an explicit id.
        let picture = &self.setup.picture;
        let has_ids = self.has_ids
            || picture.surface.spray
            || picture.surface.whitewater
            || !rules.selection.is_all()
            || rules.is_divided();
        let ids = picture.needs_ids() && has_ids;
        let parts = [
            (true, color),
            (has_opacities, 4),
            (ids, 4),
            (channels.needs_velocities() && self.has_velocities, 12),
            // Whether there are parts is not known in advance
            (self.setup.picture.render.channels.needs_parts(), 4),
            (true, 4 * u64::from(channels.layers.attributes)),
        ];
        let each: u64 = parts.iter().filter(|(has, _)| *has).map(|(_, b)| b).sum();
        frame.particles * each
    }
}
