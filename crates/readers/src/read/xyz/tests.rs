use super::*;
use crate::read::pieces;
use crate::read::text_samples::*;
use glam::DVec3;
use proptest::prelude::*;
use spherule_frame::Positions;

fn steps(bytes: &[u8]) -> Result<Vec<Step>, ParseError> {
    pieces::steps(FORMAT, bytes)
}

fn read(bytes: &[u8], step: &Step) -> Result<RawParticles, ParseError> {
    pieces::read(FORMAT, bytes, step)
}

#[track_caller]
fn only(bytes: &[u8]) -> RawParticles {
    let steps = steps(bytes).unwrap();
    assert_eq!(steps.len(), 1);
    read(bytes, &steps[0]).unwrap()
}

#[track_caller]
fn fault(text: &str) -> String {
    let steps = match steps(text.as_bytes()) {
        Ok(steps) => steps,
        Err(error) => return error.to_string(),
    };
    let error = read(text.as_bytes(), steps.last().unwrap()).unwrap_err();
    error.to_string()
}

#[test]
fn three_kinds() {
    let cases: [(&[u8], XyzVariant); 16] = [
        (b"", XyzVariant::Raw),
        (&[0; 24], XyzVariant::Raw),
        (b"AAAABBBBCCCC", XyzVariant::Raw),
        (b"1 2 3\n4 5 6\n", XyzVariant::Bare), // twelve printable bytes, but numbers
        (b"1,2,3\n4,5,6\n", XyzVariant::Bare),
        (b"# x y z\n1 2 3\n", XyzVariant::Bare),
        (b"//X Y Z R G B\n1 2 3 4 5 6\n", XyzVariant::Bare),
        (b"x y z\n1 2 3\n", XyzVariant::Bare),
        (b"1 2 3 255 0 0\n", XyzVariant::Bare),
        (b"1\n\nW 1 2 3\n", XyzVariant::Molecular),
        (b" 1 \r\ncomment\r\n7 1 2 3\r\n", XyzVariant::Molecular),
        (b"0\nnothing\n", XyzVariant::Molecular),
        (b"0\nnothing\n1\n\nW 1 2 3\n", XyzVariant::Molecular),
        (b"12\ncomm", XyzVariant::Molecular),
        (b"1\nProperties=pos:R:3\n1 2 3\n", XyzVariant::Molecular),
        ("1\nin \u{e5}ngstr\u{f6}m\nW 1 2 3\n".as_bytes(), XyzVariant::Molecular),
    ];
    for (bytes, expected) in cases {
        let shown = String::from_utf8_lossy(bytes);
        assert_eq!(kind(bytes), Ok(expected), "{shown:?}");
    }
}

#[test]
fn neither_dialect() {
    let both = kind(&[0; 25]).unwrap_err().to_string();
    assert!(both.contains("raw f32") && both.contains("text"), "{both}");
    for text in [
        "hello world\nwhatever it is, it goes on and on and on\n",
        "3\ncomment\n1 2 3\n4 5 6\n7 8 9\n",
        "-1\ncomment\nW 2 3 4\n",
        "1 2\n3 4\n",
    ] {
        assert!(matches!(kind(text.as_bytes()), Err(ParseError::Malformed { .. })), "{text}");
    }
}

#[test]
fn raw_triples() {
    let bytes = sample("single_frames/raw.xyz");
    assert_eq!(kind(&bytes), Ok(XyzVariant::Raw));
    let particles = only(&bytes);
    let Positions::F32(v) = &particles.positions else { panic!("raw files are f32") };
    assert_eq!(v.len(), 1200);
    assert_eq!(v[0].x.to_le_bytes(), bytes[..4]);
    assert_eq!(v[1199].z.to_le_bytes(), bytes[14396..]);
    assert!(only(b"").positions.is_empty());
    // Printable at the head, but not throughout.
    let mut mixed = vec![b'A'; WINDOW];
    mixed.extend([0; 8]);
    assert!(kind(&mixed).is_err());
    mixed[100] = 0x80;
    assert_eq!(kind(&mixed), Ok(XyzVariant::Raw));
}

