//! The spheres of a frame, in plain values.

/// The spheres of a frame.
#[derive(Debug, Clone, Copy)]
pub struct Spheres<'a> {
    /// The centres, all finite.
    pub centers: Centers<'a>,
    /// The radii.
    pub radii: Radii<'a>,
    /// The order of the centres.
    pub order: Order,
    /// By how far each sphere moves from the opening of the shutter to its closing, around its centre; there may be more. For
    /// pictures with an exposure.
    pub displacements: Option<&'a [[f32; 3]]>,
    /// Whether coded centres stay coded, and each ray decodes those that it tests: less memory, but slower. Only if all radii
    /// are equal, and without displacements.
    pub keeps_codes: bool,
    /// Whether rays find all spheres with the same place and radius, instead of the first one.
    pub keeps_copies: bool,
}

/// Centres of spheres.
#[derive(Debug, Clone, Copy)]
pub enum Centers<'a> {
    /// One after the other.
    Points(&'a [[f32; 3]]),
    /// In blocks of 16, as in a native frame: all x of a block, then all y, then all z.
    Blocks {
        /// The blocks. Lanes of the last one beyond `count` are not used.
        blocks: &'a [[f32; 48]],
        /// Number of centres.
        count: u64,
    },
    /// In blocks of 16 whose coordinates are integers on a grid.
    Coded {
        /// How they are stored.
        encoding: Encoding,
        /// The blocks: 16 or 24 words each. Lanes of the last one beyond `count` are not used.
        words: &'a [u32],
        /// The grid of each block.
        grids: &'a [Grid],
        /// Blocks that are not coded, to which others refer: all x, then all y, then all z.
        wide: &'a [[f32; 48]],
        /// Number of centres.
        count: u64,
    },
}

/// The position of code 0, and the step of a grid, on each axis.
pub type Grid = [f32; 6];

/// How coordinates are stored.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Encoding {
    /// As numbers, one centre after the other.
    #[default]
    Points,
    /// As numbers, in blocks.
    Blocks,
    /// 16 bits for each axis.
    Q16,
    /// 11, 11 and 10 bits.
    Q10,
}

impl Encoding {
    /// Words of 16 centres.
    pub(crate) const fn words(self) -> u64 {
        match self {
            Self::Points | Self::Blocks => 48,
            Self::Q16 => 24,
            Self::Q10 => 16,
        }
    }
}

impl Centers<'_> {
    pub(crate) const fn count(&self) -> u64 {
        match self {
            Self::Points(points) => points.len() as u64,
            Self::Blocks { count, .. } | Self::Coded { count, .. } => *count,
        }
    }

    pub(crate) fn bytes(&self) -> &[u8] {
        match self {
            Self::Points(points) => bytemuck::cast_slice(points),
            Self::Blocks { blocks, .. } => bytemuck::cast_slice(blocks),
            Self::Coded { words, .. } => bytemuck::cast_slice(words),
        }
    }

    /// The grids, and the blocks that are not coded.
    pub(crate) const fn coding(&self) -> (&[Grid], &[[f32; 48]]) {
        match self {
            Self::Points(_) | Self::Blocks { .. } => (&[], &[]),
            Self::Coded { grids, wide, .. } => (grids, wide),
        }
    }

    pub(crate) const fn encoding(&self) -> Encoding {
        match self {
            Self::Points(_) => Encoding::Points,
            Self::Blocks { .. } => Encoding::Blocks,
            Self::Coded { encoding, .. } => *encoding,
        }
    }
}

/// Radii of spheres.
#[derive(Debug, Clone, Copy)]
pub enum Radii<'a> {
    /// All have this one.
    Common(f32),
    /// One for each sphere; there may be more.
    PerSphere(&'a [f32]),
}

/// The order in which spheres are given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// Any. They are sorted on the device.
    Any(KeyLength),
    /// Neighbours in space are near each other, as in a native frame.
    AlongCurve,
}

/// Bits of the keys by which spheres are sorted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum KeyLength {
    /// 24 bits: enough for spheres that fill their box.
    Short,
    /// 48 bits: also for a few spheres far from all others, which would press these into few cells.
    Long,
    /// 72 bits: also for clusters whose density differs by many orders of magnitude.
    Longest,
}

impl KeyLength {
    pub(crate) const fn words(self) -> u32 {
        match self {
            Self::Short => 1,
            Self::Long => 2,
            Self::Longest => 3,
        }
    }
}
