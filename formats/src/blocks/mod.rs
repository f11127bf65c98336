//! Particles in blocks of 16, and nodes of eight of them: what a tree is made of in memory and in a
//! native file, so that it can be traced in either.

mod aabb;
mod block;
mod compact;
mod node;
mod stored;

pub use aabb::Aabb;
pub use block::{BLOCK_SIZE, Block, BlockRadii};
pub use compact::{BlockFrame, CompactBlock, Q10Block, Q16Block};
pub use node::{FARTHEST_PLANE, Node, WIDTH};
pub use stored::{CompactBlocks, StoredBlocks, StoredLeaves, StoredRadii};
