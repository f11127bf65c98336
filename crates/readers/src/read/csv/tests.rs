use super::*;
use crate::read::pieces;
use crate::read::text_samples::*;
use glam::DVec3;
use proptest::prelude::*;

fn steps(bytes: &[u8]) -> Result<Vec<Step>, ParseError> {
    pieces::steps(FORMAT, bytes)
}

fn read(bytes: &[u8], step: &Step) -> Result<RawParticles, ParseError> {
    pieces::read(FORMAT, bytes, step)
}

#[track_caller]
fn only(text: &str) -> RawParticles {
    let steps = steps(text.as_bytes()).unwrap();
    assert_eq!(steps.len(), 1);
    read(text.as_bytes(), &steps[0]).unwrap_or_else(|error| panic!("{error}: {text}"))
}

#[track_caller]
fn fault(text: &str) -> String {
    let error = read(text.as_bytes(), &Step::whole(text.len())).unwrap_err();
    error.to_string()
}

const TWO: [DVec3; 2] = [DVec3::new(1., 2., 3.), DVec3::new(4., 5., 6.)];

#[test]
fn paraview_agrees_with_the_same_particles_raw() {
    let bytes = sample("single_frames/paraview.csv");
    let particles = read(&bytes, &steps(&bytes).unwrap()[0]).unwrap();
    assert_agrees_with_raw(&particles);
    assert_eq!(whole(&particles, "id")[..2], [9458, 9567]);
    assert_eq!(real(&particles, "density")[0], 1087.36);
    assert_eq!(real(&particles, "velocity")[3..6], [-0.594408, -0.0141007, 2.33325]);
    assert_eq!(particles.attributes.len(), 3);
}

#[test]
fn dualsphysics_agrees_with_the_same_particles_raw() {
    for name in ["dualsphysics", "dualsphysics-comma"] {
        let bytes = sample(&format!("single_frames/{name}.csv"));
        let steps = steps(&bytes).unwrap();
        assert_eq!(steps[0].time, Some(0.5));
        let particles = read(&bytes, &steps[0]).unwrap();
        assert_agrees_with_raw(&particles);
        assert_eq!(particles.time, Some(0.5));
        assert_eq!(whole(&particles, "Idp")[..2], [9458, 9567]);
        assert_eq!(real(&particles, "Vel")[..3], [-4.7829986, 0.031453285, 0.28040573]);
        assert_eq!(real(&particles, "Rhop")[1199], 1001.9382);
        assert_eq!(particles.attributes.len(), 3);
    }
}

#[test]
fn plain_agrees_with_the_same_particles_raw() {
    let bytes = sample("single_frames/plain.csv");
    let particles = read(&bytes, &steps(&bytes).unwrap()[0]).unwrap();
    assert_agrees_with_raw(&particles);
    assert!(particles.attributes.is_empty());
}

#[test]
fn equivalent_tables_read_alike() {
    for text in [
        "x,y,z\n1,2,3\n4,5,6\n",
        "\u{feff}X;Y;Z\r\n1;2;3\r\n4;5;6\r\n",
        "x\ty\tz\n1\t2\t3\n4\t5\t6\n",
        "  x  y  z\n 1.0 2.0  3\n 4  5 6",
        "1,2,3\n4,5,6\n",
        "1, 2 ,3\n4 , 5, 6\n",
        "1;2;3;\n4;5;6;\n",
        "# a comment, with, commas\n1 2 3\n# another\n4 5 6\n",
        "# z y x\n3 2 1\n6 5 4\n",
        "#z,y,x\n3 2 1\n6 5 4\n",
        "\"z\";\"x\";\"y\"\n\"3\";\"1,0\";\"2\"\n6,0;4;5\n",
        "a title\n\nsecond line; of it\nz [m];y [m];x [m];\n3,0;2,0;1,0;\n6;5;4;\n",
        "\n\nPoints_2,Points_1,Points_0\n3e0,2D0,1\n6,5.,4\n\n",
        "x,y,z,name\n1,2,3,\"a, b\"\n4,5,6,\"c\"\n",
        "name,z,y,x\nfluid,3,2,1\nwall,6,5,4\n",
        ",x,y,z\n0,1,2,3\n1,4,5,6\n",
    ] {
        let particles = only(text);
        assert_eq!(f64_positions(&particles), TWO, "{text}");
        assert!(particles.attributes.is_empty(), "{text} {:?}", particles.attributes);
    }
}