#[test]
fn molecular_text_agrees_with_the_same_particles_raw() {
    let particles = only(&sample("single_frames/mol.xyz"));
    assert_agrees_with_raw(&particles);
    let elements = whole(&particles, "element");
    assert!(elements.iter().all(|e| *e == elements[0]));
    assert_eq!(particles.attributes.len(), 1);
}

#[test]
fn extended_text_agrees_with_the_same_particles_raw() {
    let bytes = sample("single_frames/ext.xyz");
    assert_eq!(steps(&bytes).unwrap()[0].time, Some(0.5));
    let particles = only(&bytes);
    assert_agrees_with_raw(&particles);
    assert_eq!(particles.time, Some(0.5));
    assert_eq!(whole(&particles, "id")[..2], [9458, 9567]);
    assert_eq!(real(&particles, "velo")[..3], [-4.783, 0.0314533, 0.280406]);
    assert_eq!(attribute(&particles, "velo").components, 3);
}

#[test]
fn columns_by_properties() {
    let text = "2\nLattice=\"9 0 0  0 9 0  0 0 9\" pbc=\"T T F\" Properties=\"id:I:1:fixed:L:1:species:S:1:force:R:3:pos:R:3:tags:S:2:mass:R:1\" time=1.5D0 step=7\n\
        9007199254740993 T -1 1 2 3 4 5 6 a b 0.5\n\
        2 F 3 1D0 2 3 7.0D+00 -8d-1 9 c d 1\n";
    let particles = only(text.as_bytes());
    let expected = [DVec3::new(4., 5., 6.), DVec3::new(7., -0.8, 9.)];
    assert_eq!(f64_positions(&particles), expected);
    assert_eq!(whole(&particles, "id"), [9_007_199_254_740_993, 2]);
    assert_eq!(whole(&particles, "type"), [-1, 3]);
    assert_eq!(real(&particles, "force"), [1., 2., 3., 1., 2., 3.]);
    assert_eq!(real(&particles, "mass"), [0.5, 1.]);
    assert_eq!(particles.attributes.len(), 4);
    assert_eq!((particles.time, particles.step), (Some(1.5), Some(7)));
}

#[test]
fn plain_columns_and_notes() {
    let text = "3\nAtoms. Timestep: 1200\n-1 1.0D+00 2 3 0.5 7 up\n2 4 5 nan 1 8 down\n3 7 8 9 2 9 up # a note\n";
    let steps = steps(text.as_bytes()).unwrap();
    assert_eq!(steps[0].number, Some(1200));
    let particles = only(text.as_bytes());
    assert_eq!(particles.positions.get(0), DVec3::new(1., 2., 3.));
    assert!(particles.positions.get(1).z.is_nan());
    assert_eq!(whole(&particles, "type"), [-1, 2, 3]);
    assert_eq!(real(&particles, "column_5"), [0.5, 1., 2.]);
    assert_eq!(whole(&particles, "column_6"), [7, 8, 9]);
    assert_eq!(particles.attributes.len(), 3);
    let mixed = only(b"2\n\n1 0 0 0\nW 0 0 0\n");
    assert!(mixed.attributes.is_empty());
}

#[test]
fn elements_and_species_become_numbers() {
    let plain = only(b"3\n\nO 0 0 0\nH 1 0 0\nwall 0 0 1\n");
    assert_eq!(whole(&plain, "element")[..2], [8, 1]);
    let text = "3\nLattice=\"9 0 0 0 9 0 0 0 9\" pbc=\"T T F\" Properties=id:I:1:species:S:1:pos:R:3\n\
        7 wall 0 0 0\n8 H 1 0 0\n9 7 0 0 1\n";
    let extended = only(text.as_bytes());
    assert_eq!(whole(&extended, "element")[0], whole(&plain, "element")[2]);
    assert_eq!(whole(&extended, "element")[1], 1);
    assert_eq!(whole(&extended, "id"), [7, 8, 9]);
    let notes = notes::notes(text.as_bytes());
    assert!(notes[0].contains("simulation cell with periodic boundaries (T T F)"), "{notes:?}");
    assert!(notes[1].contains("\"H\" = 1"), "{notes:?}");
    for end in 0..text.len() {
        notes::notes(&text.as_bytes()[..end]);
    }
    assert!(notes::notes(b"1\n\n1 0 0 0\n").is_empty());
}

