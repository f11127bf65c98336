//! Pictures that the program makes of a sample: what its settings choose and put together.

use std::fs;

use crate::harness::{Workshop, dam_break, sample};

/// Spelled out, so that new defaults of the program do not change these pictures.
const IMAGE: [&str; 4] =
    ["image.width=160", "image.height=90", "image.samples=4", "output.channels=[\"RGBA\"]"];

/// A picture of one frame.
pub(super) struct Still {
    /// A frame of the dam break, or a sample of the emitter.
    dam_break: Option<usize>,
    /// Options beside `--set`.
    options: &'static [&'static str],
    settings: &'static [&'static str],
}

/// Particles with few neighbours are small white balls beside a smooth surface.
pub(super) fn spray() -> Still {
    Still {
        dam_break: None,
        options: &["--look", "whitted", "--surface", "smooth", "--spray"],
        settings: &[
            "input.radius=0.025",
            "camera.eye=[0.2, 0.9, 3.0]",
            "camera.look_at=[0.45, 0.3, 0.0]",
            "camera.fov=18",
            "surface.smoothing=0.75",
            "material.color=[0.1, 0.35, 0.7]",
            "render.background=[0.02, 0.03, 0.05]",
        ],
    }
}

/// All that the look sets; most of the time goes into the light on the ground, which is part of it.
pub(super) fn water() -> Still {
    Still {
        dam_break: Some(5),
        options: &["--look", "water"],
        settings: &[
            "input.radius=0.021",
            "camera.eye=[0.2, 1.1, 2.5]",
            "camera.look_at=[-0.65, 0.28, 0.0]",
            "camera.fov=25",
        ],
    }
}

impl Still {
    /// The image as the program writes it.
    #[track_caller]
    pub(super) fn render(&self) -> Vec<u8> {
        let workshop = Workshop::new();
        let file = match self.dam_break {
            Some(frame) => {
                dam_break(&workshop.join("in"), [frame]);
                workshop.join(format!("in/f_{frame}.bgeo"))
            }
            None => sample("emitter_sph/ParticleData_Fluid_10.bgeo"),
        };
        let still = ["still", file.to_str().expect("a path in UTF-8"), "-o", "f.exr"];
        let settings: Vec<&str> =
            IMAGE.iter().chain(self.settings).flat_map(|set| ["--set", set]).collect();
        workshop.run(&[&still, self.options, &settings].concat()).expect(0);
        fs::read(workshop.join("f.exr")).expect("an image")
    }
}
