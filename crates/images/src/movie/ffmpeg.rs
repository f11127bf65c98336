//! Movies by an installed `ffmpeg`: raw pictures through a pipe, so that it needs no list of files.
//!
//! `ffmpeg` writes the temporary file of a [`Publisher`]. If it fails or is stopped, that file is removed.

use std::collections::VecDeque;
use std::ffi::OsString;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use spherule_files::Publisher;

use super::{Codec, Container, MovieError, MovieFormat, MovieSource, Observer, quoted, shell_line};
use crate::picture::{EXR_EXTENSION, MARKER};

/// The program.
pub const FFMPEG: &str = "ffmpeg";

/// Number of last lines of its standard error in messages.
const MAX_LINES: usize = 6;

/// Longest part of a line in messages, bytes.
const MAX_LINE: u64 = 400;

/// Time between two checks whether `ffmpeg` has ended or shall stop.
const PAUSE: Duration = Duration::from_millis(10);

/// Whether `ffmpeg` can be started.
pub fn ffmpeg_is_installed() -> bool {
    let mut command = Command::new(FFMPEG);
    command.arg("-version").stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command.status().is_ok()
}

/// Writes the movie to the temporary file of `file`.
pub(super) fn write(
    source: &MovieSource,
    size: [usize; 2],
    container: Container,
    codec: Codec,
    file: &Publisher,
    observer: &dyn Observer,
) -> Result<(), MovieError> {
    // Start ffmpeg, and send the pictures to its input as often as they are shown
    let arguments = arguments(source, size, container, codec, file.part());
    let mut process = Process::start(&arguments)?;
    let sent = source.each(observer, |picture, repeats| {
        let picture = picture.padded(size[0], size[1]);
        for _ in 0..repeats {
            if observer.stops() {
                return Err(MovieError::Stopped);
            }
            process.send(picture.rgb())?;
        }
        Ok(())
    });
    // An error of ffmpeg explains why the pipe broke
    match sent {
        Ok(()) => process.finish(observer),
        Err(error) => Err(process.explain(error)),
    }
}

/// All arguments, for pictures of `size` on standard input.
fn arguments(
    source: &MovieSource,
    [width, height]: [usize; 2],
    container: Container,
    codec: Codec,
    path: &Path,
) -> Vec<OsString> {
    let mut all: Vec<OsString> =
        ["-hide_banner", "-loglevel", "error", "-nostdin", "-y"].map(Into::into).into();
    let video_size = format!("{width}x{height}");
    let rate = source.rate.to_string();
    all.extend(["-f", "rawvideo", "-pixel_format", "rgb24", "-video_size"].map(Into::into));
    all.extend([&video_size, "-framerate", &rate, "-i", "pipe:0"].map(Into::into));
    all.extend(output_arguments(container, codec, None));
    all.extend(["-f", container.muxer()].map(Into::into));
    // Names may begin with a hyphen or contain a colon
    let mut name = OsString::from("file:");
    name.push(path);
    all.push(name);
    all
}

/// Arguments for codec, colours and container; `filter` is applied first.
fn output_arguments(container: Container, codec: Codec, filter: Option<&str>) -> Vec<OsString> {
    let first = filter.map(|filter| format!("{filter},")).unwrap_or_default();
    // sRGB has the primaries of BT.709. Without a matrix and its name, players guess by the size.
    let filters = format!(
        "{first}scale=out_color_matrix=bt709:out_range=tv:flags=lanczos+accurate_rnd+full_chroma_int,format={}",
        codec.pixel_format()
    );
    let mut all: Vec<OsString> = vec!["-vf".into(), filters.into()];
    all.extend(codec.arguments().iter().map(Into::into));
    let colors = ["-color_range", "tv", "-colorspace", "bt709", "-color_primaries", "bt709"];
    all.extend(colors.map(Into::into));
    all.extend(["-color_trc", "iec61966-2-1"].map(Into::into));
    let comment = format!("comment={MARKER}");
    all.extend(["-metadata", &comment].map(Into::into));
    if matches!(container, Container::Mp4 | Container::Mov) {
        // The index first, so that players start before they have the whole file
        all.extend(["-movflags", "+faststart"].map(Into::into));
    }
    all
}

