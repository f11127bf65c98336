//! Cameras that move over a sequence, as its images have them.

use std::fs;

use glam::{DVec3, Mat4, Vec3};
use serde_json::{Value, json};

use crate::harness::{SMALL, Workshop, dam_break, images, npy};
use crate::picture::{Picture, world_to_camera};

/// Keys out of order, for frames 2 to 6: up by 8, with the sight narrowing.
const KEYS: &str = r#"
[[camera.key]]
frame = 6
eye = [5.0, 14.5, 30.0]
look_at = [5.0, 14.5, 0.0]
fov = 20.0

[[camera.key]]
frame = 2
eye = [5.0, 6.5, 30.0]
look_at = [5.0, 6.5, 0.0]
"#;

/// The same particles at frames 1 to 7, so that only the camera makes a difference, and a manifest.
fn workshop(camera: &str) -> Workshop {
    let workshop = Workshop::new();
    for frame in 1..=7 {
        let path = workshop.join(format!("in/f_{frame}.npy"));
        npy(&path, 2000, 1, Vec3::ZERO);
    }
    let text = format!(
        "look = \"none\"\n[input]\npath = \"in\"\nup = \"y\"\n[image]\nwidth = 64\nheight = 36\nsamples = 1\n\
         [output]\npath = \"out/f.####.exr\"\n{camera}"
    );
    fs::write(workshop.join("my.toml"), text).expect("a manifest");
    workshop
}

fn image(frame: usize) -> String {
    format!("f.{frame:04}.exr")
}

fn matrices(workshop: &Workshop) -> Vec<Mat4> {
    let matrix = |frame| world_to_camera(&workshop.join("out").join(image(frame)));
    (1..=7).map(|f| Mat4::from_cols_array(&matrix(f))).collect()
}

/// What right, up and forward make of a vector, with y up, at azimuth `a` from the z axis and elevation `e`.
fn turned(a: f64, e: f64, vector: DVec3) -> DVec3 {
    let right = DVec3::new(a.cos(), 0.0, -a.sin());
    let up = DVec3::new(-e.sin() * a.sin(), e.cos(), -e.sin() * a.cos());
    let forward = DVec3::new(-e.cos() * a.sin(), -e.sin(), -e.cos() * a.cos());
    DVec3::new(right.dot(vector), up.dot(vector), forward.dot(vector))
}

#[test]
fn turntable_has_a_constant_distance() {
    let workshop = workshop(
        "[camera]\nmode = \"turntable\"\ndegrees_per_frame = 52.0\nazimuth = 10.0\nelevation = 15.0\n",
    );
    workshop.run(&["render", "my.toml"]).expect(0);
    let matrices = matrices(&workshop);
    // On the axis of the thesis's box; there the nearer lower rim is as far from the middle of the picture as
    // the farther upper one: a little lower than the middle of the box.
    let messages = &check(&workshop, &[])["camera"]["look_at"];
    let look_at: [f64; 3] = std::array::from_fn(|i| messages[i].as_f64().expect("a number"));
    let look_at = DVec3::from_array(look_at);
    assert!(look_at.distance(DVec3::new(5.0, 5.95, 0.0)) < 0.1, "{look_at}");
    let mut distances = Vec::new();
    for (frame, matrix) in (1..).zip(&matrices) {
        let a = (10.0 + 52.0 * f64::from(frame)).to_radians();
        let e = 15.0_f64.to_radians();
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            let found = matrix.transform_vector3(axis.as_vec3()).as_dvec3();
            assert!(found.distance(turned(a, e, axis)) < 1e-6, "frame {frame}: {found}");
        }
        let at = matrix.transform_point3(look_at.as_vec3());
        assert!(at.truncate().length() < 1e-5, "frame {frame}: {at}");
        distances.push(at.z);
    }
    assert!(distances.iter().all(|d| (d - distances[0]).abs() < 1e-5), "{distances:?}");
    let mut first = None;
    for frame in 1..=7 {
        let picture = Picture::open(&workshop.join("out").join(image(frame)));
        let alpha = picture.floats("A");
        let at = |x: usize, y: usize| alpha[y * picture.width + x];
        let (right, bottom) = (picture.width - 1, picture.height - 1);
        let rows = (0..=right).flat_map(|x| [at(x, 0), at(x, bottom)]);
        let columns = (0..=bottom).flat_map(|y| [at(0, y), at(right, y)]);
        assert!(rows.chain(columns).all(|a| a == 0.0), "frame {frame} is cut");
        assert_eq!(at(right / 2, bottom / 2), 1.0, "frame {frame}");
        let first = first.get_or_insert_with(|| picture.clone());
        assert!(frame == 1 || *first != picture, "frame {frame} is as frame 1");
    }
}

