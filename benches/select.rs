//! What a selection takes: finding the particles that meet a condition, and taking them from the arrays of a frame.
//!
//! ```text
//! cargo bench --bench select
//! ```
//!
//! The frame has positions, velocities, types and ids in single precision and 32 bits, in random order.

#![expect(clippy::print_stdout, reason = "the table is what it is for")]
#![expect(clippy::cast_possible_truncation, reason = "types from 0 to 3")]

use std::env;
use std::time::{Duration, Instant};

use glam::Vec3;
use spherule::selection::{Condition, Selection};
use spherule_formats::{Attribute, AttributeData, Positions, RawParticles};

/// Turns of each; the best counts.
const TURNS: usize = 7;
/// Name to filter by on the command line.
const NAME: &str = "select";

const CONDITIONS: [&str; 4] = [
    "type == 1",
    "z < 0.5",
    "speed > 2 && z < 0.5 && type == 1",
    "sqrt(x*x + y*y) < 0.5 || abs(velocity.z) / max(speed, 1) > 0.9",
];

fn main() {
    let mut names = env::args().skip(1).filter(|a| !a.starts_with('-'));
    let has = |flag: &str| env::args().any(|argument| argument == flag);
    if has("--list") || names.any(|name| !NAME.contains(&name[..])) {
        return;
    }
    let is_quick = has("--test") || !has("--bench");
    let (turns, count) = if is_quick { (1, 10_000) } else { (TURNS, 10_000_000) };
    let particles = particles(count);
    let threads = rayon::current_num_threads();
    println!("{count} particles, {threads} threads, best of {turns} turns, milliseconds");
    println!("{:>8} {:>8} {:>9}  condition", "find", "take", "selected");
    for text in CONDITIONS {
        let selection = Selection {
            condition: Some(Condition::parse(text).expect("a condition")),
            ..Selection::default()
        };
        let (mut find, mut take, mut selected) = (Duration::MAX, Duration::MAX, 0);
        for _ in 0..turns {
            let mut own = particles.clone();
            let start = Instant::now();
            let survivors = selection.survivors(&own).expect("known names");
            find = find.min(start.elapsed());
            let start = Instant::now();
            own.select(&survivors);
            take = take.min(start.elapsed());
            selected = survivors.len();
        }
        let [find, take] = [find, take].map(|time| 1e3 * time.as_secs_f64());
        println!("{find:>8.1} {take:>8.1} {selected:>9}  {text}");
    }
}

/// A frame with numbers that cannot be predicted.
fn particles(count: usize) -> RawParticles {
    let mut state = 1_u64;
    let mut random = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as f32 / (1_u32 << 24) as f32
    };
    let positions = (0..count).map(|_| Vec3::new(random(), random(), random()));
    let positions = Positions::F32(positions.collect());
    let velocity = (0..3 * count).map(|_| 4.0 * random() - 2.0).collect();
    let kind = (0..count).map(|_| (4.0 * random()) as i32).collect();
    let attribute =
        |name: &str, components, data| Attribute { name: name.to_owned(), components, data };
    RawParticles {
        positions,
        attributes: vec![
            attribute("velocity", 3, AttributeData::F32(velocity)),
            attribute("type", 1, AttributeData::I32(kind)),
            attribute("id", 1, AttributeData::U32((0..).take(count).collect())),
        ],
        ..RawParticles::default()
    }
}