/// A command line that makes the movie by hand; None if there are no PNG files.
pub fn by_hand(source: &MovieSource, format: MovieFormat, path: &Path) -> Option<String> {
    let MovieFormat::Ffmpeg { container, codec } = format else {
        return None;
    };
    // EXR files cannot be given to ffmpeg
    let first = source.paths.first()?;
    if first.extension().is_none_or(|e| e.eq_ignore_ascii_case(EXR_EXTENSION)) {
        return None;
    }
    // Collect the options of the output
    let rate = source.rate.to_string();
    let scale = source.width.map(|width| format!("scale='min({width},iw)':-1:flags=lanczos,"));
    let filter = format!("{}pad=ceil(iw/2)*2:ceil(ih/2)*2", scale.unwrap_or_default());
    let mut output = output_arguments(container, codec, Some(&filter));
    output.push(plain_name(&path.to_string_lossy()).into());
    let output = shell_line(&output);
    // Numbered files can be named by a pattern, others are sent one after the other
    if let Some((pattern, start)) = consecutive(source) {
        let pattern = quoted(&plain_name(&pattern));
        return Some(format!(
            "{FFMPEG} -framerate {rate} -start_number {start} -i {pattern} {output}"
        ));
    }
    let (before, _, after) = number_in(first.to_str()?)?;
    let files = format!("{}*{}", quoted(&plain_name(before)), quoted(after));
    Some(format!("cat {files} | {FFMPEG} -f image2pipe -framerate {rate} -c:v png -i - {output}"))
}

/// `path` in a form that programs take neither for an option nor for the name of a protocol.
fn plain_name(path: &str) -> String {
    let first = path.split('/').next().unwrap_or_default();
    if first.starts_with('-') || first.contains(':') {
        format!("./{path}")
    } else {
        path.to_owned()
    }
}

/// The pattern and the first number of files with consecutive numbers, each shown once.
fn consecutive(source: &MovieSource) -> Option<(String, u64)> {
    let first = source.paths.first()?.to_str()?;
    let (before, digits, after) = number_in(first)?;
    let start: u64 = digits.parse().ok()?;
    let width = digits.len();
    let is_next = |(path, number): (&std::path::PathBuf, u64)| {
        path.to_str() == Some(format!("{before}{number:0width$}{after}").as_str())
    };
    let is_once = source.repeats.iter().all(|repeats| *repeats == 1);
    let is_plain = !before.contains('%') && !after.contains('%');
    (is_once && is_plain && source.paths.iter().zip(start..).all(is_next))
        .then(|| (format!("{before}%0{width}d{after}"), start))
}

/// The last number in a file name: what is before, its digits, and what follows.
fn number_in(path: &str) -> Option<(&str, &str, &str)> {
    let end = path.rfind(|c: char| c.is_ascii_digit())? + 1;
    let start = path[..end].rfind(|c: char| !c.is_ascii_digit()).map_or(0, |at| at + 1);
    Some((&path[..start], &path[start..end], &path[end..]))
}

/// A running `ffmpeg`, stopped when dropped.
struct Process {
    child: Child,
    /// None once all pictures are sent.
    input: Option<ChildStdin>,
    /// Collects the last lines of standard error.
    errors: Option<JoinHandle<Vec<String>>>,
}

impl Process {
    fn start(arguments: &[OsString]) -> Result<Self, MovieError> {
        let mut command = Command::new(FFMPEG);
        command.args(arguments).stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
        // A Ctrl-C in the terminal is for this process, which then stops it
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn().map_err(|source| match source.kind() {
            io::ErrorKind::NotFound => MovieError::NoFfmpeg,
            _ => MovieError::Io { path: FFMPEG.into(), source },
        })?;
        let stderr = child.stderr.take().expect("standard error is piped");
        Ok(Self {
            input: child.stdin.take(),
            errors: Some(thread::spawn(move || last_lines(stderr))),
            child,
        })
    }

    /// Sends the bytes of a picture.
    fn send(&mut self, bytes: &[u8]) -> Result<(), MovieError> {
        let input = self.input.as_mut().expect("open until all pictures are sent");
        input.write_all(bytes).map_err(|source| MovieError::Io { path: FFMPEG.into(), source })
    }

    /// Waits for the end of the movie.
    fn finish(mut self, observer: &dyn Observer) -> Result<(), MovieError> {
        drop(self.input.take());
        loop {
            let ended = self
                .child
                .try_wait()
                .map_err(|source| MovieError::Io { path: FFMPEG.into(), source })?;
            match ended {
                Some(status) if status.success() => return Ok(()),
                Some(status) => return Err(self.failure(status)),
                None if observer.stops() => return Err(MovieError::Stopped),
                None => thread::sleep(PAUSE),
            }
        }
    }

