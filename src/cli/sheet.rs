//! `spherule sheet`: contact sheets and figures of several panels, from the finished pictures of jobs and from files.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use spherule_files::counted;
use spherule_jobs::FrameRange;

use super::pictures::{JobPicture, JobPictures, PicturesArgs, SIGNAL_MESSAGES, Watch, guard};
use super::{CliError, Outcome, print, signals};
use crate::job::color_bar;
use crate::manifest::Side;
use crate::movie::{
    FinishedSheet, LetterStyle, MovieError, SheetBar, SheetFormat, SheetSettings, SheetSource,
    write_sheet,
};
use crate::output::PictureFormat;
use crate::output::view::DisplayView;
use crate::overlay::{ColorBar, ColorBarKind, Orientation};
use crate::picture::read_dpi;

const EXAMPLES: &str = "\
Examples:
  spherule sheet out -o sheet.png
      All frames
  spherule sheet out --frames 100-200x10 --count 4 --columns 2 --width 80mm --letters --colorbar -o figure.pdf
      A figure for a column of a journal: panels (a) to (d) with one colour bar
  spherule sheet coarse.png fine.png --letters=A -o both.png
      Pictures of `still`";

/// Default width in pixels.
const WIDTH: u32 = 1920;

/// Pixels per inch of sheets with a width on paper, unless the pictures or an option say it.
const DPI: u32 = 300;

/// Points in an inch.
const POINTS_PER_INCH: f32 = 72.0;

/// Height of text of sheets without a size on paper, as a fraction of their width.
const TEXT: f32 = 0.012;

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct SheetArgs {
    /// Render jobs (directories of images, or manifests), and pictures: .png or .exr.
    #[arg(required = true)]
    inputs: Vec<PathBuf>,
    /// Frames of the jobs to show: 7 | 1-10 | 1-10x2 | 1-5,8.
    #[arg(long, value_name = "RANGE", allow_hyphen_values = true)]
    frames: Option<FrameRange>,
    /// File to write: .png, or .pdf or .svg, whose letters and colour bar are text and shapes.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Number of frames of each job, evenly chosen with the first and the last [default: all].
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u16).range(1..))]
    count: Option<u16>,
    /// Number of columns [default: for a sheet of about 16:10].
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u16).range(1..))]
    columns: Option<u16>,
    /// Largest width of the sheet, in pixels or on paper: 80mm. Pictures are never enlarged [default: 1920].
    #[arg(long, value_name = "WIDTH", value_parser = Side::of_text)]
    width: Option<Side>,
    /// Pixels per inch on paper [default: that of the pictures, or 300 with a width on paper].
    #[arg(long, value_name = "DPI", value_parser = clap::value_parser!(u32).range(1..=4800))]
    dpi: Option<u32>,
    /// Distance between pictures in pixels.
    #[arg(long, value_name = "PIXELS", default_value_t = 8, value_parser = clap::value_parser!(u16).range(..=1000))]
    gap: u16,
    /// Letters in the corners of the pictures: (a), a, a), A, (A) [default style: (a)].
    #[arg(long, value_name = "STYLE", num_args = 0..=1, require_equals = true, default_missing_value = "(a)")]
    letters: Option<LetterStyle>,
    /// One colour bar for all pictures of jobs, which must have the same colours and range.
    #[arg(long, value_name = "PLACE", num_args = 0..=1, require_equals = true, default_missing_value = "right",
        visible_alias = "legend", value_enum)]
    colorbar: Option<BarPlace>,
    /// Title of the colour bar [default: that of the jobs].
    #[arg(long, value_name = "TEXT", requires = "colorbar")]
    title: Option<String>,
    /// Unit of the colour bar, after its title [default: that of the jobs].
    #[arg(long, value_name = "UNIT", requires = "colorbar")]
    unit: Option<String>,
    /// Height of letters and labels on paper, in points; for sheets with a number of pixels per inch.
    #[arg(long, value_name = "POINTS", default_value_t = 7.0, value_parser = points)]
    text_size: f32,
    /// Replace a file that was not made by this command.
    #[arg(long)]
    force: bool,
}

/// Where the colour bar is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum BarPlace {
    /// Vertical, at the right of the pictures
    Right,
    /// Horizontal, below the pictures
    Below,
}

/// A size of text: 1 to 100 points.
fn points(text: &str) -> Result<f32, String> {
    let number = text.trim().trim_end_matches("pt").trim_end().parse();
    let points = number.ok().filter(|points| (1.0..=100.0).contains(points));
    points.ok_or_else(|| format!("`{text}` is no size of text from 1 to 100 points"))
}

/// The pictures of all inputs, in their order.
#[derive(Default)]
struct Inputs {
    sources: Vec<SheetSource>,
    /// What the line about the sheet says of each input.
    shown: Vec<String>,
    jobs: Vec<JobPictures>,
    has_files: bool,
}