#[test]
fn keys_are_reached_smoothly() {
    let workshop = workshop(KEYS);
    workshop.run(&["render", "my.toml"]).expect(0);
    // 3t^2 - 2t^3 at quarters; beyond the keys the camera stands.
    let heights = [0.0, 0.0, 0.15625, 0.5, 0.84375, 1.0, 1.0];
    for (matrix, part) in matrices(&workshop).iter().zip(heights) {
        // It looks along -z with y up and x to the right.
        let expected = Mat4::from_cols_array(&[
            1.0,
            0.0,
            0.0,
            0.0,
            0.0,
            1.0,
            0.0,
            0.0,
            0.0,
            0.0,
            -1.0,
            0.0,
            -5.0,
            -(6.5 + 8.0 * part),
            30.0,
            1.0,
        ]);
        assert_eq!(*matrix, expected);
    }
    // At the end it looks over the box: 20 degrees are 5.3 units up and down at a distance of 30.
    let covered = |frame| {
        let picture = Picture::open(&workshop.join("out").join(image(frame)));
        picture.floats("A").iter().filter(|a| **a > 0.0).count()
    };
    assert_eq!(covered(1), covered(2));
    assert!(covered(2) > 0 && covered(6) == 0);
}

#[test]
fn keys_of_a_json_file_are_those_of_a_manifest() {
    let with_keys = workshop(KEYS);
    with_keys.run(&["render", "my.toml"]).expect(0);
    let with_file = workshop("");
    let keys = json!([
        { "frame": 6, "eye": [5, 14.5, 30], "look_at": [5, 14.5, 0], "fov": 20 },
        { "frame": 2, "eye": [5.0, 6.5, 30.0], "look_at": [5, 6.5, 0] },
    ]);
    let render = |text: &str| {
        fs::write(with_file.join("shot.json"), text).expect("a file");
        with_file.run(&["render", "my.toml", "--camera-path", "shot.json"])
    };
    render(&keys.to_string()).expect(0);
    for frame in 1..=7 {
        let of = |workshop: &Workshop| {
            fs::read(workshop.join("out").join(image(frame))).expect("an image")
        };
        assert_eq!(of(&with_keys), of(&with_file), "{frame}");
    }
    // The same keys as an object continue the job, others do not
    render(&json!({ "keys": keys }).to_string()).expect(0);
    let moved = keys.to_string().replace("30.0]", "31.0]").replace("14.5,30]", "14.5,32]");
    render(&moved).expect(2).prints("camera.key");
    for (text, part) in [
        ("{", "--camera-path shot.json: no JSON"),
        ("[]", "--camera-path shot.json: no keyframes"),
        ("{\"key\": []}", "no keyframes; it must have a list of keyframes"),
        ("[{\"frame\": null}]", "--camera-path shot.json: "),
        ("[{\"frame\": 1, \"eye\": [0, 0, 1]}]", "look_at"),
        ("[{\"frame\": 1, \"eye\": [0, 0], \"look_at\": [0, 0, 1]}]", "camera.key.0.eye"),
        ("[{\"frame\": 1, \"eyes\": [0, 0, 1]}]", "eyes"),
    ] {
        render(text).expect(2).prints(part);
    }
    let many = vec!["{}"; 20_001].join(",");
    render(&format!("[{many}]"))
        .expect(2)
        .prints("20001 keyframes, but at most 20000 are possible");
    let ran = with_file.run(&["render", "my.toml", "--camera-path", "none.json"]);
    ran.expect(2).prints("none.json");
}