#[test]
fn header_lines_before_the_names() {
    let text = "Part;Time [s];Np;Nbound;\n7;0.25;2;0;\n\nPos.x [m];Pos.y [m];Pos.z [m];Idp;\n1;2;3;8;\n4;5;6;9;\n";
    let particles = only(text);
    assert_eq!(f64_positions(&particles), TWO);
    assert_eq!(whole(&particles, "Idp"), [8, 9]);
    assert_eq!(particles.time, Some(0.25));
}

#[test]
fn decimal_commas_need_another_separator() {
    let particles = only("x;y;z;h\n1,5;-2,25;3,0E1;0,125\n0,5;1;2;3\n");
    let expected = [DVec3::new(1.5, -2.25, 30.), DVec3::new(0.5, 1., 2.)];
    assert_eq!(f64_positions(&particles), expected);
    assert_eq!(real(&particles, "h"), [0.125, 3.]);
    let tabs = only("1,5\t2,5\t3,5\n1,0\t2\t3\n");
    assert_eq!(tabs.positions.get(0), DVec3::new(1.5, 2.5, 3.5));
}

#[test]
fn types_follow_the_values() {
    let text = "id,x,y,z,mixed,gap,word,radius,vx,vy,vz,u\n\
        9007199254740993,1,2,3,1,1,1,1,0,0,0,nan\n\
        -5,4,5,6,2.5,,two,2,1,1,1,-inf\n";
    let particles = only(text);
    assert_eq!(f64_positions(&particles), TWO);
    assert_eq!(whole(&particles, "id"), [9_007_199_254_740_993, -5]);
    assert_eq!(real(&particles, "mixed"), [1., 2.5]);
    assert!(real(&particles, "gap")[0] == 1. && real(&particles, "gap")[1].is_nan());
    assert_eq!(real(&particles, "radius"), [1., 2.]);
    assert_eq!(real(&particles, "velocity"), [0., 0., 0., 1., 1., 1.]);
    assert_eq!(real(&particles, "u")[1], f64::NEG_INFINITY);
    assert_eq!(particles.attributes.len(), 6);
}

#[test]
fn missing_positions() {
    let particles = only("x,y,z\n1,,3\n4,nan,6\n-1.#IND,inf,0\n");
    assert_eq!(particles.positions.len(), 3);
    assert!((0..3).all(|i| !particles.positions.get(i).is_finite()));
    let flat = only("id,x,y\n1,2,3\n");
    assert_eq!(f64_positions(&flat), [DVec3::new(2., 3., 0.)]);
}

#[test]
fn tables_without_names_have_a_note() {
    let notes = |text: &str| FORMAT.reader().notes(text.as_bytes());
    assert_eq!(
        notes("# run 7\n1 2 3 4\n5 6 7 8\n"),
        ["the table has no names of columns: columns 1 to 3 are the positions"]
    );
    let grains = only("#format x_y_z_r\n1\t2\t3\t0.5\n");
    assert_eq!(real(&grains, "r"), [0.5]);
    for text in ["x,y,z\n1,2,3\n", "# x y z\n1 2 3\n", "a,b,c\n1,2,3\n", "words\n", ""] {
        assert!(notes(text).is_empty(), "{text}");
    }
}

#[test]
fn tables_without_rows() {
    for text in [
        "x,y,z,id\n",
        "x;y;z;id;",
        "Time;0.5\nx y z id",
        "\"Points:0\",\"Points:1\",\"Points:2\",\"id\"",
    ] {
        let particles = only(text);
        assert!(particles.positions.is_empty(), "{text}");
        assert_eq!(attribute(&particles, "id").count(), 0, "{text}");
    }
}

#[test]
fn thousands_of_columns() {
    let names: Vec<String> = (0..5000).map(|i| format!("q{i}")).collect();
    let row: Vec<String> = (0..5000).map(|i| i.to_string()).collect();
    let text =
        format!("x,y,z,{}\n1,2,3,{row}\n4,5,6,{row}\n", names.join(","), row = row.join(","));
    let particles = only(&text);
    assert_eq!(f64_positions(&particles), TWO);
    assert_eq!(particles.attributes.len(), 5000);
    assert_eq!(whole(&particles, "q4999"), [4999, 4999]);
}