impl Inputs {
    fn read(args: &SheetArgs) -> Result<Self, CliError> {
        let mut inputs = Self::default();
        for path in &args.inputs {
            let is_picture =
                matches!(PictureFormat::of(path), Some(PictureFormat::Png | PictureFormat::Exr));
            if is_picture && !path.is_dir() {
                inputs
                    .sources
                    .push(SheetSource { path: path.clone(), view: DisplayView::default() });
                inputs.shown.push(path.display().to_string());
                inputs.has_files = true;
            } else {
                inputs.add_job(path, args)?;
            }
        }
        Ok(inputs)
    }

    fn add_job(&mut self, job: &Path, args: &SheetArgs) -> Result<(), CliError> {
        let request = PicturesArgs { job: job.to_owned(), frames: args.frames.clone() };
        let pictures = JobPictures::read(&request)?;
        pictures.require_any()?;
        if let Some(gaps) = pictures.gaps() {
            message!("{gaps}; the sheet shows what is there");
        }
        pictures.guard(&args.output, args.force)?;
        let chosen = chosen(&pictures.pictures, args.count.map(usize::from));
        let numbers: Vec<i64> = chosen.iter().map(|picture| picture.number).collect();
        self.shown.push(format!("frames {}", super::job::list(&numbers)));
        self.sources.extend(
            chosen
                .into_iter()
                .map(|picture| SheetSource { path: picture.picture.clone(), view: pictures.view }),
        );
        self.jobs.push(pictures);
        Ok(())
    }

    /// Refuses an output that is one of the inputs.
    fn guard(&self, output: &Path, force: bool) -> Result<(), CliError> {
        let real = output.canonicalize().ok();
        let is_output =
            |source: &&SheetSource| real.is_some() && source.path.canonicalize().ok() == real;
        if let Some(source) = self.sources.iter().find(is_output) {
            let text = "is an input and would be overwritten; choose another name";
            return Err(CliError::other(format!("{}: {text}", source.path.display())));
        }
        guard(output, force)
    }

    /// The density that all pictures have; None if one has none or another.
    fn dpi(&self) -> Result<Option<u32>, CliError> {
        let mut all = self.sources.iter().map(|source| read_dpi(&source.path));
        let Some(first) = all.next().transpose().map_err(|e| CliError::other(e.to_string()))?
        else {
            return Ok(None);
        };
        for dpi in all {
            if dpi.map_err(|e| CliError::other(e.to_string()))? != first {
                return Ok(None);
            }
        }
        Ok(first)
    }

    /// The colour bar of all jobs.
    fn color_bar(&self) -> Result<ColorBar, CliError> {
        let error = |text: String| CliError::other(format!("--colorbar: {text}"));
        // Pictures alone do not say what their colours mean
        if self.has_files {
            let text = "pictures from files do not say what their colours mean; give the jobs of all panels, or draw \
                        the colour bar in the pictures (still --colorbar)";
            return Err(error(text.to_owned()));
        }
        let mut first: Option<(&Path, ColorBar)> = None;
        // Compare the colour bars of all jobs
        for job in &self.jobs {
            let dir = job.state.dir();
            let bar =
                color_bar(&job.state).map_err(|e| error(format!("{}: {e}", dir.display())))?;
            let bar = bar.ok_or_else(|| {
                let text = "the colours of the particles do not follow a colour map; render it with --color-by";
                error(format!("{}: {text}", dir.display()))
            })?;
            match &first {
                None => first = Some((dir, bar)),
                Some((first_dir, common)) => {
                    if let Some(difference) = difference(common, &bar) {
                        let [own, other] = [first_dir, dir].map(Path::display);
                        return Err(error(format!(
                            "{own} and {other} have different {difference}"
                        )));
                    }
                }
            }
        }
        first.map(|(_, bar)| bar).ok_or_else(|| error("there is no job".to_owned()))
    }
}

/// In what two colour bars differ, and how to make them equal; None if they show the same.
fn difference(a: &ColorBar, b: &ColorBar) -> Option<String> {
    // Titles first: other values have other ranges as well
    if a.title != b.title {
        return Some(format!("titles: {} and {} (--title of render)", a.title, b.title));
    }
    match (&a.kind, &b.kind) {
        (
            ColorBarKind::Numbers { range: [low, high], .. },
            ColorBarKind::Numbers { range: [other_low, other_high], .. },
        ) if [low, high] != [other_low, other_high] => Some(format!(
            "ranges: {low} to {high}, and {other_low} to {other_high} (render them with --range {} {})",
            low.min(*other_low),
            high.max(*other_high)
        )),
        (ColorBarKind::Numbers { scale, .. }, ColorBarKind::Numbers { scale: other, .. })
            if scale != other =>
        {
            Some("scales (render them with one --color-scale)".to_owned())
        }
        (a, b) if a != b => Some("maps or categories (render them with one --map)".to_owned()),
        _ if a.unit != b.unit || a.factor != b.factor => {
            Some(format!("units: {} and {} (--unit of render)", a.unit, b.unit))
        }
        _ => None,
    }
}

