//! Particles in blocks of 16, and nodes of eight blocks: the parts of a tree. Their layout is the same in
//! memory and in a native file, so that both can be traced.

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
