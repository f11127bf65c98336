//! From particles to bricks.

use glam::Vec3;
use rayon::prelude::*;
use spherule_formats::order::index_u32;
use thiserror::Error;

use super::blocks::{self, BlockPlan, Plan};
use super::blur::{Around, Blur, BrickField, Part, taps};
use super::brick::{Brick, CODES, Made, SAMPLES};
use super::layout::Layout;
use super::raw::{Codes, Gather, RawBrick};
use super::tree::{Block, BrickTree, Node};
use crate::accel::simd::{ArrayLanes, ArrayTask};
use crate::metrics::Bytes;
use crate::surface::SurfaceSettings;
use crate::surface::field::FieldParticles;

/// Blocks whose bricks are made at once, a thread: few, so that what they bring can be put away in order.
const BATCH: usize = 16;

/// Why there is no surface.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SmoothError {
    /// Its grid would not fit.
    #[error(
        "the smooth surface of {particles} particles of radius {radius} in voxels of {voxel} needs about {} of \
         memory, {} are left for it; is the radius right? Else give larger voxels (surface.voxel) or more memory",
        Bytes(*.need), Bytes(*.left)
    )]
    TooLarge {
        /// Particles.
        particles: u64,
        /// Their radius.
        radius: f32,
        /// Edge of a voxel.
        voxel: f32,
        /// Bytes.
        need: u64,
        /// Bytes.
        left: u64,
    },
}

/// What building a surface took.
#[derive(Debug, Clone, Default)]
pub struct SmoothReport {
    /// Bytes of the grid, and of particles that are kept for looking up attributes or exact places.
    pub bytes: u64,
    /// Most bytes held while building, those included.
    pub peak_bytes: u64,
    /// Particles too far from all others to be drawn.
    pub left_out: u64,
    /// Whether there are particles, but the field nowhere gets to the threshold.
    pub is_empty: bool,
}

/// A grid with what else rays ask for.
#[derive(Debug, Default)]
pub(super) struct Built {
    pub(super) tree: BrickTree,
    pub(super) field: Option<FieldParticles>,
    /// Lengths, where places and normals are to be the field's.
    pub(super) exact: Option<Layout>,
}

/// Builds the surface of `centers`; with `keep` the particles are kept. `left` is what memory there is.
pub(super) fn build(
    centers: &[Vec3],
    radius: f32,
    settings: &SurfaceSettings,
    keep: bool,
    left: Option<u64>,
) -> Result<(Built, SmoothReport), SmoothError> {
    let layout = Layout::new(settings, radius);
    let count = centers.len() as u64;
    let refuse = |need: u64| match left {
        Some(left) if need > left => Err(SmoothError::TooLarge {
            particles: count,
            radius,
            voxel: layout.voxel,
            need,
            left,
        }),
        _ => Ok(()),
    };
    let keep = keep || settings.exact;
    refuse(count * if keep { 24 } else { 20 })?;
    let mut field = FieldParticles::sorted(centers, layout.support, keep);
    let plan = Plan::of(field.bins(), &layout);
    let need = Need::of(&plan);
    refuse(field.byte_len() + 4 * count + need.total())?;
    let sorted_bytes = field.byte_len() + plan.byte_len();
    if settings.exact {
        field.order_by_position();
        field.find_volumes(|_| true);
    } else {
        let needed = let_go(&mut field, &layout, &plan);
        if keep {
            field.order_by_position();
        }
        field.find_volumes(|bin| needed[bin]);
    }
    let work = Work {
        field: &field,
        layout: &layout,
        plan: &plan,
        lanes: ArrayLanes::default(),
    };
    let raw = work.raw();
    let (blocks, bricks) = work.bricks(&raw);
    let raw_bytes = raw.byte_len();
    drop(raw);
    let tree = BrickTree::new(&blocks, bricks, layout.voxel, layout.threshold * CODES);
    let report = SmoothReport {
        bytes: tree.byte_len() + if keep { field.byte_len() } else { 0 },
        peak_bytes: sorted_bytes
            .max(field.byte_len() + plan.byte_len() + raw_bytes + tree.byte_len()),
        left_out: field.bins().left_out(),
        is_empty: count > 0 && tree.is_empty(),
    };
    let built = Built {
        tree,
        field: keep.then_some(field),
        exact: settings.exact.then_some(layout),
    };
    Ok((built, report))
}

