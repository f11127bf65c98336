//! Attributes by name, and motion on the film.

use std::fs;

use crate::harness::Workshop;
use crate::picture::Picture;

const SIZE: [&str; 4] = ["--width", "64", "--height", "36"];

fn write(workshop: &Workshop, frames: &[&str]) {
    fs::create_dir_all(workshop.join("in")).expect("a directory");
    for (number, text) in (1..).zip(frames) {
        fs::write(workshop.join(format!("in/f.{number:04}.csv")), text).expect("a file");
    }
}

/// Renders all frames, and opens the first image.
fn rendered(workshop: &Workshop, out: &str, options: &[&str]) -> Picture {
    let pattern = format!("{out}/f.####.exr");
    let image = ["render", "in", "-o", &pattern];
    workshop.run(&[&image[..], options].concat()).expect(0);
    Picture::open(&workshop.join(format!("{out}/f.0001.exr")))
}

const TWO: &str = "x,y,z,id,density,velocity_x,velocity_y,velocity_z,radius\n\
                   0,0,0,70,1000.5,1,2,3,0.5\n3,0,0,71,-2,4,5,6,0.5\n";

#[test]
fn attributes_are_channels_of_their_names() {
    let workshop = Workshop::new();
    write(&workshop, &[TWO]);
    let channels = ["--channels", "id,attribute:density,attribute:velocity"];
    let picture = rendered(&workshop, "out", &[&SIZE[..], &channels].concat());
    let ids = picture.integers("id.I");
    let planes = ["density", "velocity.X", "velocity.Z"].map(|name| picture.floats(name));
    let mut found = [0; 3];
    for (pixel, id) in ids.iter().enumerate() {
        let (class, expected) = match id {
            70 => (0, [1000.5, 1.0, 3.0]),
            71 => (1, [-2.0, 4.0, 6.0]),
            _ => (2, [0.0; 3]),
        };
        found[class] += 1;
        assert_eq!(planes.map(|plane| plane[pixel]), expected);
    }
    assert!(found.iter().all(|count| *count > 20), "{found:?}");
    workshop.run(&["verify", "out"]).expect(0);
    // The same from a native frame that is traced in place
    workshop.run(&["convert", "in", "-o", "native"]).expect(0);
    let image = ["render", "native", "-o", "stored/f.####.exr"];
    workshop.run(&[&image[..], &SIZE, &channels].concat()).expect(0);
    let stored = Picture::open(&workshop.join("stored/f.0001.exr"));
    for name in ["density", "velocity.X", "velocity.Y", "velocity.Z"] {
        assert_eq!(stored.planes[name], picture.planes[name], "{name}");
    }
}

#[test]
fn unknown_attributes_are_refused_with_the_nearest_one() {
    let workshop = Workshop::new();
    write(&workshop, &[TWO]);
    let image = ["render", "in", "-o", "out/f.####.exr", "--channels"];
    let refused = |channels: &str, messages: &[&str]| {
        let ran = workshop.run(&[&image[..], &[channels]].concat()).expect(2);
        for message in messages {
            assert!(ran.errors().contains(message), "{}", ran.errors());
        }
    };
    let messages = ["output.channels", "`densty`", "did you mean `density`?", "`velocity`"];
    refused("attribute:densty", &messages);
    refused("shadows", &["output.channels", "did you mean shadow?"]);
    refused("motion", &["output.channels", "set output.frame_time"]);
    write(&workshop, &["x,y,z,radius\n0,0,0,1\n"]);
    refused("motion", &["output.channels", "motion needs velocities"]);
    refused("motion_back", &["output.channels", "motion_back needs velocities"]);
    write(&workshop, &["x,y,z,radius,A\n0,0,0,1,2\n"]);
    refused("attribute:A", &["two channels of the file would be called A"]);
}

/// The mean position of what covers the picture, pixels.
fn centroid(picture: &Picture) -> [f32; 2] {
    let mut sum = [0.0; 3];
    for (pixel, alpha) in picture.floats("A").iter().enumerate() {
        let place = [(pixel % picture.width) as f32, (pixel / picture.width) as f32, 1.0];
        for (sum, place) in sum.iter_mut().zip(place) {
            *sum += alpha * place;
        }
    }
    [sum[0] / sum[2], sum[1] / sum[2]]
}

#[test]
fn motion_leads_to_the_next_frame() {
    let workshop = Workshop::new();
    let header = "x,y,z,velocity_x,velocity_y,velocity_z,radius\n";
    let frame = |place: &str| format!("{header}{place},4,0,2,0.06\n");
    write(&workshop, &[&frame("0,0,0"), &frame("1,0,0.5")]);
    let options = ["--channels", "motion,motion_back,Z", "--set", "output.frame_time=0.25"];
    // From far away, where the front of a sphere moves like its centre
    let still = ["--samples", "16", "--width", "256", "--height", "144", "--set", "camera.fov=10"];
    let first = rendered(&workshop, "out", &[&options[..], &still].concat());
    let next = Picture::open(&workshop.join("out/f.0002.exr"));
    let (from, to) = (centroid(&first), centroid(&next));
    let expected = [to[0] - from[0], from[1] - to[1]];
    let is_hit: Vec<bool> = first.floats("Z").iter().map(|z| z.is_finite()).collect();
    let mut count = 0.0;
    let mut mean = [0.0; 2];
    for (axis, name) in ["motion.U", "motion.V"].iter().enumerate() {
        let plane = first.floats(name).iter().zip(&is_hit);
        count = is_hit.iter().filter(|hit| **hit).count() as f32;
        mean[axis] = plane.map(|(v, hit)| if *hit { *v } else { 0.0 }).sum::<f32>() / count;
    }
    assert!(count > 20.0, "{count}");
    let length = expected[0].hypot(expected[1]);
    // From the second frame, the same way back
    for (axis, name) in ["motion_back.U", "motion_back.V"].iter().enumerate() {
        let (z, plane) = (next.floats("Z"), next.floats(name));
        let hit: Vec<f32> =
            z.iter().zip(plane).filter(|(z, _)| z.is_finite()).map(|(_, v)| *v).collect();
        let back = hit.iter().sum::<f32>() / hit.len() as f32;
        assert!((back + expected[axis]).abs() < 0.05 * length, "{back} {expected:?}");
    }
    assert!(length > 20.0, "{expected:?}");
    for axis in 0..2 {
        assert!(
            (mean[axis] - expected[axis]).abs() < 0.05 * length,
            "{mean:?} instead of {expected:?}"
        );
    }
}
