//! Particles in blocks of 16, and nodes of eight of them: what a tree is made of in memory and in a
//! native file, so that it can be traced in either.

mod aabb;
mod block;
mod node;

pub use aabb::Aabb;
pub use block::{BLOCK_SIZE, Block, BlockRadii};
pub use node::{Node, WIDTH};
