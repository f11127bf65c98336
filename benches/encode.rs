//! What an image takes to encode: the blocks packed here against the codec of the crate `exr`, in turns, by CPU
//! seconds of one thread and bytes.
//!
//! ```text
//! cargo bench --bench encode                 the thesis's box of 1e5 particles, frame 9 of the dam break
//! cargo bench --bench encode -- FILE FILE    images with any channels, as this program writes them
//! ```

#![expect(clippy::print_stdout, reason = "the table is what it is for")]

use std::env;
use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression as Codec, Encoding, FlatSamples, Image,
    ImageAttributes, IntegerBounds, Layer, LayerAttributes, LineOrder, ReadChannels, ReadLayers,
    WritableImage, f16, read,
};
use spherule::output::{
    ExrLayout, ExrOptions, PackBuffers, PlaneNames, pack_block, plane_channels, write_blocks,
};
use spherule::render::{Channels, Film, FilmPlane};

#[path = "support/cpu_time.rs"]
mod cpu_time;

use cpu_time::CpuTime;

/// Turns of each; the best counts.
const TURNS: usize = 7;
/// Name to filter by on the command line.
const NAME: &str = "encode";
const ALL: &str = "RGBA,Z,N,id,P,V,albedo";

fn main() {
    let given: Vec<String> = env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let has = |flag: &str| env::args().any(|argument| argument == flag);
    let files: Vec<PathBuf> = given.iter().map(PathBuf::from).collect();
    let are_files = files.iter().all(|file| file.is_file());
    // One word is the name of a benchmark, as other benchmarks take it.
    if has("--list") || (!are_files && !given.iter().any(|name| NAME.contains(&name[..]))) {
        return;
    }
    let is_quick = has("--test") || !has("--bench");
    let turns = if is_quick { 1 } else { TURNS };
    println!("CPU seconds of one thread, best of {turns} turns, and bytes; ratio: crate / here");
    println!(
        "{:<34} {:>8} {:>8} {:>6} {:>11} {:>11} {:>7}",
        "", "crate", "here", "ratio", "crate", "here", "bytes"
    );
    if are_files && !files.is_empty() {
        files.iter().for_each(|file| print_rows(file, turns));
        return;
    }
    let place = tempfile::tempdir().expect("a temporary directory");
    for image in rendered(place.path(), is_quick) {
        print_rows(&image, turns);
    }
}

/// Images with all channels.
fn rendered(place: &Path, is_quick: bool) -> Vec<PathBuf> {
    let path = |path: PathBuf| path.to_str().expect("a plain path").to_owned();
    let dam = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/dam-break");
    let cubes = path(place.join("box.npy"));
    run(&["generate", "box", "--particles", "1e5", "-o", &cubes]);
    let size: &[&str] = if is_quick {
        &["--width", "96", "--height", "54", "--samples", "1"]
    } else {
        &["--width", "1920", "--height", "1080", "--samples", "16"]
    };
    let inputs = [("box", cubes, "0"), ("dam", path(dam), "9")];
    let image = |(name, input, frame): (&str, String, &str)| {
        // A job has one input, and a directory is a job.
        let output = path(place.join(name).join("image.####.exr"));
        let what = ["render", &input, "-o", &output, "--frames", frame];
        run(&[&what[..], &["--channels", ALL], size].concat());
        let image = place.join(format!("{name}.exr"));
        fs::rename(place.join(name).join(format!("image.{frame:0>4}.exr")), &image)
            .expect("an image");
        image
    };
    inputs.into_iter().map(image).collect()
}

/// The program itself.
fn run(arguments: &[&str]) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_spherule"));
    command.args(arguments).stdout(Stdio::null());
    let output = command.stderr(Stdio::piped()).output().expect("started");
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {error}");
}

fn print_rows(file: &Path, turns: usize) {
    let film = film(file);
    let has = film.channels();
    let data = among(&film, &[FilmPlane::Depth, FilmPlane::Normal, FilmPlane::Id]);
    let name = file.file_stem().unwrap_or_default().to_string_lossy();
    let mut done = Vec::new();
    for (set, channels) in [("RGBA", Channels::COLOR), ("Z N id", data), ("all", has)] {
        if !done.contains(&channels) {
            print_row(&format!("{name}: {set}"), &with(&film, channels), turns);
            done.push(channels);
        }
    }
}

fn print_row(name: &str, film: &Film, turns: usize) {
    let mut best = [f64::INFINITY; 2];
    let mut bytes = [0; 2];
    for _ in 0..turns {
        for (way, encode) in [by_the_crate, packed_here].into_iter().enumerate() {
            let start = CpuTime::now();
            bytes[way] = encode(film);
            best[way] = best[way].min(start.seconds());
        }
    }
    println!(
        "{name:<34} {:>8.3} {:>8.3} {:>6.2} {:>11} {:>11} {:>+6.1}%",
        best[0],
        best[1],
        best[0] / best[1],
        bytes[0],
        bytes[1],
        100.0 * (bytes[1] as f64 / bytes[0] as f64 - 1.0),
    );
}