    /// The reason why no more pictures could be sent: if the pipe broke, what `ffmpeg` printed before it ended.
    fn explain(mut self, error: MovieError) -> MovieError {
        let is_pipe = matches!(&error, MovieError::Io { path, .. } if path.as_os_str() == FFMPEG);
        if !is_pipe {
            return error;
        }
        drop(self.input.take());
        match self.child.wait() {
            Ok(status) => self.failure(status),
            Err(_) => error,
        }
    }

    /// The error of an `ffmpeg` that has ended too early or without success.
    fn failure(&mut self, status: ExitStatus) -> MovieError {
        let mut lines =
            self.errors.take().and_then(|errors| errors.join().ok()).unwrap_or_default();
        if lines.is_empty() {
            lines.push("it printed nothing".to_owned());
        }
        MovieError::Ffmpeg { status: status.to_string(), lines }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // Without effect if it has ended
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The last lines, each with its first bytes.
fn last_lines(errors: impl Read) -> Vec<String> {
    let mut errors = BufReader::new(errors);
    let mut lines = VecDeque::new();
    let mut line = Vec::new();
    // Pieces of long lines are lines
    while (&mut errors).take(MAX_LINE).read_until(b'\n', &mut line).is_ok_and(|read| read > 0) {
        let text = String::from_utf8_lossy(&line).trim().to_owned();
        if !text.is_empty() {
            lines.push_back(text);
        }
        if lines.len() > MAX_LINES {
            lines.pop_front();
        }
        line.clear();
    }
    lines.into()
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;
    use crate::movie::FrameRate;
    use crate::output::view::DisplayView;

    fn source(names: &[&str], repeats: u32) -> MovieSource {
        MovieSource {
            paths: names.iter().map(PathBuf::from).collect(),
            repeats: vec![repeats; names.len()],
            rate: FrameRate::new(25.0).unwrap(),
            width: None,
            view: DisplayView::default(),
        }
    }

    #[track_caller]
    fn check_by_hand(names: &[&str], repeats: u32, start: &str) {
        let format = MovieFormat::of(Path::new("a.mp4"), None).unwrap();
        let line = by_hand(&source(names, repeats), format, Path::new("it's.mp4")).unwrap();
        assert!(line.starts_with(start), "{line}");
        assert!(line.contains("-crf 16") && line.ends_with(r"'it'\''s.mp4'"), "{line}");
    }

    #[test]
    fn names_by_hand_are_neither_options_nor_protocols() {
        let format = MovieFormat::of(Path::new("a.mp4"), None).unwrap();
        let line = |names: &[&str], output: &str| {
            by_hand(&source(names, 1), format, Path::new(output)).unwrap()
        };
        let consecutive = line(&["concat:a|b/f.01.png"], "-y.mp4");
        assert!(consecutive.contains("-i './concat:a|b/f.%02d.png' "), "{consecutive}");
        assert!(consecutive.ends_with(" ./-y.mp4"), "{consecutive}");
        let piped = line(&["-n/f.1.png", "-n/f.3.png"], "a/b:c.mp4");
        assert!(piped.starts_with("cat ./-n/f.*.png |"), "{piped}");
        assert!(piped.ends_with(" a/b:c.mp4"), "{piped}");
    }

    #[test]
    fn command_lines_by_hand() {
        let consecutive = "ffmpeg -framerate 25 -start_number 9 -i 'out a/f.%03d.png' -vf";
        check_by_hand(&["out a/f.009.png", "out a/f.010.png"], 1, consecutive);
        let piped = "cat 'out a/f.'*.png | ffmpeg -f image2pipe -framerate 25 -c:v png -i -";
        check_by_hand(&["out a/f.009.png", "out a/f.011.png"], 1, piped);
        check_by_hand(&["out a/f.009.png", "out a/f.010.png"], 2, piped);
        check_by_hand(&["f%.1.png", "f%.2.png"], 1, "cat 'f%.'*.png");
        let format = MovieFormat::of(Path::new("a.mp4"), None).unwrap();
        assert_eq!(by_hand(&source(&["f.1.exr"], 1), format, Path::new("a.mp4")), None);
    }

    #[test]
    fn the_last_lines_are_kept() {
        let text = (0..50).map(|i| format!("line {i}\r\n\n")).collect::<String>();
        let lines = last_lines(text.as_bytes());
        assert_eq!(lines.first().unwrap(), "line 44");
        assert_eq!(lines.last().unwrap(), "line 49");
        let endless = last_lines(io::repeat(b'x').take(1 << 20));
        assert!(endless.len() == MAX_LINES && endless.iter().all(|line| line.len() <= 400));
    }
}