impl SheetArgs {
    fn format(&self) -> Result<SheetFormat, CliError> {
        match PictureFormat::of(&self.output) {
            Some(PictureFormat::Png) => Ok(SheetFormat::Png),
            Some(PictureFormat::Pdf) => Ok(SheetFormat::Pdf),
            Some(PictureFormat::Svg) => Ok(SheetFormat::Svg),
            _ => Err(CliError::other(format!(
                "--output {}: the name must end in .png, .pdf or .svg",
                self.output.display()
            ))),
        }
    }

    fn settings(&self, inputs: &Inputs) -> Result<SheetSettings, CliError> {
        // Find the resolution and the width, which may be given on paper
        let own = self.dpi.map_or_else(|| inputs.dpi(), |dpi| Ok(Some(dpi)))?;
        let side = self.width.unwrap_or(Side::Pixels(WIDTH));
        let dpi = own.or_else(|| side.is_on_paper().then_some(DPI));
        let width = side.pixels(dpi.unwrap_or(DPI)).max(1);
        // Make the colour bar
        let bar = self.colorbar.map(|place| {
            let mut bar = inputs.color_bar()?;
            bar.title = self.title.clone().unwrap_or(bar.title);
            bar.unit = self.unit.clone().unwrap_or(bar.unit);
            bar.orientation = match place {
                BarPlace::Right => Orientation::Vertical,
                BarPlace::Below => Orientation::Horizontal,
            };
            Ok::<_, CliError>(SheetBar { bar })
        });
        Ok(SheetSettings {
            columns: self.columns.map(usize::from),
            width: width as usize,
            gap: usize::from(self.gap),
            dpi,
            text: match dpi {
                Some(dpi) => self.text_size / POINTS_PER_INCH * dpi as f32,
                None => TEXT * width as f32,
            },
            letters: self.letters.clone(),
            bar: bar.transpose()?,
            format: self.format()?,
        })
    }
}

pub(super) fn run(args: &SheetArgs) -> Result<Outcome, CliError> {
    let signals = signals::listen(SIGNAL_MESSAGES)?;
    // Check everything before pictures are read
    args.format()?;
    let inputs = Inputs::read(args)?;
    inputs.guard(&args.output, args.force)?;
    let settings = args.settings(&inputs)?;
    // Write the sheet
    let watch = Watch(signals.start_work());
    let sheet = match write_sheet(&inputs.sources, &settings, &args.output, &watch) {
        Ok(sheet) => sheet,
        Err(MovieError::Stopped) => {
            message!("{}", SIGNAL_MESSAGES.stopped);
            return Ok(Outcome::Interrupted);
        }
        Err(error @ MovieError::Picture(_)) => {
            return Err(match &inputs.jobs[..] {
                [job] if !inputs.has_files => job.explain(&error),
                _ => CliError::other(error.to_string()),
            });
        }
        Err(error) => {
            return Err(CliError::other(format!("{}: {error}", args.output.display())));
        }
    };
    report(args, &inputs, &settings, &sheet)?;
    Ok(Outcome::Done)
}

fn report(
    args: &SheetArgs,
    inputs: &Inputs,
    settings: &SheetSettings,
    sheet: &FinishedSheet,
) -> Result<(), CliError> {
    // Note pictures of another shape
    if let [first, others @ ..] = &sheet.narrower[..] {
        let shown = first.display();
        let (who, whom) = match others.len() {
            0 => (format!("{shown} has"), "it"),
            count => (format!("{shown} and {} have", counted(count, "other")), "them"),
        };
        note!(
            "{who} another aspect ratio than the first picture, so that there is white around {whom}"
        );
    }
    // Describe the sheet, with its size on paper if that is known
    let paper = settings.dpi.map(|dpi| {
        let [width, height] = sheet.size.map(|side| side as f64 / f64::from(dpi) * 25.4);
        format!(" ({width:.1} x {height:.1} mm)")
    });
    print::lines([format!(
        "{}: {}x{}{}, {} of {}x{}, {}",
        args.output.display(),
        sheet.size[0],
        sheet.size[1],
        paper.unwrap_or_default(),
        counted(sheet.layout.cells[0], "column"),
        sheet.layout.cell[0],
        sheet.layout.cell[1],
        inputs.shown.join(", ")
    )])?;
    Ok(())
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