// Starts the program six times: a whole job, a resumed one and a single frame of each of two cameras.
#[test]
fn moving_cameras_resume_deterministically() {
    for camera in [KEYS, "[camera]\nmode = \"turntable\"\n"] {
        let workshop = workshop(camera);
        workshop.run(&["render", "my.toml", "--threads", "1"]).expect(0);
        let out = workshop.join("out");
        let whole = images(&out);
        assert_eq!(whole.len(), 14);
        for frame in [1, 4] {
            fs::remove_file(out.join(image(frame))).expect("an image");
        }
        let again = workshop.run(&["render", "my.toml"]).expect(0);
        assert_eq!(again.rendered(), [1, 4]);
        assert!(images(&out) == whole, "{camera}");
        // Some frames alone, from the manifest that lies beside the images, are seen as among all.
        let arguments = ["render", "out/job.toml", "--frames", "3", "-o", "one/f.####.exr"];
        workshop.run(&arguments).expect(0);
        let one = fs::read(workshop.join("one/f.0003.exr")).expect("an image");
        assert!(one == whole[&image(3)], "{camera}");
    }
}

#[test]
fn changed_key_is_rejected_by_name() {
    let workshop = workshop(KEYS);
    workshop.run(&["render", "my.toml", "--frames", "2"]).expect(0);
    workshop
        .run(&["render", "my.toml", "--set", "camera.key.0.up=[1,0,0]"])
        .expect(2)
        .prints("camera.key.1.up: (not set) -> [1.0, 0.0, 0.0]");
}

fn check(workshop: &Workshop, options: &[&str]) -> Value {
    let ran = workshop.run(&[&["check", "my.toml", "--json"], options].concat());
    serde_json::from_str(&ran.expect(0).text()).expect("JSON")
}

#[test]
fn check_reports_the_camera_path() {
    let workshop = workshop(KEYS);
    let camera = &check(&workshop, &["--frames", "3-9"])["camera"];
    assert_eq!(camera["mode"], "keys");
    assert_eq!(camera["moves"], json!(["eye", "look_at", "fov"]));
    assert_eq!((&camera["frame"], &camera["eye"]), (&json!(3), &json!([5.0, 7.75, 30.0])));
    assert_eq!((&camera["last"]["frame"], &camera["last"]["fov"]), (&json!(7), &json!(20.0)));
    let text = workshop.run(&["check", "my.toml"]).expect(0).text();
    assert!(text.contains("at frame 7\n"), "{text}");
    assert!(text.contains("eye, look_at, fov move through 2 keys, frames 2 to 6"), "{text}");

    let camera = &check(&workshop, &["--set", "camera.mode=turntable"])["camera"];
    assert_eq!(camera["moves"], json!(["eye"]));
    assert_eq!(camera["look_at"], camera["last"]["look_at"]);
    let still = &check(&workshop, &["--set", "camera.mode=auto"])["camera"];
    assert_eq!((&still["moves"], &still["last"]), (&json!([]), &Value::Null));
}

#[test]
fn invalid_frame_view_prevents_the_start() {
    let over = r#"
[[camera.key]]
frame = 2
eye = [25.0, 20.0, 0.0]
look_at = [5.0, 6.5, 0.0]
[[camera.key]]
frame = 6
eye = [-15.0, 20.0, 0.0]
look_at = [5.0, 6.5, 0.0]
"#;
    let workshop = workshop(over);
    let what = "error: camera.key: frame 4, between the keys of frames 2 and 6: up is zero or points \
                along the view";
    workshop.run(&["check", "my.toml"]).expect(2).prints(what);
    // Whichever frames are expected now.
    let arguments = ["render", "my.toml", "--frames", "1-3"];
    workshop.run(&arguments).expect(2).prints(what);
    assert!(!workshop.join("out").exists());
}

#[test]
fn init_writes_camera_keys() {
    let workshop = workshop(KEYS);
    let text = workshop.run(&["init", "my.toml"]).expect(0).text();
    assert_eq!(text.matches("\n[[camera.key]]\n").count(), 2, "{text}");
    assert!(text.contains("# up = [0.0, 0.0, 1.0]"), "{text}");
    let arguments = [&["init", "in"][..], &SMALL].concat();
    let text = workshop.run(&arguments).expect(0).text();
    assert!(text.contains("# [[camera.key]]\n# frame = 1 "), "{text}");
}

