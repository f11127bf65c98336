//! The estimated radius: the same for all selections, and from all frames.

use glam::Vec3;
use spherule_formats::sequence::Sequence;
use spherule_formats::{
    ParticleFrame, PositionSlice, Positions, RawParticles, SequenceInput, native, write,
};
use spherule_selection::Condition;

use super::*;

/// Numbers from 0 to 1.
fn random(count: usize, mut state: u32) -> impl Iterator<Item = f32> {
    (0..count).map(move |_| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32
    })
}

/// Particles at random places in a cube, which are dense where `x` is small.
fn cloud(count: usize, seed: u32) -> Vec<Vec3> {
    let numbers: Vec<f32> = random(3 * count, seed).collect();
    let places = numbers.chunks(3).map(|c| Vec3::new(c[0] * c[0], c[1], c[2]));
    places.collect()
}

fn lattice() -> Vec<Vec3> {
    let place = |i: u16| 0.1 * Vec3::from([i % 10, i / 10 % 10, i / 100].map(f32::from));
    (0..1000).map(place).collect()
}

fn raw<P: Default>(positions: P) -> RawParticles<P> {
    RawParticles { positions, ..RawParticles::default() }
}

fn question(selection: Option<&Selection>) -> Question<'_> {
    Question { radius: RadiusQuestion::AutoOfBody, selection, ..Question::NOTHING }
}

/// Both estimates.
fn radii(survey: &Survey) -> [f32; 2] {
    [survey.radius, survey.packed_radius].map(|radius| radius.expect("requested"))
}

fn selection(condition: &str) -> Selection {
    Selection {
        condition: Some(Condition::parse(condition).expect("valid")),
        ..Selection::default()
    }
}

const CONDITIONS: [&str; 3] = ["x < 0.1", "x > 0.8", "index < 40"];

// Surveys three frames in two formats four times, with and without a selection.
#[test]
fn the_radius_is_the_same_for_all_selections() {
    // Frames whose particles are selected at different times
    let frames = [cloud(3000, 1), cloud(2500, 2), lattice()];
    for extension in ["npy", "spf"] {
        let directory = tempfile::tempdir().expect("a directory");
        for (number, positions) in frames.iter().enumerate() {
            let path = directory.path().join(format!("f_{number}.{extension}"));
            if extension == "npy" {
                write::npy::write(&path, positions).expect("a file");
            } else {
                let frame =
                    ParticleFrame::from_raw(raw(Positions::F32(positions.clone())), DVec3::ZERO);
                native::write(&path, &frame, None).expect("a file");
            }
        }
        let sequence = Sequence::open(&SequenceInput::from_path(directory.path())).expect("frames");
        let all = radii(&Survey::of(&sequence, question(None)).expect("readable"));
        for condition in CONDITIONS {
            let selection = selection(condition);
            let some = Survey::of(&sequence, question(Some(&selection))).expect("readable");
            assert!(some.most_particles < 1000, "{condition}");
            assert_eq!(radii(&some), all, "{extension}: {condition}");
        }
    }
}

// Only frames of more than 2^20 particles are sampled.
/// Frames that are sampled without a selection, and read as a whole with one.
#[test]
fn the_radius_of_large_frames_is_the_same_for_all_selections() {
    let positions = cloud((1 << 20) + 1, 3);
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("f_1.npy");
    write::npy::write(&path, &positions).expect("a file");
    let sequence = Sequence::open(&SequenceInput::from_path(&path)).expect("a frame");
    let particles = raw(PositionSlice::F32(&positions));
    let surveys = |selection| {
        let question = Question { radius: RadiusQuestion::Auto, ..question(selection) };
        let of_file = Survey::of(&sequence, question).expect("readable");
        let of_memory = Survey::of_particles("memory", &particles, question);
        [of_file, of_memory.expect("readable")].map(|survey| survey.radius)
    };
    let selection = selection("index < 40");
    let all = surveys(None);
    assert!(all[0].is_some() && all[0] == all[1], "{all:?}");
    assert_eq!(surveys(Some(&selection)), all);
}

#[test]
fn a_lattice_at_the_start_does_not_decide() {
    let directory = tempfile::tempdir().expect("a directory");
    let write = |number: u32, positions: &[Vec3]| {
        let path = directory.path().join(format!("f_{number}.npy"));
        write::npy::write(&path, positions).expect("a file");
    };
    let radius = || {
        let sequence = Sequence::open(&SequenceInput::from_path(directory.path()));
        let survey = Survey::of(&sequence.expect("frames"), question(None));
        survey.expect("readable").radius.expect("an estimate")
    };
    write(1, &cloud(1000, 1));
    let liquid = radius();
    for number in 2..6 {
        write(number, &cloud(1000, number));
    }
    write(0, &lattice());
    // Few particles far from each other decide as little
    write(6, &cloud(20, 7));
    let all = radius();
    assert!((all / liquid - 1.0).abs() < 0.1, "{all} {liquid}");
    assert!(all < 0.8 * 0.05, "{all}");
}
