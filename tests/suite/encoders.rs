//! Several images are encoded at the same time if they are small and there are many threads.

use std::fs;

use crate::harness::{Workshop, dam_break, images, ledger};

/// Tiny images take longer to write than to trace.
const TINY: [&str; 8] =
    ["--width", "32", "--height", "18", "--samples", "1", "--integrator", "whitted"];

/// Forty frames, one of which cannot be read.
fn frames() -> Workshop {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), [1]);
    let good = workshop.join("in/f_1.bgeo");
    for frame in 2..=40 {
        fs::hard_link(&good, workshop.join(format!("in/f_{frame}.bgeo"))).expect("a link");
    }
    fs::remove_file(workshop.join("in/f_17.bgeo")).expect("the link");
    fs::write(workshop.join("in/f_17.bgeo"), "nothing").expect("a file");
    workshop
}

fn render(workshop: &Workshop, out: &str, threads: &str) {
    let pattern = format!("{out}/f.####.exr");
    let start = ["render", "in", "-o", &pattern, "--threads", threads];
    workshop.run(&[&start[..], &TINY].concat()).expect(1).prints("failed: 1");
}

/// The frames in the ledger of `out`, in its order.
fn recorded(workshop: &Workshop, out: &str) -> Vec<i64> {
    let lines = ledger(&workshop.join(out)).lines;
    lines.iter().filter_map(|line| line["frame"].as_i64()).collect()
}

// Forty frames, twice: many have to be encoded at once for their order to be at risk.
#[test]
fn images_and_their_order_do_not_depend_on_the_number_of_encoders() {
    let workshop = frames();
    render(&workshop, "one", "1");
    render(&workshop, "many", "8");
    assert_eq!(images(&workshop.join("one")), images(&workshop.join("many")));
    let expected: Vec<i64> = (1..=40).collect();
    assert_eq!(recorded(&workshop, "one"), expected);
    assert_eq!(recorded(&workshop, "many"), expected);
}
