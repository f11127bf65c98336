//! Frames of a sequence, which follow one another in the same memory.

use std::fs;

use crate::harness::{SMALL, Workshop, dam_break, images};

// Starts the program four times, with all channels: memory is used again from the third frame of a job on.
/// Planes, buffers and threads are used again from the third frame on; images do not show it.
#[test]
fn frames_of_a_sequence_are_those_rendered_alone() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 5..10);
    let options = [
        &SMALL[..],
        &["--channels", "RGBA,Z,N,id,P,V,albedo", "--radius", "0.02"],
        &["--set", "output.transparent=true"],
    ]
    .concat();
    workshop.run(&[&["render", "in", "-o", "out/f.####.exr"], &options[..]].concat()).expect(0);
    let together = images(&workshop.join("out"));
    assert_eq!(together.len(), 10);
    for frame in ["5", "8", "9"] {
        let alone = ["render", "out/job.toml", "--frames", frame];
        let output = format!("alone-{frame}/f.####.exr");
        workshop.run(&[&alone[..], &["-o", &output]].concat()).expect(0);
        for name in [format!("f.000{frame}.exr"), format!("f.000{frame}.png")] {
            let image = fs::read(workshop.join(format!("alone-{frame}")).join(&name));
            assert!(image.expect("an image") == together[&name], "{name}");
        }
    }
}
