//! Jobs on a GPU. A program without the feature `gpu` refuses them; one with it renders on a driver for CPUs, which
//! continuous integration installs (`SPHERULE_GPU=required`).

use crate::harness::{Workshop, dam_break};

/// A picture of the kind that a GPU renders, apart from its renderer.
const PICTURE: [&str; 4] = [
    "--integrator=whitted",
    "--ground=none",
    "--set=output.channels=[\"RGBA\", \"Z\", \"N\", \"id\"]",
    "--look=none",
];

fn workshop() -> Workshop {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=2);
    workshop
}

#[cfg(not(feature = "gpu"))]
#[test]
fn a_program_without_gpus_says_so() {
    let workshop = workshop();
    let refused = workshop.render(&[&PICTURE[..], &["--device=gpu"]].concat()).expect(2);
    refused.prints("render.device: this program was built without the renderer for GPUs");
    assert!(!workshop.join("out").exists());
    let listed = workshop.run(&["devices"]).expect(0).text();
    assert!(listed.contains("--features gpu"), "{listed}");
}

#[cfg(feature = "gpu")]
mod on_a_device {
    use super::{PICTURE, workshop};
    use crate::harness::{SMALL, Workshop, images};
    use crate::picture::Picture;

    /// Renders on the first device, whatever it is.
    const DEVICE: [&str; 2] = ["--device=gpu", "--gpu=0"];

    /// A workshop, or None on a machine without a device.
    fn workshop_with_device() -> Option<Workshop> {
        let workshop = workshop();
        let listed = workshop.run(&["devices"]).expect(0).text();
        let has_device = listed.contains("passes the self-test");
        assert!(has_device || std::env::var_os("SPHERULE_GPU").is_none(), "{listed}");
        has_device.then_some(workshop)
    }

