//! Opacity of spheres from outside: the coverage of layers in decoded and in native frames, and what is refused.

use std::fmt::Write as _;
use std::fs;

use crate::harness::Workshop;
use crate::picture::Picture;

const VIEW: &str = "output.transparent = true
output.preview = false
render.ground = \"none\"
image = { width = 24, height = 24, samples = 64 }
camera = { mode = \"fixed\", eye = [0, 0, 60], look_at = [0, 0, 0], up = [0, 1, 0], fov = 0.8 }
";

/// Four spheres of radius 1 behind each other with the densities 1 to 4.
fn spheres() -> Workshop {
    let workshop = Workshop::new();
    let mut csv = "x,y,z,density\n".to_owned();
    for i in 0..4 {
        let _ = writeln!(csv, "0,0,{},{}", 3 * i, i + 1);
    }
    fs::create_dir_all(workshop.join("in")).expect("a directory");
    fs::write(workshop.join("in/f_1.csv"), csv).expect("a file");
    workshop
}

/// The mean coverage of the image of `input`.
fn coverage(workshop: &Workshop, input: &str, out: &str, opacity: &str) -> f32 {
    let text = format!(
        "input = {{ path = \"{input}\", radius = 1.0 }}\nmaterial.opacity = {opacity}\n\
         output.path = \"{out}/f.####.exr\"\n{VIEW}"
    );
    fs::write(workshop.join("job.toml"), text).expect("a manifest");
    workshop.run(&["render", "job.toml"]).expect(0);
    let picture = Picture::open(&workshop.join(out).join("f.0001.exr"));
    let alpha = picture.floats("A");
    alpha.iter().sum::<f32>() / alpha.len() as f32
}

#[test]
fn layers_cover_what_they_leave_of_each_other() {
    let workshop = spheres();
    let native = ["convert", "in", "-o", "native", "--encoding", "f32"];
    workshop.run(&native).expect(0);
    let by_density = "{ attribute = \"density\", range = [1, 5] }";
    for (name, opacity, expected) in
        [("half", "0.3", 1.0 - 0.7_f32.powi(4)), ("each", by_density, 1.0 - 0.75 * 0.5 * 0.25)]
    {
        for input in ["in", "native"] {
            let found = coverage(&workshop, input, &format!("{name}_{input}"), opacity);
            let error = (found - expected).abs();
            assert!(error < 0.01, "{name} {input}: {found} {expected}");
        }
    }
}

#[test]
fn impossible_opacities_are_explained() {
    let workshop = spheres();
    for (setting, message) in [
        ("material.opacity=1.5", "--set material.opacity=1.5: expected a number from 0 to 1"),
        ("material.opacity={ attribute = \"density\" }", "material.opacity.range: is missing"),
        ("material.opacity={ attribute = \"density\", range = [2, 2] }", "two different numbers"),
        (
            "material.opacity={ attribute = \"densty\", range = [1, 2] }",
            "material.opacity: no attribute `densty`",
        ),
    ] {
        workshop.render(&["--set", setting]).expect(2).prints(message);
    }
    let half = ["--set", "material.opacity=0.5", "--radius", "1"];
    for (options, message) in [
        (["--surface", "union"], "only separate spheres have an opacity"),
        (["--set", "material.type=\"glass\""], "glass and water are transparent already"),
    ] {
        workshop.render(&[&half[..], &options].concat()).expect(2).prints(message);
    }
}