#[test]
fn focus_follows_a_particle_through_the_frames() {
    let workshop = Workshop::new();
    // Particle 1 moves away from the camera, which looks along +y
    for (frame, distance) in [(1, 4), (2, 7)] {
        let text = format!("x,y,z\n-0.5,9,0\n0,{distance},0\n0.5,2,0\n");
        fs::create_dir_all(workshop.join("in")).expect("a directory");
        fs::write(workshop.join(format!("in/f_{frame}.csv")), text).expect("a file");
    }
    let render = |out: &str, focus: &str| {
        let output = format!("{out}/f.####.exr");
        let focus = format!("camera.focus={focus}");
        let mut options = vec!["render", "in", "-o", output.as_str(), "--set", focus.as_str()];
        for setting in [
            "input.radius=0.4",
            "image.width=64",
            "image.height=36",
            "image.samples=4",
            "camera.eye=[0, 0, 0]",
            "camera.look_at=[0, 1, 0]",
            "camera.up=[0, 0, 1]",
            "camera.aperture=0.2",
        ] {
            options.extend(["--set", setting]);
        }
        workshop.run(&options)
    };
    render("followed", "{ particle = 1 }").expect(0);
    render("auto", "auto").expect(0);
    let at = |name: &str| Picture::open(&workshop.join(name));
    for (frame, distance) in [(1, "4"), (2, "7")] {
        let out = format!("at{distance}");
        render(&out, distance).expect(0);
        let (followed, fixed) =
            (at(&format!("followed/{}", image(frame))), at(&format!("{out}/{}", image(frame))));
        assert_eq!(followed.floats("R"), fixed.floats("R"));
        // The target is at distance 1
        let target = at(&format!("auto/{}", image(frame)));
        assert_ne!(followed.floats("R"), target.floats("R"));
    }
    let ran = render("none", "{ particle = 3 }").expect(1);
    let errors = ran.errors();
    assert!(errors.contains("no particle has the id 3"), "{errors}");
}

// Starts the program 16 times: each surface sharp, blurred, on more threads and at another time; spray and whitewater.
#[test]
fn motion_blur_moves_particles_with_their_velocities() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 3..=3);
    let blur = ["--set", "camera.shutter=0.5", "--set", "output.frame_time=0.1"];
    let render = |out: &str, options: &[&str]| {
        let output = format!("{out}/f.####.exr");
        let all = [&["render", "in", "-o", output.as_str()][..], &SMALL, options];
        workshop.run(&all.concat()).expect(0);
        fs::read(workshop.join(out).join(image(3))).expect("an image")
    };
    for surface in ["spheres", "union", "smooth"] {
        let name = |what: &str| format!("{surface}-{what}");
        let of_surface = ["--surface", surface, "--set", "camera.shutter_slices=3"];
        let sharp = render(&name("sharp"), &of_surface);
        let blur = [&blur[..], &of_surface].concat();
        let blurred = render(&name("blurred"), &[&blur[..], &["--threads", "1"]].concat());
        assert_ne!(sharp, blurred, "{surface}");
        let options = ["--threads", "3", "--accelerator", "sbvh"];
        let other = render(&name("threads"), &[&blur[..], &options].concat());
        assert!(blurred == other, "{surface}");
        // The shutter may be open before or after the frame
        let after = ["--set", "camera.shutter_offset=0"];
        assert_ne!(blurred, render(&name("after"), &[&blur[..], &after].concat()));
    }
    // Spray moves, too
    let spray = ["--surface", "smooth", "--spray"];
    let moving = render("spray-blurred", &[&blur[..], &spray].concat());
    assert_ne!(moving, render("spray-sharp", &spray));
    let white = ["--surface", "smooth", "--whitewater"];
    let moving = render("white-blurred", &[&blur[..], &white].concat());
    assert_ne!(moving, render("white-sharp", &white));
}