/// Lets go of all particles that the surface does not depend on. Those whose volumes the field is made of are
/// flagged, bin by bin; the others are their neighbours.
fn let_go(field: &mut FieldParticles, layout: &Layout, plan: &Plan) -> Vec<bool> {
    let near = |reach: f32| blocks::bins_near(field.bins(), layout, &plan.blocks, reach);
    let (needed, kept) = (near(layout.support), near(2.0 * layout.support));
    field.retain(&kept);
    let still = needed.iter().zip(&kept).filter(|(_, kept)| **kept);
    still.map(|(needed, _)| *needed).collect()
}

/// Bytes that bricks may take at most, before it is known which of them the surface passes.
struct Need {
    raw: u64,
    bricks: u64,
}

impl Need {
    fn of(plan: &Plan) -> Self {
        let count = |bits: fn(&BlockPlan) -> u64| -> u64 {
            let counts = plan
                .blocks
                .iter()
                .map(|block| u64::from(bits(block).count_ones()));
            counts.sum()
        };
        Self {
            raw: count(|block| block.raw) * (size_of::<Codes>() + size_of::<RawBrick>()) as u64,
            bricks: count(|block| block.band) * size_of::<Brick>() as u64,
        }
    }

    const fn total(&self) -> u64 {
        self.raw + self.bricks
    }
}

/// What bricks are made of.
struct Work<'a> {
    field: &'a FieldParticles,
    layout: &'a Layout,
    plan: &'a Plan,
    lanes: ArrayLanes,
}

/// The field of all bricks that need it: of each block, in the order of its bits.
struct RawField {
    bricks: Vec<RawBrick>,
    /// The first of each block.
    firsts: Vec<usize>,
}

impl RawField {
    fn byte_len(&self) -> u64 {
        let codes = self
            .bricks
            .iter()
            .map(|raw| u64::from(raw.smooth.is_some()) + u64::from(raw.sharp.is_some()));
        size_of_val(&self.bricks[..]) as u64 + size_of::<Codes>() as u64 * codes.sum::<u64>()
    }
}

impl Work<'_> {
    fn raw(&self) -> RawField {
        let mut firsts = Vec::with_capacity(self.plan.blocks.len());
        let mut places = Vec::new();
        for block in &self.plan.blocks {
            firsts.push(places.len());
            places.extend(blocks::cells(block.raw).map(|cell| blocks::brick_at(block.place, cell)));
        }
        let gather = |brick: &[i32; 3]| {
            self.lanes.run(Gather {
                field: self.field,
                layout: self.layout,
                brick: *brick,
            })
        };
        RawField {
            bricks: places.par_iter().map(gather).collect(),
            firsts,
        }
    }

    /// The blocks that hold anything, and all bricks in their order.
    fn bricks(&self, raw: &RawField) -> (Vec<Block>, Vec<Brick>) {
        let taps = taps(self.layout);
        let (mut blocks, mut bricks) = (Vec::new(), Vec::new());
        let numbers: Vec<usize> = (0..self.plan.blocks.len()).collect();
        for batch in numbers.chunks(BATCH * rayon::current_num_threads()) {
            let made: Vec<(Block, Vec<Brick>)> = batch
                .par_iter()
                .map_init(Workshop::default, |shop, number| {
                    let neighbours = Neighbours::of(self.plan, raw, *number);
                    self.lanes.run(MakeBlock {
                        shop,
                        plan: &self.plan.blocks[*number],
                        neighbours,
                        layout: self.layout,
                        taps: &taps,
                    })
                })
                .collect();
            for (mut block, mut its) in made {
                if block.node.children | block.node.inside == 0 {
                    continue;
                }
                block.node.first = index_u32(bricks.len());
                bricks.append(&mut its);
                blocks.push(block);
            }
        }
        bricks.shrink_to_fit();
        (blocks, bricks)
    }
}

