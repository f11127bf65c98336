//! How much effort goes into a BVH.

use obvhs::ploc::SortPrecision;

/// How much is spent on the tree. Each stands for parameters of `obvhs`, whose presets of about the
/// same names they follow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum BvhPreset {
    /// As `fast_build`: 6 neighbours to either side are looked at from the third pass on; 2 % of
    /// the nodes are reinserted at a time.
    #[default]
    Fast,
    /// As `medium_build`: 14 neighbours from the fourth pass on; 5 %.
    Medium,
    /// As `slow_build`: 24 neighbours from the third pass on, codes of 128 bits; 20 %.
    High,
}

impl BvhPreset {
    /// All there are.
    pub const ALL: [Self; 3] = [Self::Fast, Self::Medium, Self::High];

    /// Its name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Fast => "fast",
            Self::Medium => "medium",
            Self::High => "high",
        }
    }

    pub(super) const fn effort(self) -> Effort {
        match self {
            Self::Fast => Effort {
                near_passes: 2,
                reinsertion: 0.02,
                precision: SortPrecision::U64,
            },
            Self::Medium => Effort {
                near_passes: 3,
                reinsertion: 0.05,
                precision: SortPrecision::U64,
            },
            Self::High => Effort {
                near_passes: 2,
                reinsertion: 0.2,
                precision: SortPrecision::U128,
            },
        }
    }
}

/// What a preset asks of obvhs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Effort {
    /// Passes in which only direct neighbours are looked at.
    pub(super) near_passes: usize,
    /// Part of the nodes that each round of reinsertion tries to place better.
    pub(super) reinsertion: f32,
    /// Bits of the Morton codes.
    pub(super) precision: SortPrecision,
}