#[test]
fn faults_are_described() {
    let cases = [
        ("", "byte 0: no row of 3 or more numbers"),
        ("hello\nworld\n", "byte 12: no row of 3 or more numbers"),
        ("a,b,c\n1,2,3\n", "byte 0: no positions among the columns \"a\", \"b\", \"c\":"),
        ("x,y,z\n1,2,3\n1,2\n", "byte 12: line 3 has 2 of 3 columns"),
        ("x,y,z\n1,2,3\n1,2", "perhaps still being written"),
        ("x,y,z\n1,2,3,4\n", "byte 12: line 2 has more than 3 columns"),
        ("x,y,z\n1,2,3\n1,b,3\n", "byte 14: line 3: column \"y\" has \"b\", not a number"),
        ("# c\n\n1 2 3\n1 2 b\n", "line 4: column 3 has \"b\""),
        ("title\n1 2 3\n4 5 6\n", "byte 0: numbers without names of columns follow \"title\""),
        ("title\n 2 0.5\n1 2 3 4 5 6\n", "follow \"title\""),
        ("2\n1,2,3\n4,5,6\n", "follow \"2\""),
        ("a,1,2,3\nb,4,5,6\n", "first three columns are not numbers"),
    ];
    for (text, expected) in cases {
        let found = fault(text);
        assert!(found.contains(expected), "{found} | {expected}");
    }
    let wide = steps(b"\xff\xfex\0,\0").unwrap_err().to_string();
    assert!(wide.contains("UTF-16"), "{wide}");
}

// Reads three files more than 2,700 times, cut at each 97th byte.
#[test]
#[cfg_attr(miri, ignore = "too many bytes for an interpreter")]
fn truncated_files_do_not_panic() {
    for name in ["paraview", "dualsphysics", "plain"] {
        cut_everywhere(&sample(&format!("single_frames/{name}.csv")), steps, read);
    }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn damaged_files_do_not_panic(mutations in mutations()) {
        let text = "Time;1\n\"Points:0\";\"Points:1\";Points:2;Vel.x [m];Vel.y;Vel.z;\n1;2,5;3;4;5;6;\n1;2;3;4;5;6;\n";
        read_all(&mutated(text.as_bytes(), &mutations), steps, read);
    }

    #[test]
    fn random_bytes_do_not_panic(bytes in prop::collection::vec(any::<u8>(), 0..300), letters in letters()) {
        read_all(&bytes, steps, read);
        read_all(&letters, steps, read);
        read_all(&[b"x,y,z\n", &*letters].concat(), steps, read);
    }

    #[test]
    fn written_tables_round_trip(
        rows in prop::collection::vec((any::<i64>(), any::<[f64; 3]>(), any::<[f64; 2]>()), 0..30),
        separator in prop::sample::select(vec![",", ";", "\t", " ", " , ", ";  "]),
        end in prop::sample::select(vec!["\n", "\r\n"]),
        trailing: bool,
    ) {
        let join = |cells: &[String]| {
            let line = cells.join(separator);
            let tail = if trailing { separator } else { "" };
            format!("{line}{tail}{end}")
        };
        let mut text = join(&["w_0", "Pos.y", "id", "Pos.z", "Pos.x", "w_1"].map(String::from));
        for (id, p, w) in &rows {
            let cells = [w[0], p[1], p[2], p[0], w[1]].map(|v| format!("{v:e}"));
            let [w0, y, z, x, w1] = cells;
            text += &join(&[w0, y, id.to_string(), z, x, w1]);
        }
        let found = only(&text);
        let ids: Vec<i64> = rows.iter().map(|(id, ..)| *id).collect();
        prop_assert_eq!(whole(&found, "id"), ids);
        let pairs: Vec<u64> = rows.iter().flat_map(|(.., w)| w.map(f64::to_bits)).collect();
        let found_pairs: Vec<u64> = real(&found, "w").iter().map(|w| w.to_bits()).collect();
        prop_assert_eq!(found_pairs, pairs);
        for (found, (_, p, _)) in f64_positions(&found).iter().zip(&rows) {
            prop_assert_eq!(found.to_array().map(f64::to_bits), p.map(f64::to_bits));
        }
    }
}