#[test]
fn motion_blur_without_velocities_takes_the_next_frame() {
    let workshop = Workshop::new();
    // A ball moves by 0.4 to the right, another one returns on the other side of a periodic box
    let frames = [("-0.2", "0.95"), ("0.2", "-0.95")];
    for (number, (x, periodic)) in (1..).zip(frames) {
        let rows = [format!("7 {x} 0 0"), format!("8 {periodic} 0.5 0")];
        let rows = if number == 1 { rows } else { [rows[1].clone(), rows[0].clone()] };
        let text = format!("2\nProperties=id:I:1:pos:R:3\n{}\n", rows.join("\n"));
        fs::write(workshop.join(format!("f_{number}.xyz")), text).expect("a file");
    }
    let camera = [
        "--set",
        "camera.eye=[0,0,2]",
        "--set",
        "camera.look_at=[0,0,0]",
        "--set",
        "camera.up=[0,1,0]",
        "--radius",
        "0.1",
        "--ground=none",
        "--set",
        "output.transparent=true",
    ];
    let shutter = ["--set", "camera.shutter=1", "--set", "camera.shutter_offset=0"];
    let output = ["render", "f_*.xyz", "-o", "out/f.####.exr"];
    let all = [&output[..], &SMALL, &camera, &shutter];
    workshop.run(&all.concat()).expect(0);
    // Both images show the same way, once from its start and once to its end and beyond
    let alpha = |number: usize| {
        let picture = Picture::open(&workshop.join("out").join(image(number)));
        let [width, height] = [picture.width, picture.height];
        let plane = picture.floats("A").to_vec();
        let row = |y: usize| plane[y * width..][..width].to_vec();
        (row(height / 2), width)
    };
    let (first, width) = alpha(1);
    let (second, _) = alpha(2);
    let covered = |row: &[f32]| row.iter().filter(|a| **a > 0.05).count();
    let center = |row: &[f32]| {
        let sum: f32 = row.iter().sum();
        let moment: f32 = (0..).zip(row).map(|(x, a)| x as f32 * a).sum();
        moment / sum
    };
    assert!(covered(&first) > width / 20, "{first:?}");
    // From -0.2 to 0.2 the middle is 0, from 0.2 to 0.6 it is 0.4
    assert!((center(&first) - 0.5 * width as f32).abs() < 1.5);
    assert!(center(&second) > center(&first) + 2.0);
    // There must be ids or velocities
    npy(&workshop.join("still/f_1.npy"), 200, 1, Vec3::ZERO);
    let checks: [(&[&str], &str); 4] = [
        (&["check", "f_1.xyz"], "needs another frame"),
        (&["check", "still"], "motion blur needs velocities, or ids"),
        (&["check", "f_*.xyz", "--set", "job.follow=true"], "job.follow"),
        (&["check", "f_*.xyz", "--set", "render.normals=\"pca\""], "render.normals"),
    ];
    for (arguments, what) in checks {
        let ran = workshop.run(&[arguments, &shutter].concat());
        let errors = ran.expect(2).errors();
        assert!(errors.contains(what), "{errors}");
    }
}

// A drop that flies past others, which do not move, is a streak. A union is a row of eight copies.
#[test]
fn fast_drops_of_smooth_surfaces_leave_streaks() {
    let workshop = Workshop::new();
    for (number, x) in (1..).zip(["-0.7", "0.7"]) {
        // Those at the ends are far apart: what moves by half of the extent has left a periodic box
        let still = "8 0 0.4 0\n9 -2 0 0\n10 2 0 0";
        let text = format!("4\nProperties=id:I:1:pos:R:3\n7 {x} 0 0\n{still}\n");
        fs::write(workshop.join(format!("f_{number}.xyz")), text).expect("a file");
    }
    let settings = [
        "camera.eye=[0,0,2]",
        "camera.look_at=[0,0,0]",
        "camera.up=[0,1,0]",
        "camera.shutter=1",
        "camera.shutter_offset=0",
        "output.transparent=true",
    ];
    // Least and greatest coverage in the middle of the way
    let coverage = |surface: &str| {
        let output = format!("{surface}/f.####.exr");
        let mut all = vec!["render", "f_*.xyz", "-o", &output, "--surface", surface];
        all.extend(["--frames", "1", "--size", "64x36", "--samples", "400", "--radius", "0.05"]);
        all.extend(settings.iter().flat_map(|setting| ["--set", *setting]));
        all.extend(["--ground=none", "--set", "material.type=matte"]);
        workshop.run(&all).expect(0);
        let picture = Picture::open(&workshop.join(output.replace("####", "0001")));
        let plane = picture.floats("A");
        let column = |x: usize| (15..21).map(|y| plane[y * 64 + x]).sum::<f32>();
        let columns = (22..42).map(column);
        (columns.clone().fold(f32::MAX, f32::min), columns.fold(0.0, f32::max))
    };
    let (least, greatest) = coverage("smooth");
    assert!(greatest < 0.5 && least > 0.7 * greatest, "{least} {greatest}");
    let (least, greatest) = coverage("union");
    assert!(least < 0.4 * greatest, "{least} {greatest}");
}
