//! Lists of files on disk: their steps, parts and times, and their errors.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use crate::sequence::{Sequence, SequenceError, SequenceInput, SequenceSettings};
use crate::{AttributeData, MemoryBudget};

/// A directory with lists and files of particles.
struct Lists(TempDir);

impl Lists {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary directory"))
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn file(&self, name: &str, text: &str) -> PathBuf {
        let path = self.path(name);
        fs::create_dir_all(path.parent().expect("a directory")).expect("writable");
        fs::write(&path, text).expect("writable");
        path
    }

    /// Files of one particle each, at x.
    fn particles(&self, names: &[&str]) {
        for (x, name) in names.iter().enumerate() {
            self.file(name, &format!("x,y,z\n{x},0,0\n"));
        }
    }

    fn open(&self, name: &str) -> Result<Sequence, SequenceError> {
        Sequence::open(&SequenceInput::from_path(self.path(name)))
    }

    /// Opens a sequence that must be good.
    #[track_caller]
    fn good(&self, name: &str) -> Sequence {
        self.open(name).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    /// The error without the directory.
    fn error(&self, name: &str) -> String {
        let error = self.open(name).expect_err("a bad list").to_string();
        self.without_directory(&error)
    }

    fn without_directory(&self, text: &str) -> String {
        text.replace(&format!("{}/", self.0.path().display()), "")
    }

    /// The error of frame `index` without the directory.
    fn frame_error(&self, sequence: &Sequence, index: usize) -> String {
        let error = sequence.load_raw(index).expect_err("a bad frame");
        self.without_directory(&error.to_string())
    }
}

fn vtk_file(kind: &str, content: &str) -> String {
    format!("<VTKFile type=\"{kind}\">\n<{kind}>\n{content}</{kind}>\n</VTKFile>\n")
}

/// A collection with the entries `(timestep, attributes)`.
fn pvd(entries: &[(&str, &str)]) -> String {
    let mut text = String::new();
    for (time, more) in entries {
        let _ = writeln!(text, "<DataSet timestep=\"{time}\" {more}/>");
    }
    vtk_file("Collection", &text)
}

/// x of all particles of a frame, and its parts.
fn frame(sequence: &Sequence, index: usize) -> (Vec<f64>, Vec<u32>, Option<f64>) {
    let raw = sequence.load_raw(index).expect("a good frame");
    let xs = (0..raw.positions.len()).map(|i| raw.positions.get(i).x);
    let part = raw.attributes.iter().find(|a| a.name == "part");
    let parts = match part.map(|a| &a.data) {
        Some(AttributeData::U32(parts)) => parts.clone(),
        _ => Vec::new(),
    };
    (xs.collect(), parts, raw.time)
}

#[test]
fn steps_are_in_the_order_of_their_times() {
    let lists = Lists::new();
    lists.particles(&["a_0.csv", "a_1.csv", "a_2.csv"]);
    let entries =
        [("2.5", "file=\"a_2.csv\""), ("-0", "file=\"a_0.csv\""), ("1e0", "file=\"./a_1.csv\"")];
    lists.file("run7.pvd", &pvd(&entries));
    let sequence = lists.good("run7.pvd");
    let numbers: Vec<i64> = sequence.frames().iter().map(|f| f.number).collect();
    assert_eq!(numbers, [0, 1, 2]);
    for (index, time) in [0.0, 1.0, 2.5].into_iter().enumerate() {
        let x = index as f64;
        assert_eq!(frame(&sequence, index), (vec![x], vec![], Some(time)));
    }
    assert_eq!(sequence.notes(), ["ParaView collection, 3 time steps, 3 files, times 0 to 2.5"]);
    // With one step, the number in the name of the list is not that of the step
    lists.file("run8.pvd", &pvd(&entries[..1]));
    assert_eq!(lists.good("run8.pvd").frames()[0].number, 0);
}

#[test]
fn files_of_one_time_are_parts() {
    let lists = Lists::new();
    let names = ["fluid_0.csv", "wall_0.csv", "fluid_1.csv", "wall_1.csv"];
    lists.particles(&names);
    let by = |labels: [&str; 2]| -> String {
        let entries: Vec<(String, String)> = (0..4)
            .map(|i| {
                let (name, label) = (names[i], labels[i % 2]);
                ((i / 2).to_string(), format!("file=\"{name}\" {label}"))
            })
            .collect();
        let entries: Vec<(&str, &str)> = entries.iter().map(|(a, b)| (&**a, &**b)).collect();
        pvd(&entries)
    };
    for (labels, expected) in [
        (["", ""], ["fluid", "wall"]),
        (["part=\"0\"", "part=\"1\""], ["fluid", "wall"]),
        (["name=\"w\"", "name=\"v\""], ["w", "v"]),
        (["part=\"0\"", "part=\"0\""], ["fluid", "wall"]),
    ] {
        lists.file("all.pvd", &by(labels));
        let sequence = lists.good("all.pvd");
        assert_eq!(sequence.part_names(), expected);
        assert_eq!(frame(&sequence, 0).0, [0.0, 1.0]);
        assert_eq!(frame(&sequence, 1).1, [0, 1]);
    }
    // Pieces of one part, which nothing tells apart but numbers
    lists.particles(&["p_0.csv", "p_1.csv"]);
    let pieces = pvd(&[("0", "file=\"p_0.csv\""), ("0", "file=\"p_1.csv\"")]);
    lists.file("pieces.pvd", &pieces);
    let sequence = lists.good("pieces.pvd");
    assert_eq!(sequence.part_names(), [""]);
    assert_eq!(frame(&sequence, 0), (vec![0.0, 1.0], vec![0, 0], Some(0.0)));
}

#[test]
fn lists_may_be_in_lists_and_in_directories() {
    let lists = Lists::new();
    lists.particles(&["t0/a.csv", "t0/b.csv", "t1/a.csv", "t1/b.csv"]);
    for step in ["t0", "t1"] {
        let blocks = "<DataSet name=\"a\" file=\"a.csv\"/>\n<Block name=\"in\">\n\
                      <DataSet name=\"b\" file=\"b.csv\"/>\n</Block>\n<DataSet name=\"none\"/>\n";
        lists.file(&format!("{step}/all.vtm"), &vtk_file("vtkMultiBlockDataSet", blocks));
    }
    let series = "{\"file-series-version\": \"1.0\", \"files\": [\n{\"name\": \"t0/all.vtm\", \"time\": 3},\n\
                  {\"name\": \"t1/all.vtm\", \"time\": 4.5}]}";
    lists.file("all.vtm.series", series);
    for input in ["all.vtm.series", ""] {
        let mut sequence = lists.good(input);
        assert_eq!(sequence.part_names(), ["a", "in/b"]);
        assert_eq!(frame(&sequence, 1), (vec![2.0, 3.0], vec![0, 1], Some(4.5)));
        sequence.keep_parts(&["b".to_owned()]).expect("a part");
        assert_eq!(frame(&sequence, 0), (vec![1.0], vec![1], Some(3.0)));
    }
    let summary = lists.good("all.vtm.series").list_summary().cloned().expect("a list");
    assert_eq!((summary.step_count, summary.file_count), (2, 4));
    assert_eq!(summary.times, Some((3.0, 4.5)));
}

#[test]
fn numbered_lists_are_time_steps() {
    let lists = Lists::new();
    lists.particles(&["p_0_0.csv", "p_0_1.csv", "p_10_0.csv", "p_10_1.csv"]);
    for step in [0, 10] {
        let pieces: String =
            (0..2).map(|i| format!("<Piece Source=\"p_{step}_{i}.csv\"/>\n")).collect();
        lists.file(&format!("p_{step}.pvtu"), &vtk_file("PUnstructuredGrid", &pieces));
    }
    let sequence = lists.good("p_#.pvtu");
    let numbers: Vec<i64> = sequence.frames().iter().map(|f| f.number).collect();
    assert_eq!(numbers, [0, 10]);
    assert_eq!(sequence.part_names(), ["piece 0", "piece 1"]);
    assert_eq!(frame(&sequence, 1), (vec![2.0, 3.0], vec![0, 1], None));
    // One that is damaged costs its frame
    lists.file("p_10.pvtu", "<VTKFile type=\"PUnstructuredGrid\">");
    let sequence = lists.good("p_#.pvtu");
    assert!(sequence.load_raw(0).is_ok());
    assert_eq!(
        lists.frame_error(&sequence, 1),
        "p_10.pvtu: byte 34: line 1: the file ends before </VTKFile>; it may still be being written"
    );
    // A list and a file of particles
    let both = [lists.path("p_0.pvtu"), lists.file("q_3.csv", "x,y,z\n1,2,3\n")];
    let sequence = Sequence::open(&SequenceInput::from_paths(both.to_vec()));
    assert_eq!(sequence.expect("two frames").frames().len(), 2);
}

#[test]
fn missing_files_cost_their_frame() {
    let lists = Lists::new();
    lists.particles(&["a_0.csv"]);
    let entries =
        [("0", "file=\"a_0.csv\""), ("1", "file=\"a_1.csv\""), ("2", "file=\"t/a.pvtu\"")];
    lists.file("all.pvd", &pvd(&entries));
    let sequence = lists.good("all.pvd");
    assert!(sequence.load_raw(0).is_ok());
    let error = lists.frame_error(&sequence, 1);
    assert!(
        error.starts_with("all.pvd: line 4: it lists ")
            && error.contains("a_1.csv, which does not exist; copy"),
        "{error}"
    );
    let error = lists.frame_error(&sequence, 2);
    assert!(error.starts_with("all.pvd: line 5: it lists "), "{error}");
}

#[test]
fn files_outside_need_permission() {
    let lists = Lists::new();
    lists.particles(&["a.csv", "run/b.csv"]);
    let entries = [("0", "file=\"b.csv\""), ("1", "file=\"../a.csv\"")];
    let path = lists.file("run/all.pvd", &pvd(&entries));
    let error = lists.error("run/all.pvd");
    assert!(
        error.starts_with("run/all.pvd: line 4: `../a.csv` is outside")
            && error.contains("allow such files"),
        "{error}"
    );
    let settings = SequenceSettings { follow_links: true, ..SequenceSettings::default() };
    let input = SequenceInput::from_path(path);
    let sequence = Sequence::open_with(&input, settings).expect("allowed");
    assert_eq!(frame(&sequence, 1).0, [0.0]);
}

#[test]
fn cycles_end() {
    let lists = Lists::new();
    let blocks = |file: &str| {
        let blocks = format!("<DataSet index=\"0\" file=\"{file}\"/>\n");
        vtk_file("vtkMultiBlockDataSet", &blocks)
    };
    lists.file("self.vtm", &blocks("self.vtm"));
    let sequence = lists.good("self.vtm");
    assert_eq!(
        lists.frame_error(&sequence, 0),
        "self.vtm: byte 61: line 3: the file lists itself; remove this entry"
    );
    lists.file("a.vtm", &blocks("./b.vtm"));
    lists.file("b.vtm", &blocks("a.vtm"));
    let sequence = lists.good("a.vtm");
    assert_eq!(
        lists.frame_error(&sequence, 0),
        "b.vtm: byte 61: line 3: it lists `a.vtm`, which lists this file: a cycle; remove one of the two"
    );
    for index in 0..20 {
        lists.file(&format!("c{index}.vtm"), &blocks(&format!("c{}.vtm", index + 1)));
    }
    let sequence = lists.good("c0.vtm");
    let error = lists.frame_error(&sequence, 0);
    assert!(error.contains("more than 16 lists of files in one another"), "{error}");
}

#[test]
fn time_and_memory_are_bounded() {
    let lists = Lists::new();
    lists.particles(&["a.csv"]);
    // Each list names the next one a thousand times: 10^15 entries, with a file at the end or without
    for depth in 0..5 {
        let next = match depth {
            4 => "a.csv".to_owned(),
            _ => format!("l{}.vtm", depth + 1),
        };
        let blocks = format!("<DataSet file=\"{next}\"/>\n").repeat(1000);
        lists.file(&format!("l{depth}.vtm"), &vtk_file("vtkMultiBlockDataSet", &blocks));
    }
    let open = |name: &str, bytes| {
        let budget = MemoryBudget::new(bytes, "take care");
        let input = SequenceInput::from_path(lists.path(name));
        Sequence::open_within(&input, budget).map(|_| ())
    };
    open("l0.vtm", 16 << 20).expect("each list once");
    let sequence = lists.good("l0.vtm");
    assert_eq!(sequence.frames()[0].parts.len(), 1);
    assert_eq!(
        sequence.notes()[..2],
        [
            "3996 lists of files are listed twice for one time step and used once",
            "999 files are listed twice for one time step and used once",
        ]
    );
    lists.file("l4.vtm", &vtk_file("vtkMultiBlockDataSet", ""));
    let sequence = lists.good("l0.vtm");
    assert!(lists.frame_error(&sequence, 0).contains("l4.vtm"));
    // Lists are followed once for each time
    timed_lists(&lists, 3000);
    let error = open("times.pvd", 16 << 20).expect_err("too many").to_string();
    assert!(error.ends_with("is larger than 16 MiB; take care"), "{error}");
    // Many entries
    let many = "<DataSet timestep=\"0\" file=\"a.csv\"/>\n".repeat(20_000);
    lists.file("many.pvd", &vtk_file("Collection", &many));
    let error = open("many.pvd", 2 << 20).expect_err("too many").to_string();
    assert!(error.contains("list of its files is larger than"), "{error}");
    let sequence = lists.good("many.pvd");
    assert_eq!(sequence.frames()[0].parts.len(), 1);
    assert_eq!(sequence.notes()[0], "19999 files are listed twice for one time step and used once");
    // The particles of all files of a step share the budget
    let budget = MemoryBudget::new(3000, "take care");
    let mut pieces = String::new();
    for index in 0..40 {
        lists.file(&format!("p{index}.csv"), &format!("x,y,z\n{}", "1,2,3\n".repeat(20)));
        let _ = writeln!(pieces, "<Piece Source=\"p{index}.csv\"/>");
    }
    let path = lists.file("p.pvtu", &vtk_file("PUnstructuredGrid", &pieces));
    let budget_of_names = MemoryBudget::new(1 << 20, "take care");
    let input = SequenceInput::from_path(path);
    let mut sequence = Sequence::open_within(&input, budget_of_names).expect("a list");
    assert!(sequence.load_raw(0).is_ok());
    sequence.budget = budget;
    let error = sequence.load_raw(0).expect_err("too much").to_string();
    assert!(error.ends_with("take care"), "{error}");
}

/// Writes `times.pvd`, which lists `l0.vtm` at each of `count` times.
fn timed_lists(lists: &Lists, count: usize) {
    let entry = |time: usize| format!("<DataSet timestep=\"{time}\" file=\"l0.vtm\"/>\n");
    let times: String = (0..count).map(entry).collect();
    lists.file("times.pvd", &vtk_file("Collection", &times));
}

#[test]
#[ignore = "follows four million entries"]
fn lists_without_files_come_to_an_end() {
    let lists = Lists::new();
    let blocks = "<DataSet file=\"l1.vtm\"/>\n".repeat(1000);
    lists.file("l0.vtm", &vtk_file("vtkMultiBlockDataSet", &blocks));
    lists.file("l1.vtm", &vtk_file("vtkMultiBlockDataSet", ""));
    timed_lists(&lists, 5000);
    let error = lists.error("times.pvd");
    assert!(error.contains("have more than 4194304 entries"), "{error}");
}

/// ParaView has written such files.
#[test]
fn blocks_may_have_the_name_of_particles() {
    let lists = Lists::new();
    lists.particles(&["a.csv", "b.csv"]);
    let blocks = "<DataSet index=\"0\" file=\"a.csv\"/>\n<DataSet index=\"1\" file=\"b.csv\"/>\n";
    let path = lists.file("blocks.vtp", &vtk_file("vtkMultiBlockDataSet", blocks));
    assert_eq!(lists.good("blocks.vtp").frames()[0].parts.len(), 2);
    assert!(crate::sequence::stands_for_others(&path));
}

#[test]
fn damaged_lists_name_the_place() {
    let lists = Lists::new();
    lists.particles(&["a.csv"]);
    let root = "<VTKFile type=\"Collection\">\n";
    let head = format!("{root}<Collection>\n");
    let whole = pvd(&[("0", "file=\"a.csv\"")]);
    let entities = format!(
        "<!DOCTYPE x [<!ENTITY a \"aaaaaaaaaa\"><!ENTITY b \"&a;&a;&a;&a;&a;\">]>\n{head}\
         <DataSet timestep=\"0\" file=\"&b;\"/>\n</Collection></VTKFile>"
    );
    let nested = format!("{root}{}", "<a>".repeat(100));
    for (name, text, expected) in [
        ("empty.pvd", String::new(), "byte 0: the file is empty"),
        ("none.pvd", format!("{head}</Collection></VTKFile>"), "it lists no files"),
        ("cut.pvd", whole[..60].to_owned(), "byte 41: line 3: bad XML"),
        (
            "cut2.pvd",
            whole.replace("</Collection>\n</VTKFile>", ""),
            "line 5: the file ends before </VTKFile>",
        ),
        ("other.pvd", "x,y,z\n1,2,3\n".to_owned(), "byte 0: named like a list of files"),
        (
            "time.pvd",
            pvd(&[("0", "file=\"a.csv\""), ("soon", "file=\"a.csv\"")]),
            "byte 78: line 4: timestep=\"soon\" is not a number",
        ),
        (
            "some.pvd",
            pvd(&[("0", "file=\"a.csv\""), ("", "file=\"a.csv\"")]),
            "line 4: some files have a timestep and others have none",
        ),
        ("no-file.pvd", pvd(&[("0", "")]), "byte 41: line 3: a <DataSet> without file"),
        ("entities.pvd", entities, "line 4: bad XML"),
        ("nested.pvd", nested, "line 2: more than 64 elements in one another"),
        (
            "piece.pvtu",
            vtk_file("PUnstructuredGrid", "<Piece/>\n"),
            "byte 55: line 3: a <Piece> without Source",
        ),
        ("tags.vtm", vtk_file("vtkMultiBlockDataSet", "<Block>\n"), "line 4: bad XML"),
        (
            "word.series",
            "{\"file-series-version\": \"1.0\",\n \"files\": [\n{\"name\": \"a.csv\", \"time\": 1},\n{\"name\": 7}]}"
                .to_owned(),
            "line 4: bad file series: invalid type: integer `7`",
        ),
        (
            "version.series",
            "{\"file-series-version\": \"2.0\", \"files\": []}".to_owned(),
            "file series of version 2.0",
        ),
        (
            "cut.series",
            "{\"file-series-version\": \"1.0\",\n \"files\": [\n{\"name\": \"a.c".to_owned(),
            "line 3: the file ends within the list",
        ),
    ] {
        lists.file(name, &text);
        let error = lists.error(name);
        assert!(error.starts_with(&format!("{name}: ")), "{error}");
        assert!(error.contains(expected), "{name}: {error}");
        assert_eq!(error.lines().count(), 1);
    }
    let latin = [head.as_bytes(), b"<DataSet file=\"\xfc.vtu\"/>"].concat();
    fs::write(lists.path("latin.pvd"), latin).expect("writable");
    let error = lists.error("latin.pvd");
    assert!(error.contains("byte 56: line 3: not text in UTF-8"), "{error}");
}

#[test]
fn several_lists_with_times_are_refused() {
    let lists = Lists::new();
    lists.particles(&["a.csv", "b.csv"]);
    let entries = [("0", "file=\"a.csv\""), ("1", "file=\"b.csv\"")];
    for name in ["fluid.pvd", "wall.pvd"] {
        lists.file(name, &pvd(&entries));
    }
    let both = [lists.path("fluid.pvd"), lists.path("wall.pvd")];
    let error = Sequence::open(&SequenceInput::from_paths(both.to_vec()))
        .expect_err("two lists")
        .to_string();
    assert!(error.contains("2 time steps in one of several lists"), "{error}");
}

#[test]
fn inputs_of_a_frame_are_its_members() {
    let lists = Lists::new();
    lists.particles(&["a.csv", "b.csv"]);
    let entries = [("0", "file=\"a.csv\""), ("0", "file=\"b.csv\"")];
    lists.file("all.pvd", &pvd(&entries));
    let sequence = lists.good("all.pvd");
    let members = [lists.path("a.csv"), lists.path("b.csv")];
    assert_eq!(sequence.inputs(0), members.each_ref().map(|p| -> &Path { p }));
}
