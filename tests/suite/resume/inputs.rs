//! Inputs that change between the plan and the frame.

use std::fs;

use crate::harness::{Workshop, dam_break, images, ledger, no_leftovers};

const FRAMES: usize = 9;
const LONG: [&str; 12] = [
    "render",
    "in",
    "-o",
    "out/f.####.exr",
    "--width",
    "320",
    "--height",
    "180",
    "--samples",
    "12",
    "--integrator",
    "whitted",
];

// Images take a while, so that the last inputs change before they are read; most are rendered three times.
#[test]
fn inputs_that_vanish_or_shrink_while_a_job_runs_cost_their_frames() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=FRAMES);
    let whole = workshop.run(&LONG).expect(0);
    assert_eq!(whole.rendered().len(), FRAMES);
    fs::rename(workshop.join("out"), workshop.join("whole")).expect("a directory");
    for options in [&[][..], &["--isolate"]] {
        let (gone, short) = (workshop.join("in/f_8.bgeo"), workshop.join("in/f_9.bgeo"));
        let bytes = fs::read(&short).expect("a frame");
        let mut running = workshop.start(&[&LONG[..], options].concat());
        assert!(running.wait_for_line("] frame 1:"));
        fs::remove_file(&gone).expect("a frame");
        fs::write(&short, &bytes[..bytes.len() / 2]).expect("a file");
        let (messages, status) = running.end();
        assert_eq!(status.code(), Some(1), "{messages}");
        assert!(
            messages.contains("error: frame 8: ") && messages.contains("f_8.bgeo"),
            "{messages}"
        );
        assert!(
            messages.contains("error: frame 9: ") && messages.contains("f_9.bgeo"),
            "{messages}"
        );
        assert!(messages.contains("failed: 8-9"), "{messages}");
        assert_eq!(ledger(&workshop.join("out")).done().len(), 2 * (FRAMES - 2));

        // Once they are back, so are their images.
        dam_break(&workshop.join("in"), 8..=9);
        let ran = workshop.run(&LONG).expect(0);
        assert_eq!(ran.rendered(), [8, 9]);
        assert!(images(&workshop.join("out")) == images(&workshop.join("whole")));
        no_leftovers(&workshop.join("out"));
        fs::remove_dir_all(workshop.join("out")).expect("a directory");
    }
}
