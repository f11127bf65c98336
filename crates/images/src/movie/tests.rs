//! Movies that are read again by other decoders.

use std::cell::RefCell;
use std::fs::{self, File};
use std::io::BufReader;

use super::*;
use crate::output::view::DisplayView;
use crate::picture::is_own_file;

/// A grey ramp with a coloured square that moves.
fn picture(step: usize) -> Picture {
    let ramp = |i: usize| [u8::try_from(60 + i % 41).unwrap(); 3];
    let mut picture = Picture::new(41, 27, (0..41 * 27).flat_map(ramp).collect());
    picture.put(&Picture::filled(6, 5, [220, 40, 10]), 3 + 7 * step, 2 + 5 * step);
    picture
}

/// Writes three pictures; the second is shown twice.
fn source(dir: &Path) -> MovieSource {
    let write = |step: usize| {
        let path = dir.join(format!("f.{step}.png"));
        fs::write(&path, picture(step).png("test").unwrap()).unwrap();
        path
    };
    MovieSource {
        paths: (0..3).map(write).collect(),
        repeats: vec![1, 2, 1],
        rate: FrameRate::new(30.0).unwrap(),
        width: None,
        view: DisplayView::default(),
    }
}

/// A movie of `source` in a format, and its file.
fn movie(name: &str, source: &MovieSource, dir: &Path) -> PathBuf {
    let path = dir.join(name);
    let format = MovieFormat::of(&path, None).unwrap();
    let finished = write_movie(source, format, &path, &()).unwrap();
    assert_eq!(finished.shown, 4);
    assert_eq!(finished.bytes, fs::metadata(&path).unwrap().len());
    assert!(is_own_file(&path), "{name}");
    path
}

#[test]
fn gif_is_near_and_keeps_the_time() {
    let dir = tempfile::tempdir().unwrap();
    let path = movie("a.gif", &source(dir.path()), dir.path());
    let mut options = ::gif::DecodeOptions::new();
    options.set_color_output(::gif::ColorOutput::RGBA);
    let mut decoder = options.read_info(File::open(path).unwrap()).unwrap();
    assert_eq!((decoder.width(), decoder.height()), (41, 27));
    assert_eq!(decoder.repeat(), ::gif::Repeat::Infinite);
    let mut canvas = Picture::filled(41, 27, [0; 3]).pixels().to_vec();
    let mut delays = Vec::new();
    for step in 0..3 {
        let frame = decoder.read_next_frame().unwrap().unwrap();
        delays.push(frame.delay);
        let (left, top, width) =
            (usize::from(frame.left), usize::from(frame.top), usize::from(frame.width));
        for (i, pixel) in frame.buffer.as_chunks::<4>().0.iter().enumerate() {
            if pixel[3] == 255 {
                canvas[(top + i / width) * 41 + left + i % width] = [pixel[0], pixel[1], pixel[2]];
            }
        }
        // 42 colours fit into the palette
        assert_eq!(canvas, picture(step).pixels(), "{step}");
    }
    assert!(decoder.read_next_frame().unwrap().is_none());
    assert_eq!(delays, [3, 7, 3]);
}

#[test]
fn animated_png_is_exact() {
    let dir = tempfile::tempdir().unwrap();
    let path = movie("a.png", &source(dir.path()), dir.path());
    let mut reader =
        png::Decoder::new(BufReader::new(File::open(path).unwrap())).read_info().unwrap();
    let animation = reader.info().animation_control().copied().unwrap();
    assert_eq!((animation.num_frames, animation.num_plays), (3, 0));
    let mut canvas = Picture::filled(41, 27, [0; 3]);
    let mut delays = Vec::new();
    for step in 0..3 {
        let mut bytes = vec![0; reader.output_buffer_size()];
        let frame = reader.next_frame(&mut bytes).unwrap();
        bytes.truncate(frame.buffer_size());
        let control = *reader.info().frame_control().unwrap();
        delays.push((control.delay_num, control.delay_den));
        let piece = Picture::new(frame.width as usize, frame.height as usize, bytes);
        canvas.put(&piece, control.x_offset as usize, control.y_offset as usize);
        assert_eq!(canvas, picture(step), "{step}");
    }
    assert_eq!(delays, [(33, 1000), (67, 1000), (33, 1000)]);
}

#[test]
fn animated_webp_is_exact() {
    let dir = tempfile::tempdir().unwrap();
    let path = movie("a.webp", &source(dir.path()), dir.path());
    let mut decoder =
        image_webp::WebPDecoder::new(BufReader::new(File::open(path).unwrap())).unwrap();
    assert_eq!(decoder.dimensions(), (41, 27));
    assert!(decoder.is_animated() && decoder.num_frames() == 3);
    assert_eq!(decoder.loop_count(), image_webp::LoopCount::Forever);
    let mut durations = Vec::new();
    for step in 0..3 {
        let mut bytes = vec![0; decoder.output_buffer_size().unwrap()];
        durations.push(decoder.read_frame(&mut bytes).unwrap());
        let channels = bytes.len() / (41 * 27);
        let rgb = bytes.chunks(channels).flat_map(|pixel| pixel[..3].to_vec()).collect();
        assert_eq!(Picture::new(41, 27, rgb), picture(step), "{step}");
    }
    assert_eq!(durations, [33, 67, 33]);
}

#[test]
fn pictures_of_several_sizes_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let source = source(dir.path());
    fs::write(&source.paths[2], Picture::filled(40, 27, [0; 3]).png("test").unwrap()).unwrap();
    for name in ["a.gif", "a.png", "a.webp"] {
        let path = dir.path().join(name);
        let error =
            write_movie(&source, MovieFormat::of(&path, None).unwrap(), &path, &()).unwrap_err();
        let text = error.to_string();
        assert!(
            text.contains("f.2.png: has 40x27 pixels, but the first picture has 41x27"),
            "{text}"
        );
        assert!(!path.exists());
    }
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 3, "temporary files are removed");
}

#[test]
fn a_stopped_movie_leaves_nothing() {
    struct StopAfter(RefCell<usize>);
    impl Observer for StopAfter {
        fn stops(&self) -> bool {
            *self.0.borrow() == 0
        }
        fn on_picture(&self, _: usize) {
            let left = self.0.borrow().saturating_sub(1);
            self.0.replace(left);
        }
    }
    let dir = tempfile::tempdir().unwrap();
    let source = source(dir.path());
    for name in ["a.gif", "a.png", "a.webp"] {
        let path = dir.path().join(name);
        let observer = StopAfter(RefCell::new(2));
        let stopped = write_movie(&source, MovieFormat::of(&path, None).unwrap(), &path, &observer);
        assert!(matches!(stopped, Err(MovieError::Stopped)));
    }
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 3);
}

#[test]
fn changes_are_bounded() {
    let before = [0; 12];
    assert_eq!(changed(&before, &before, 4), None);
    let mut now = before;
    now[5] = 1;
    assert_eq!(changed(&before, &now, 4), Some([1, 1, 2, 2]));
    now[10] = 1;
    assert_eq!(changed(&before, &now, 4), Some([1, 1, 3, 3]));
    now = [1; 12];
    assert_eq!(changed(&before, &now, 4), Some([0, 0, 4, 3]));
}
