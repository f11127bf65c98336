//! Effort of a BVH build.

use obvhs::ploc::SortPrecision;

/// Effort of the build. Each preset selects parameters of `obvhs`, and follows the preset of obvhs with a similar name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum BvhPreset {
    /// As `fast_build`: a search radius of 6 neighbours to either side from the third pass on; 2 % of the nodes are
    /// reinserted at a time.
    #[default]
    Fast,
    /// As `medium_build`: a search radius of 14 neighbours from the fourth pass on; 5 %.
    Medium,
    /// As `slow_build`: a search radius of 24 neighbours from the third pass on, codes of 128 bits; 20 %.
    High,
}

impl BvhPreset {
    /// All presets.
    pub const ALL: [Self; 3] = [Self::Fast, Self::Medium, Self::High];

    /// The name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Fast => "fast",
            Self::Medium => "medium",
            Self::High => "high",
        }
    }

    pub(super) const fn effort(self) -> Effort {
        match self {
            Self::Fast => {
                Effort { near_passes: 2, reinsertion: 0.02, precision: SortPrecision::U64 }
            }
            Self::Medium => {
                Effort { near_passes: 3, reinsertion: 0.05, precision: SortPrecision::U64 }
            }
            Self::High => {
                Effort { near_passes: 2, reinsertion: 0.2, precision: SortPrecision::U128 }
            }
        }
    }
}

/// Parameters of obvhs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Effort {
    /// Number of first passes that search only direct neighbours.
    pub(super) near_passes: usize,
    /// Fraction of the nodes that each round of reinsertion tries to move.
    pub(super) reinsertion: f32,
    /// Bits of the Morton codes.
    pub(super) precision: SortPrecision,
}
