//! `spherule sheet`: a contact sheet of the finished pictures of a job.

use std::path::PathBuf;

use clap::Args;

use super::pictures::{JobPicture, JobPictures, PicturesArgs, SIGNAL_MESSAGES, Watch};
use super::{CliError, Outcome, print, signals};
use crate::metrics::counted;
use crate::movie::{MovieError, SheetSettings, write_sheet};

const EXAMPLES: &str = "\
Examples:
  spherule sheet out -o sheet.png
      All frames
  spherule sheet out -o sheet.png --count 12 --columns 4 --width 2400
      Twelve frames, evenly chosen from the first to the last
  spherule sheet out/job.toml --frames 100-200x10 -o sheet.png
      Every tenth of some frames";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct SheetArgs {
    #[command(flatten)]
    pictures: PicturesArgs,
    /// PNG to write.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Number of frames, evenly chosen with the first and the last [default: all].
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u16).range(1..))]
    count: Option<u16>,
    /// Number of columns [default: for a sheet of about 16:10].
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u16).range(1..))]
    columns: Option<u16>,
    /// Largest width of the sheet in pixels. Pictures are never enlarged.
    #[arg(long, value_name = "PIXELS", default_value_t = 1920, value_parser = clap::value_parser!(u16).range(1..))]
    width: u16,
    /// Distance between pictures in pixels.
    #[arg(long, value_name = "PIXELS", default_value_t = 8, value_parser = clap::value_parser!(u16).range(..=1000))]
    gap: u16,
    /// Replace a file that was not made by this command.
    #[arg(long)]
    force: bool,
}

pub(super) fn run(args: &SheetArgs) -> Result<Outcome, CliError> {
    let signals = signals::listen(SIGNAL_MESSAGES)?;
    if !args.output.extension().is_some_and(|e| e.eq_ignore_ascii_case("png")) {
        let text = format!("--output {}: the name must end in .png", args.output.display());
        return Err(CliError::other(text));
    }
    let pictures = JobPictures::read(&args.pictures)?;
    pictures.require_any()?;
    if let Some(gaps) = pictures.gaps() {
        message!("{gaps}; the sheet shows what is there");
    }
    pictures.guard(&args.output, args.force)?;
    let chosen = chosen(&pictures.pictures, args.count.map(usize::from));
    let paths: Vec<PathBuf> = chosen.iter().map(|picture| picture.picture.clone()).collect();
    let settings = SheetSettings {
        columns: args.columns.map(usize::from),
        width: usize::from(args.width),
        gap: usize::from(args.gap),
        exposure: pictures.exposure,
    };
    let watch = Watch(signals.start_work());
    let layout = match write_sheet(&paths, &settings, &args.output, &watch) {
        Ok(layout) => layout,
        Err(MovieError::Stopped) => {
            message!("{}", SIGNAL_MESSAGES.stopped);
            return Ok(Outcome::Interrupted);
        }
        Err(error @ MovieError::Picture(_)) => return Err(pictures.explain(&error)),
        Err(error) => {
            return Err(CliError::other(format!("{}: {error}", args.output.display())));
        }
    };
    let numbers: Vec<i64> = chosen.iter().map(|picture| picture.number).collect();
    print::lines([format!(
        "{}: {}x{}, {} of {}x{}, frames {}",
        args.output.display(),
        layout.size[0],
        layout.size[1],
        counted(layout.cells[0], "column"),
        layout.cell[0],
        layout.cell[1],
        super::job::list(&numbers)
    )])?;
    Ok(Outcome::Done)
}

/// `count` pictures at even distances, with the first and the last one; all if there are fewer.
fn chosen(pictures: &[JobPicture], count: Option<usize>) -> Vec<&JobPicture> {
    let total = pictures.len();
    let count = count.unwrap_or(total).min(total);
    let index = |i: usize| match count {
        // One picture: the middle one
        1 => total / 2,
        _ => (i * (total - 1) + (count - 1) / 2) / (count - 1),
    };
    (0..count).map(|i| &pictures[index(i)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(total: i64, count: Option<usize>) -> Vec<i64> {
        let picture =
            |number| JobPicture { number, picture: PathBuf::new(), image: PathBuf::new() };
        let pictures: Vec<JobPicture> = (1..=total).map(picture).collect();
        chosen(&pictures, count).iter().map(|picture| picture.number).collect()
    }

    #[test]
    fn frames_are_chosen_evenly() {
        assert_eq!(numbers(3, None), [1, 2, 3]);
        assert_eq!(numbers(3, Some(9)), [1, 2, 3]);
        assert_eq!(numbers(9, Some(3)), [1, 5, 9]);
        assert_eq!(numbers(10, Some(4)), [1, 4, 7, 10]);
        assert_eq!(numbers(9, Some(1)), [5]);
        assert_eq!(numbers(0, Some(1)), [0; 0]);
    }
}