#[test]
fn frames_one_after_another() {
    let text = "1\nTime=0\nW 1 2 3\n0\n\n2\r\nTime=2\r\nW 4 5 6\r\nW 7 8 9\r\n\n1\nlast\nW 0 0 0";
    let bytes = text.as_bytes();
    let steps = steps(bytes).unwrap();
    let found: Vec<_> =
        steps.iter().map(|step| (read(bytes, step).unwrap().positions.len(), step.time)).collect();
    assert_eq!(found, [(1, Some(0.)), (0, None), (2, Some(2.)), (1, None)]);
    assert_eq!(steps[2].index, 2);
}

#[test]
fn truncated_last_frame() {
    let text = "1\n\nW 1 2 3\n2\n\nW 4 5 6\nW 7 8 9\n";
    for len in 12..text.len() - 2 {
        let cut = &text.as_bytes()[..len];
        let found = steps(cut).unwrap();
        assert_eq!(read(cut, &found[0]).unwrap().positions.len(), 1);
        let error = read(cut, &found[1]).unwrap_err().to_string();
        assert!(error.contains("perhaps still being written"), "{len}: {error}");
    }
}

#[test]
fn bare_points() {
    let text = "//X,Y,Z,R,G,B,Scalar_h\n1,2,3,255,0,0,0.5\n\n# between\n4, 5, 6, 0, 255, 0, 1\n";
    let particles = only(text.as_bytes());
    let expected = [DVec3::new(1., 2., 3.), DVec3::new(4., 5., 6.)];
    assert_eq!(f64_positions(&particles), expected);
    assert_eq!(whole(&particles, "color"), [255, 0, 0, 0, 255, 0]);
    assert_eq!(real(&particles, "Scalar_h"), [0.5, 1.]);
    let particles = only(b"1 2 3 4\r\n5\t6  7 8\r\n");
    let expected = [DVec3::new(1., 2., 3.), DVec3::new(5., 6., 7.)];
    assert_eq!(f64_positions(&particles), expected);
    assert_eq!(whole(&particles, "column_4"), [4, 8]);
    // A domain far from the origin keeps its millimetres.
    let far = only(b"1000000.001 -2000000.002 0.003\n");
    assert_eq!(far.positions.get(0), DVec3::new(1000000.001, -2000000.002, 0.003));
}

#[test]
fn faults_are_described() {
    let cases = [
        ("2\n\nW 1 2 3\n", "byte 0: 2 particles expected, 1 lines follow: the file is cut"),
        ("2\n\nW 1 2 3\nW 1 2\n", "byte 11: line has 3 of 4 columns"),
        ("1\n\nW 1 b 3\n", "column 3 has \"b\""),
        ("1\n\nW 1 2 3\nW 1 2 3\n", "byte 11: \"W 1 2 3\" is not a particle count"),
        ("1\nProperties=pos:R\n1 2 3 4\n", "name:type:count"),
        ("1\nProperties=pos:R:4\n1 2 3 4\n", "\"pos\" is not a position"),
        ("1\nProperties=pos:R:x\n1 2 3 4\n", "\"pos\" has \"x\" columns"),
        ("1\nProperties=velo:R:3\n1 2 3 4\n", "no positions"),
        ("1\nProperties=id:I:1:pos:R:3\n1 2 3\n", "byte 28: line has 3 of 4 columns"),
        ("1\nProperties=pos:R:3:a:R:99999999999999\n1 2 3\n", "has 99999999999999 columns"),
    ];
    for (text, expected) in cases {
        let found = fault(text);
        assert!(found.contains(expected), "{found} | {expected}");
    }
}

#[test]
fn formats_without_a_comment_are_named() {
    for (text, words) in [
        ("3\n1 2 3 -5 0 0 255\n4 5 6 7 1 1 1\n7 8 9 0 2 2 2\n", "call it .pts"),
        ("2\n1 2 3 4\n4 5 6 7\n", "call it .pts"),
    ] {
        let found = fault(text);
        assert!(found.contains(words) && !found.contains("cut short"), "{found}");
    }
}

#[test]
fn text_of_zeros_has_no_particles() {
    for text in ["0\n0\n0\n0\n", "0\n0\n0\n0\n0.5\n1 2\n"] {
        assert!(fault(text).contains("counts of 0 particles"), "{text:?}");
    }
    assert!(only(b"0\n0\n").positions.is_empty());
}