    fn with<'a>(options: &[&'a str]) -> Vec<&'a str> {
        [&PICTURE[..], options].concat()
    }

    /// Compares the images of two frames in two directories. The CPU may fuse products and sums that the device does not.
    fn assert_equal(workshop: &Workshop, directories: [&str; 2]) {
        for frame in [1, 2] {
            let [gpu, cpu] = directories
                .map(|dir| Picture::open(&workshop.join(format!("{dir}/f.{frame:04}.exr"))));
            let ids = gpu.integers("id.I").iter().zip(cpu.integers("id.I"));
            let pixels = ids.clone().count();
            assert!(ids.filter(|(a, b)| a != b).count() <= pixels / 1000);
            assert!(gpu.integers("id.I").iter().any(|id| *id != u32::MAX));
            for channel in ["R", "G", "B", "A", "N.X"] {
                let pairs = gpu.floats(channel).iter().zip(cpu.floats(channel));
                let sum = pairs.map(|(a, b)| f64::from((a - b).abs())).sum::<f64>();
                let mean = sum / pixels as f64;
                assert!(mean < 1e-4, "{channel}: {mean}");
            }
        }
    }

    #[test]
    fn jobs_give_the_pictures_of_the_cpu() {
        let Some(workshop) = workshop_with_device() else { return };
        workshop.render_to("gpu", &with(&DEVICE)).expect(0).prints("2 of 2 frames done");
        workshop.render_to("cpu", &with(&["--device=cpu"])).expect(0);
        assert_equal(&workshop, ["gpu", "cpu"]);
        let report = std::fs::read_to_string(workshop.join("gpu/report.json")).expect("a report");
        for key in ["driver", "upload", "build", "trace", "denoise", "download", "bytes"] {
            assert!(report.contains(&format!("\"{key}\"")), "{key}: {report}");
        }
        let page = std::fs::read_to_string(workshop.join("gpu/report.html")).expect("a page");
        assert!(page.contains("GPU: copies to it, from it"), "{page}");
        let status = workshop.run(&["status", "gpu"]).expect(0).text();
        assert!(status.contains("GPU") && status.contains("in the last frame"), "{status}");
        // The same bytes once more, in processes that take the same device
        workshop.render_to("again", &with(&[&DEVICE[..], &["--isolate"]].concat())).expect(0);
        assert_eq!(images(&workshop.join("again")), images(&workshop.join("gpu")));
    }

    #[test]
    fn progress_of_stills_is_complete() {
        let Some(workshop) = workshop_with_device() else { return };
        let still = ["still", "in", "-o", "a.png", "--progress", "json"];
        let ran = workshop.run(&[&still[..], &SMALL, &DEVICE].concat()).expect(0);
        let percents = ran.text().matches("\"progress\"").count();
        assert_eq!(percents, 100, "{}", ran.text());
    }

    /// The default look: studio, shadow catcher, colours by speed, denoised.
    #[test]
    fn the_default_look_is_that_of_the_cpu() {
        let Some(workshop) = workshop_with_device() else { return };
        for (out, device) in [("gpu", &DEVICE[..]), ("cpu", &["--device=cpu"])] {
            workshop.render_to(out, device).expect(0);
        }
        assert_equal(&workshop, ["gpu", "cpu"]);
    }

    /// Above the shadow catcher of the default look.
    #[test]
    fn glass_is_that_of_the_cpu() {
        let Some(workshop) = workshop_with_device() else { return };
        for (out, device) in [("gpu", &DEVICE[..]), ("cpu", &["--device=cpu"])] {
            let glass = ["--set=material.type=\"glass\""];
            workshop.render_to(out, &[&glass[..], device].concat()).expect(0);
        }
        assert_equal(&workshop, ["gpu", "cpu"]);
    }

    #[test]
    fn a_ground_by_whitted_is_that_of_the_cpu() {
        let Some(workshop) = workshop_with_device() else { return };
        for (out, device) in [("gpu", &DEVICE[..]), ("cpu", &["--device=cpu"])] {
            let picture = ["--integrator=whitted", "--look=none", "--ground=checker"];
            workshop.render_to(out, &[&picture[..], device].concat()).expect(0);
        }
        assert_equal(&workshop, ["gpu", "cpu"]);
    }

    /// The part of the light that `render.clamp` takes away.
    #[test]
    fn limited_light_is_reported() {
        let Some(workshop) = workshop_with_device() else { return };
        let clamped_light = |out: &str, device: &[&str]| {
            let limited = ["--set=render.clamp=0.05", "--set=output.preview=false"];
            workshop.render_to(out, &[&limited[..], device].concat()).expect(0);
            workshop.report(out)["frames"][0]["clamped_light"].as_f64().expect("a number")
        };
        let gpu = clamped_light("gpu", &DEVICE);
        let cpu = clamped_light("cpu", &["--device=cpu"]);
        assert!(cpu > 1e-4 && (gpu / cpu - 1.0).abs() < 0.02, "{gpu} {cpu}");
    }

    #[test]
    fn styles_of_spheres_are_those_of_the_cpu() {
        let Some(workshop) = workshop_with_device() else { return };
        let whitted = with(&["--style", "x > 0.5: spheres, radius 0.03, color red, opacity 0.4"]);
        let paths = [
            "--style",
            "x > 1: spheres, radius 0.03, color gold, material { type = \"metal\", roughness = 0.3 }",
            "--style",
            "x > 0.5: spheres, color red, material { type = \"plastic\" }",
            "--set=output.channels=[\"RGBA\", \"Z\", \"N\", \"id\", \"cryptomatte\"]",
        ];
        for (number, look) in [&whitted[..], &paths].into_iter().enumerate() {
            let [gpu, cpu] = ["gpu", "cpu"].map(|device| format!("{device}{number}"));
            for (out, device) in [(&gpu, &DEVICE[..]), (&cpu, &["--device=cpu"])] {
                workshop.render_to(out, &[look, device].concat()).expect(0);
            }
            assert_equal(&workshop, [&gpu, &cpu]);
        }
        // The names of objects are in the header
        for out in ["gpu1", "cpu1"] {
            let file = std::fs::read(workshop.join(format!("{out}/f.0001.exr"))).expect("a file");
            assert!(file.windows(8).any(|text| text == b"\"style1\""), "{out}");
        }
        let refused = [&DEVICE[..], &["--style", "x > 0.5: union"]].concat();
        workshop
            .render_to("refused", &with(&refused))
            .expect(2)
            .prints("styles of anything but spheres");
    }

    /// Also of native frames, which are decoded for it.
    #[test]
    fn motion_blur_is_that_of_the_cpu() {
        let Some(workshop) = workshop_with_device() else { return };
        workshop.run(&["convert", "in", "-o", "native"]).expect(0);
        let parts =
            "--set=output.channels=[\"RGBA\", \"Z\", \"N\", \"id\", \"lights\", \"light_groups\"]";
        for (out, device) in [("gpu", &DEVICE[..]), ("cpu", &["--device=cpu"])] {
            let pattern = format!("{out}/f.####.exr");
            let blurred = [
                "render",
                "native",
                "-o",
                pattern.as_str(),
                "--set=camera.shutter=1.0",
                "--set=output.frame_time=0.02",
                parts,
            ];
            workshop.run(&[&blurred[..], &SMALL, device].concat()).expect(0);
        }
        assert_equal(&workshop, ["gpu", "cpu"]);
        let report = workshop.report("gpu");
        assert!(report["frames"][0]["device"].is_object(), "{report}");
    }

    /// A device that is a program on the CPU is taken only where it is asked for.
    #[test]
    fn a_device_is_chosen_where_it_suits() {
        let Some(workshop) = workshop_with_device() else { return };
        let listed = workshop.run(&["devices"]).expect(0).text();
        let automatic = workshop.render(&with(&["--gpu=0"])).expect(0);
        let report = std::fs::read_to_string(workshop.join("out/report.json")).expect("a report");
        if listed.lines().any(|line| line.starts_with("0: ") && line.contains("program on the CPU"))
        {
            automatic.prints("rendered on the CPU: ").prints("is a program on the CPU");
            assert!(!report.contains("\"driver\""), "{report}");
        } else {
            assert!(report.contains("\"driver\""), "{report}");
        }
        // The first reason names its key, and no device is looked for
        let lacking = ["still", "in", "-o", "a.png", "--surface=union", "--gpu=99"];
        let ran = workshop.run(&[&lacking[..], &SMALL].concat()).expect(0);
        ran.prints("rendered on the CPU: render.surface: other surfaces");
        let murky = ["--set", "material.type=glass", "--set", "material.scattering=white"];
        let lacking = ["still", "in", "-o", "b.png", "--gpu=99"];
        let ran = workshop.run(&[&lacking[..], &murky, &SMALL].concat()).expect(0);
        ran.prints("rendered on the CPU: material.scattering: media that scatter light");
        let lacking = ["still", "in", "-o", "c.png", "--device=gpu"];
        let ran = workshop.run(&[&lacking[..], &murky, &SMALL].concat()).expect(2);
        ran.prints("material.scattering: media that scatter light cannot be rendered on a GPU yet");
        let lacking = ["still", "in", "-o", "d.png", "--device=gpu", "--set=mist.visibility=3"];
        let ran = workshop.run(&[&lacking[..], &SMALL].concat()).expect(2);
        ran.prints("mist.visibility: mist cannot be rendered on a GPU yet");
    }

    #[test]
    fn a_job_is_finished_on_what_it_was_begun_on() {
        let Some(workshop) = workshop_with_device() else { return };
        workshop.render(&with(&DEVICE)).expect(0);
        // The plan has the renderer, so that it need not be named again
        workshop.render(&with(&["--gpu=0"])).expect(0).prints("2 of 2 frames are done already");
        workshop.render(&with(&["--device=cpu"])).expect(2).prints("renderer");
    }

    #[test]
    fn native_frames_of_each_encoding_are_decoded() {
        let Some(workshop) = workshop_with_device() else { return };
        for encoding in ["f32", "q16", "q10"] {
            let native = format!("native-{encoding}");
            let encoded = ["convert", "in", "--encoding", encoding, "-o", &native];
            workshop.run(&encoded).expect(0);
            let [gpu, cpu] = ["gpu", "cpu"].map(|device| format!("{device}-{encoding}"));
            for (out, options) in [(&gpu, &DEVICE[..]), (&cpu, &["--device=cpu"])] {
                let pattern = format!("{out}/f.####.exr");
                let render = ["render", native.as_str(), "-o", pattern.as_str()];
                workshop.run(&[&render[..], &SMALL, &with(options)].concat()).expect(0);
            }
            assert_equal(&workshop, [&gpu, &cpu]);
        }
    }

    #[test]
    fn what_a_gpu_lacks_is_named() {
        let Some(workshop) = workshop_with_device() else { return };
        let whitted = "--integrator=whitted";
        for (options, expected) in [
            (
                &["--ground=plain", "--set=render.ground_pattern=\"sand\""][..],
                "render.ground: a ground",
            ),
            (
                &[whitted, "--ground=checker", "--set=material.type=\"glass\""],
                "render.ground: a ground",
            ),
            (
                &["--ground=plain", "--set=material.type=\"glass\""],
                "render.caustics: caustics of transmissive particles",
            ),
            (&[whitted, "--surface=union"], "render.surface"),
            (&[whitted, "--gpu=9"], "there is no GPU 9"),
        ] {
            let still = ["still", "in", "-o", "a.png", "--device=gpu"];
            let ran = workshop.run(&[&still[..], &SMALL, options].concat());
            assert!(matches!(ran.code(), Some(1 | 2)), "{options:?}: {}", ran.errors());
            ran.prints(expected);
        }
    }
}