fn packed_here(film: &Film) -> usize {
    let layout = ExrLayout::of(film, &ExrOptions::default()).expect("a layout");
    let mut buffers = PackBuffers::default();
    let blocks = layout.blocks(film.rows()).map(|rows| pack_block(&rows, &layout, &mut buffers));
    let mut file = Cursor::new(Vec::new());
    write_blocks(&mut file, &layout, blocks).expect("an image");
    file.into_inner().len()
}

/// Planes turned into those of the crate one after the other, then written by it on one thread.
fn by_the_crate(film: &Film) -> usize {
    let mut list = Vec::new();
    for (component, name) in ["R", "G", "B", "A"].into_iter().enumerate() {
        let values = film.color.iter().map(|color| color[component]);
        let halves = values.map(|v| f16::from_f32(v.clamp(-65_504.0, 65_504.0)));
        list.push(AnyChannel::new(name, FlatSamples::F16(halves.collect())));
    }
    for plane in FilmPlane::all().filter(|plane| film.channels.has(*plane)) {
        let names = plane_channels(plane, film.channels, &PlaneNames::default());
        let words = film.plane::<u32>(plane).expect("a channel");
        for (component, name) in names.iter().enumerate() {
            let samples = words.iter().copied().skip(component).step_by(names.len());
            let samples = match plane {
                FilmPlane::Id => FlatSamples::U32(samples.collect()),
                _ => FlatSamples::F32(samples.map(f32::from_bits).collect()),
            };
            list.push(AnyChannel::new(&**name, samples));
        }
    }
    let size = (film.width as usize, film.height as usize);
    let encoding = Encoding {
        compression: Codec::ZIP16,
        blocks: Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    let channels = AnyChannels::sort(list.into());
    let layer = Layer::new(size, LayerAttributes::default(), encoding, channels);
    let window = IntegerBounds::from_dimensions(size);
    let image = Image::empty(ImageAttributes::new(window)).with_layer(layer);
    let mut file = Cursor::new(Vec::new());
    let writer = image.write().non_parallel();
    writer.to_buffered(&mut file).expect("an image");
    file.into_inner().len()
}

/// Those of `planes` that `film` has.
fn among(film: &Film, planes: &[FilmPlane]) -> Channels {
    let planes = planes.iter().copied().filter(|plane| film.channels.has(*plane));
    Channels::COLOR.with(&planes.collect::<Vec<_>>())
}

/// The planes of `film` that are among `channels`.
fn with(film: &Film, channels: Channels) -> Film {
    let mut part = Film::new(film.width, film.height, channels);
    part.color.clone_from(&film.color);
    for plane in FilmPlane::all() {
        if let (Some(to), Some(from)) = (part.plane_mut::<u32>(plane), film.plane(plane)) {
            to.copy_from_slice(from);
        }
    }
    part
}

/// The film that `file` was made of, its colours as halves.
fn film(file: &Path) -> Film {
    let bytes = fs::read(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let layer = image.layer_data;
    let plane = |name: &str| {
        let mut list = layer.channel_data.list.iter();
        let channel = list.find(|c| c.name.eq(name));
        channel.map(|c| &c.sample_data)
    };
    let floats =
        |name: &str| plane(name).map(|samples| samples.values_as_f32().collect::<Vec<f32>>());
    let color = ["R", "G", "B", "A"].map(|name| floats(name).expect("colours"));
    let side = |pixels: usize| u32::try_from(pixels).expect("a side");
    // Data planes, as far as the file has all of their channels
    let names = |plane: &FilmPlane| plane_channels(*plane, Channels::ALL, &PlaneNames::default());
    let is_stored =
        |p: &FilmPlane| Channels::ALL.has(*p) && names(p).iter().all(|n| plane(n).is_some());
    let planes: Vec<FilmPlane> = FilmPlane::all().filter(is_stored).collect();
    let channels = Channels::COLOR.with(&planes);
    let mut film = Film::new(side(layer.size.x()), side(layer.size.y()), channels);
    film.color = (0..color[0].len()).map(|at| std::array::from_fn(|c| color[c][at])).collect();
    for of_film in planes {
        let count = channels.components(of_film);
        let words = film.plane_mut::<u32>(of_film).expect("a channel");
        for (component, name) in names(&of_film).iter().enumerate() {
            let to = words.iter_mut().skip(component).step_by(count);
            match plane(name) {
                Some(FlatSamples::U32(ids)) => to.zip(ids).for_each(|(to, id)| *to = *id),
                Some(other) => to.zip(other.values_as_f32()).for_each(|(to, v)| *to = v.to_bits()),
                None => {}
            }
        }
    }
    film
}
