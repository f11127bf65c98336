//! Targets of the program: what people write, what jobs keep on disk, images, and rays in mapped frames. Each
//! returns how much of its bytes was accepted.

/// Takes any bytes, panics where a promise is broken, returns how much was accepted.
pub type Target = fn(&[u8]) -> usize;

mod image;
mod job;
mod manifest;
mod text;
mod trace;

pub use image::{exr, png};
pub use job::{claim, ledger, plan, worker};
pub use manifest::manifest;
pub use text::{output, range};
pub use trace::trace;

/// Every target by the name of its folder in `corpus`.
pub const TARGETS: [(&str, Target); 10] = [
    ("manifest", manifest),
    ("range", range),
    ("output", output),
    ("plan", plan),
    ("ledger", ledger),
    ("worker", worker),
    ("claim", claim),
    ("exr", exr),
    ("png", png),
    ("trace", trace),
];