#[test]
fn binary_grids_are_not_taken_for_raw_triples() {
    // A grid of 2 x 2 x 1 points in the other byte order, then in double precision
    let big: Vec<u8> = [2_i32, 2, 1].into_iter().flat_map(i32::to_be_bytes).collect();
    let coordinates = [0.5_f32, -3.25, 100.0, 7.5, 0.1, -0.2, 3.0, 8.0, 4.5, 1e-3, 2e4, -9.75];
    let swapped = coordinates.into_iter().flat_map(f32::to_be_bytes);
    let doubles = coordinates.into_iter().flat_map(|c| (1.7 * f64::from(c)).to_le_bytes());
    let little: Vec<u8> = coordinates.into_iter().flat_map(f32::to_le_bytes).collect();
    for bytes in [big.into_iter().chain(swapped).collect::<Vec<u8>>(), doubles.collect()] {
        let error = read(&bytes, &Step::whole(bytes.len())).expect_err("implausible");
        assert!(error.to_string().contains("not raw f32 triples"), "{error}");
        assert!(FORMAT.reader().layout(&bytes).is_err());
    }
    assert_eq!(only(&little).positions.len(), 4);
    let missing: Vec<u8> =
        [f32::NAN, f32::INFINITY, 3e37].into_iter().flat_map(f32::to_le_bytes).collect();
    assert_eq!(only(&missing).positions.len(), 1);
}

#[test]
fn huge_counts_allocate_nothing() {
    for count in ["99999999999", "9223372036854775807"] {
        let found = fault(&format!("{count}\n\nW 1 2 3\n"));
        assert!(found.contains("expected, 1 lines follow"), "{found}");
    }
    let found = fault("99999999999999999999\n\nW 1 2 3\n");
    assert!(found.contains("neither a particle count"), "{found}");
}

#[test]
#[cfg_attr(miri, ignore = "too many bytes for an interpreter")]
fn truncated_files_do_not_panic() {
    for name in ["raw", "mol", "ext"] {
        cut_everywhere(&sample(&format!("single_frames/{name}.xyz")), steps, read);
    }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn damaged_files_do_not_panic(mutations in mutations()) {
        let text = "2\nProperties=species:S:1:pos:R:3:id:I:1 Time=1\nW 1 2 3 4\nW 5 6 7 8\n1\n\nH 1 2 3 4\n";
        read_all(&mutated(text.as_bytes(), &mutations), steps, read);
        read_all(&mutated(b"# x y z\n1 2 3\n4 5 6\n7,8,9\n", &mutations), steps, read);
    }

    #[test]
    fn random_bytes_do_not_panic(bytes in prop::collection::vec(any::<u8>(), 0..300), letters in letters()) {
        read_all(&bytes, steps, read);
        read_all(&letters, steps, read);
        read_all(&[b"2\nProperties=pos:R:3:", &*letters].concat(), steps, read);
    }

    #[test]
    fn written_frames_round_trip(
        frames in prop::collection::vec(
            prop::collection::vec((any::<i64>(), any::<[f64; 3]>()), 0..20),
            1..4,
        ),
        plain: bool,
    ) {
        let mut text = String::new();
        for frame in &frames {
            let comment = if plain { "free text" } else { "Properties=id:I:1:pos:R:3" };
            text += &format!("{}\n{comment}\n", frame.len());
            for (id, p) in frame {
                text += &format!("{id} {:e} {:?} {}\n", p[0], p[1], p[2]);
            }
        }
        let steps = steps(text.as_bytes()).unwrap();
        prop_assert_eq!(steps.len(), frames.len());
        for (step, frame) in steps.iter().zip(&frames) {
            let found = read(text.as_bytes(), step).unwrap();
            let ids: Vec<i64> = frame.iter().map(|(id, _)| *id).collect();
            prop_assert_eq!(whole(&found, if plain { "type" } else { "id" }), ids);
            for (found, (_, p)) in f64_positions(&found).iter().zip(frame) {
                prop_assert_eq!(found.to_array().map(f64::to_bits), p.map(f64::to_bits));
            }
        }
    }
}