/// A block and those around it.
struct Neighbours<'a> {
    blocks: [Option<(&'a BlockPlan, &'a [RawBrick])>; 27],
}

impl<'a> Neighbours<'a> {
    fn of(plan: &'a Plan, raw: &'a RawField, block: usize) -> Self {
        let known = |number: usize| (&plan.blocks[number], &raw.bricks[raw.firsts[number]..]);
        Self {
            blocks: plan.around(block).map(|number| number.map(known)),
        }
    }

    /// A part of the field over the brick at `cell` of the block in the middle, and around it. `deep` is what
    /// it is deep inside.
    #[inline(always)]
    fn around(
        &self,
        cell: u32,
        deep: f32,
        part: impl Fn(&'a RawBrick) -> Option<&'a Codes>,
    ) -> Around<'a> {
        let mut around = [Part::Even(0.0); 27];
        for (number, found) in (0..27_u32).zip(&mut around) {
            // One block before the middle one is 4 bricks before.
            let along = |step: u32, shift: u32| 3 + step + (cell >> shift & 3);
            let (x, y, z) = (
                along(number % 3, 0),
                along(number / 3 % 3, 2),
                along(number / 9, 4),
            );
            let block = self.blocks[(x / 4 + 3 * (y / 4) + 9 * (z / 4)) as usize];
            let Some((plan, raw)) = block else {
                continue;
            };
            let bit = (x % 4) | ((y % 4) << 2) | ((z % 4) << 4);
            if plan.inside >> bit & 1 == 1 {
                *found = Part::Even(deep);
            } else if plan.raw >> bit & 1 == 1 {
                let place = (plan.raw & ((1 << bit) - 1)).count_ones() as usize;
                if let Some(codes) = part(&raw[place]) {
                    *found = Part::Codes(codes);
                }
            }
        }
        around
    }
}

/// What a thread needs to make bricks.
struct Workshop {
    blur: Blur,
    field: Box<BrickField>,
}

impl Default for Workshop {
    fn default() -> Self {
        Self {
            blur: Blur::default(),
            field: Box::new([[[0.0; 16]; SAMPLES]; SAMPLES]),
        }
    }
}

/// Makes the bricks of a block.
struct MakeBlock<'a> {
    shop: &'a mut Workshop,
    plan: &'a BlockPlan,
    neighbours: Neighbours<'a>,
    layout: &'a Layout,
    taps: &'a [f32],
}

impl ArrayTask for MakeBlock<'_> {
    type Output = (Block, Vec<Brick>);

    #[inline(always)]
    fn run(self) -> (Block, Vec<Brick>) {
        let Workshop { blur, field } = self.shop;
        let is_blurred = self.layout.blur > 0;
        let (mut children, mut inside) = (0, self.plan.inside);
        let mut bricks = Vec::new();
        for cell in blocks::cells(self.plan.band) {
            // Deep inside all particles are in company.
            let (deep_sharp, deep_smooth) = if is_blurred { (0.0, 1.0) } else { (1.0, 0.0) };
            let sharp = self
                .neighbours
                .around(cell, deep_sharp, |raw| raw.sharp.as_deref());
            blur.copy_sharp(&sharp, field);
            if is_blurred {
                let smooth = self
                    .neighbours
                    .around(cell, deep_smooth, |raw| raw.smooth.as_deref());
                blur.add_smooth(&smooth, self.taps, field);
            }
            match Brick::make(field, self.layout.threshold * CODES) {
                Made::Brick(brick) => {
                    children |= 1 << cell;
                    bricks.push(brick);
                }
                Made::Inside => inside |= 1 << cell,
                Made::Outside => {}
            }
        }
        let node = Node {
            children,
            inside,
            first: 0,
        };
        let block = Block {
            place: self.plan.place,
            node,
        };
        (block, bricks)
    }
}
