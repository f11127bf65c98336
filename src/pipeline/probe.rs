//! Estimates the time of a job from a small measurement: the heaviest frame and a few others are read and built in
//! full, and a part of the tiles of their images is traced.
//!
//! The estimate assumes that the time of reading and building is proportional to the size of the files, that the
//! measured frames are representative, and that the load of the machine does not change. What a picture needs before
//! its first pixel, such as maps of the light on the ground, counts once, however few tiles are traced. Tracing has a
//! time box: if not even the smallest trial finishes in time, the result is a lower bound.

use std::sync::OnceLock;
use std::time::{Duration, Instant};

use rayon::{ThreadPoolBuildError, ThreadPoolBuilder};
use serde::Serialize;
use spherule_formats::sequence::Sequence;

use super::{
    BuiltFrame, FrameRenderer, FrameSize, ImageTask, LoadError, Overlap, Setup, TraceError,
    load_frame, renderer_of,
};
use crate::output::{OutputError, PictureFormat, PreviewOptions, encode_exr, encode_preview};
use crate::render::{Film, RenderError, RendererKind, Stop};

/// Width in pixels of the first mosaic of tiles; further ones are twice or four times as wide.
const FIRST_WIDTH: u32 = 32;
/// Minimum tracing time of a sufficient trial, seconds.
const MIN_SECONDS: f64 = 0.15;
/// Minimum number of pixels of a sufficient trial: 200 tiles represent the image wherever the particles are in it.
const MIN_PIXELS: u32 = 51_200;
/// Maximum number of samples per pixel in a trial. The cost per ray does not decrease with more samples, and in a
/// connected body the same rays are traced.
const MAX_SAMPLES: u32 = 96;
/// Time after which no further frames are measured.
const TIME_FOR_OTHERS: Duration = Duration::from_secs(2);

/// Time for the first picture on a GPU, which counts for nothing.
const TIME_FOR_KERNELS: Duration = Duration::from_secs(60);

/// Measured or estimated time of one frame, seconds, and the size of its image, bytes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Probe {
    /// The heaviest frame.
    pub frame: i64,
    /// Its particle count.
    pub particles: u64,
    /// Time of reading it, measured.
    pub read: f64,
    /// Time of building its tree and surface, measured.
    pub build: f64,
    /// Number of frames with a traced trial. The following values are means over frames that are distributed over the
    /// job; without any, they are those of the heaviest frame.
    pub frames: u32,
    /// Time of tracing, estimated.
    pub trace: f64,
    /// Time of encoding on one thread, estimated.
    pub encode: f64,
    /// Size of the images, estimated.
    pub image_bytes: f64,
    /// Fraction of the camera rays that were traced.
    pub traced_part: f64,
    /// Whether the time box ended before the smallest mosaic was traced, so that tracing takes longer than estimated.
    pub is_lower_bound: bool,
}

/// Why a frame cannot be measured.
#[derive(Debug, thiserror::Error)]
pub enum ProbeError {
    /// It cannot be read.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// It cannot be traced.
    #[error(transparent)]
    Trace(#[from] TraceError),
    /// Its image cannot be encoded.
    #[error(transparent)]
    Encode(#[from] OutputError),
    /// The system refuses threads.
    #[error(transparent)]
    Threads(#[from] ThreadPoolBuildError),
}

/// A traced mosaic of an image.
struct Trial {
    setup: Setup,
    film: Film,
    /// Time before its pixels, and in them, seconds.
    before: f64,
    in_pixels: f64,
    is_interrupted: bool,
}

/// Stops a trial that takes longer than `limit` before its pixels, or in them.
struct TimeBox {
    limit: Duration,
    start: Instant,
    pixels: OnceLock<Instant>,
}

impl TimeBox {
    fn new(limit: Duration) -> Self {
        Self { limit, start: Instant::now(), pixels: OnceLock::new() }
    }

    /// Time before the pixels so far, and in them, seconds.
    fn seconds(&self) -> [f64; 2] {
        let times = self.pixels.get().map_or([self.start.elapsed(), Duration::ZERO], |begin| {
            [begin.duration_since(self.start), begin.elapsed()]
        });
        times.map(|time| time.as_secs_f64())
    }
}

impl Stop for TimeBox {
    fn is_raised(&self) -> bool {
        self.pixels.get().unwrap_or(&self.start).elapsed() >= self.limit
    }

    fn pixels_begin(&self) {
        self.pixels.get_or_init(Instant::now);
    }
}

/// Time of one image, seconds, and its size, bytes.
#[derive(Debug, Clone, Copy, Default)]
struct ImageCost {
    trace: f64,
    encode: f64,
    bytes: f64,
}

/// Measures the frame of `heaviest`, and the images of `others` in their order, as long as time permits.
///
/// # Errors
/// The reason why the heaviest frame cannot be rendered.
pub fn probe(
    setup: &Setup,
    sequence: &Sequence,
    heaviest: &ImageTask,
    others: &[&ImageTask],
) -> Result<Probe, ProbeError> {
    probe_for(Probe::TIME_BOX, setup, sequence, heaviest, others)
}

/// Same as [`probe`], with at most `time_box` for tracing the heaviest frame.
fn probe_for(
    time_box: Duration,
    setup: &Setup,
    sequence: &Sequence,
    heaviest: &ImageTask,
    others: &[&ImageTask],
) -> Result<Probe, ProbeError> {
    let start = Instant::now();
    let mut renderer = renderer_of(setup.picture.renderer);

    // Measure the heaviest frame
    let (report, trial_size, traced_part, first) = {
        let frame = prepare(&mut *renderer, setup, sequence, heaviest)?;
        // The first picture on a GPU compiles its kernels
        if setup.picture.renderer == RendererKind::Gpu {
            Trial::of(&*renderer, setup, &frame, [FIRST_WIDTH; 2], TIME_FOR_KERNELS)?;
        }
        let trial = largest_trial(&*renderer, setup, &frame, time_box)?;
        let size = [trial.film.width, trial.film.height];
        let part = (!trial.is_interrupted).then(|| trial.part(setup));
        (frame.report, size, part, trial.cost(setup, heaviest)?)
    };
    let mut costs = Vec::new();

    // Measure other frames, after the memory of the first one has been freed
    for task in others.iter().filter(|_| traced_part.is_some()) {
        if start.elapsed() > TIME_FOR_OTHERS {
            break;
        }
        costs.extend(trial_cost(&mut *renderer, setup, sequence, task, (trial_size, time_box)));
    }
    // Average the costs
    let frames = 1 + u32::try_from(costs.len()).unwrap_or(0);
    if costs.is_empty() {
        costs.push(first);
    }
    let mean =
        |part: fn(&ImageCost) -> f64| costs.iter().map(part).sum::<f64>() / costs.len() as f64;
    Ok(Probe {
        frame: heaviest.frame,
        particles: report.particles,
        read: report.seconds.read,
        build: report.seconds.build + report.seconds.surface,
        frames,
        trace: mean(|cost| cost.trace),
        encode: mean(|cost| cost.encode),
        image_bytes: mean(|cost| cost.bytes),
        traced_part: traced_part.unwrap_or(0.0),
        is_lower_bound: traced_part.is_none(),
    })
}

/// The cost of the image of `task`, from a trial of the given size within a time; None if it cannot be measured.
fn trial_cost(
    renderer: &mut dyn FrameRenderer,
    setup: &Setup,
    sequence: &Sequence,
    task: &ImageTask,
    (size, limit): ([u32; 2], Duration),
) -> Option<ImageCost> {
    let frame = prepare(renderer, setup, sequence, task).ok()?;
    let trial = Trial::of(renderer, setup, &frame, size, limit).ok()?;
    if trial.is_interrupted {
        return None;
    }
    trial.cost(setup, task).ok()
}

fn prepare(
    renderer: &mut dyn FrameRenderer,
    setup: &Setup,
    sequence: &Sequence,
    task: &ImageTask,
) -> Result<BuiltFrame, ProbeError> {
    let loaded = load_frame(setup, sequence, task)?;
    Ok(renderer.prepare(setup, loaded)?)
}

/// Traces mosaics of the image of `frame` with increasing size until one is sufficient. Returns the last one that
/// finished within `time` for the pixels of all, or the first one.
fn largest_trial(
    renderer: &dyn FrameRenderer,
    setup: &Setup,
    frame: &BuiltFrame,
    mut time: Duration,
) -> Result<Trial, ProbeError> {
    let full = &setup.picture.render;
    let mut width = FIRST_WIDTH.min(full.width);
    let mut last: Option<Trial> = None;
    loop {
        // Trace a mosaic with the aspect ratio of the image
        let exact = u64::from(full.height) * u64::from(width) / u64::from(full.width);
        let height = u32::try_from(exact).unwrap_or(full.height).max(1);
        let trial = Trial::of(renderer, setup, frame, [width, height], time)?;
        if trial.is_interrupted {
            return Ok(last.unwrap_or(trial));
        }
        // Stop if it is sufficient, or if the next one would not finish in time
        if trial.in_pixels > MIN_SECONDS && width * height >= MIN_PIXELS {
            return Ok(trial);
        }
        let seconds = Duration::from_secs_f64(trial.in_pixels);
        time = time.saturating_sub(seconds);
        // Each begins with the same work before its pixels: fewer mosaics if that takes most of the time
        let factors = if trial.before > trial.in_pixels { &[4, 2][..] } else { &[2] };
        let begins = Duration::from_secs_f64(trial.before) < time;
        let ends = |by: &&u32| **by * width <= full.width && seconds * **by * **by < time;
        let Some(factor) = factors.iter().find(ends).filter(|_| begins) else { return Ok(trial) };
        width *= factor;
        last = Some(trial);
    }
}

impl Trial {
    /// Traces a mosaic of the image of `frame` with `width` by `height` pixels.
    fn of(
        renderer: &dyn FrameRenderer,
        setup: &Setup,
        frame: &BuiltFrame,
        [width, height]: [u32; 2],
        limit: Duration,
    ) -> Result<Self, ProbeError> {
        // Set up the mosaic
        let mut setup = setup.clone();
        let settings = &mut setup.picture.render;
        settings.mosaic_of = Some([settings.width, settings.height]);
        (settings.width, settings.height) = (width, height);
        // With a limit of noise, the number follows from it
        if settings.noise.is_none() {
            settings.samples = settings.samples.min(MAX_SAMPLES);
        }
        let channels = settings.channels;
        // Trace it until the time has passed
        let time_box = TimeBox::new(limit);
        let traced = renderer.image(&setup, frame, &time_box);
        let [before, in_pixels] = time_box.seconds();
        let (film, is_interrupted) = match traced {
            Ok((film, _)) => (film, false),
            Err(TraceError::Render(RenderError::Interrupted)) => {
                (Film::new(width, height, channels), true)
            }
            Err(error) => return Err(error.into()),
        };
        Ok(Self { setup, film, before, in_pixels, is_interrupted })
    }

    /// Fraction of the pixels of the full image.
    fn pixels(&self, full: &Setup) -> f64 {
        let pixels = |width: u32, height: u32| f64::from(width) * f64::from(height);
        let full = &full.picture.render;
        pixels(self.film.width, self.film.height) / pixels(full.width, full.height)
    }

    /// Fraction of the camera rays of the full image.
    fn part(&self, full: &Setup) -> f64 {
        let samples = f64::from(self.setup.picture.render.samples);
        self.pixels(full) * samples / f64::from(full.picture.render.samples)
    }

    /// Estimated cost of the full image.
    fn cost(&self, full: &Setup, task: &ImageTask) -> Result<ImageCost, ProbeError> {
        // Images are encoded by one thread while the pool traces, so measure with one thread.
        let pool = ThreadPoolBuilder::new().num_threads(1).build()?;
        // Encode the trial as a job encodes its image
        let start = Instant::now();
        let has_exr = matches!(PictureFormat::of(&task.image), Some(PictureFormat::Exr) | None);
        let mut bytes = 0;
        if has_exr {
            let exr = pool.install(|| encode_exr(&self.film, &full.picture.files.exr));
            bytes += exr?.bytes.len();
        }
        if task.preview.is_some() || !has_exr {
            let camera = full.camera_at(task.frame).map_err(TraceError::Camera)?;
            let options = PreviewOptions { page: None, ..full.preview_from(&camera) };
            let png = encode_preview(&self.film, &options, &[])?;
            bytes += png.len();
        }
        // Scale the costs to the full image
        let encode = start.elapsed().as_secs_f64();
        Ok(ImageCost {
            trace: self.before + self.in_pixels / self.part(full),
            encode: encode / self.pixels(full),
            bytes: bytes as f64 / self.pixels(full),
        })
    }
}

impl Probe {
    /// Maximum time of the pixels of all trials of a frame, and before the pixels of each.
    pub const TIME_BOX: Duration = Duration::from_secs(3);

    /// Estimated time for frames of these sizes on `threads` threads, seconds. `probed` is the size of the heaviest
    /// frame. Tracing and encoding share the threads. If frames overlap, all frames except the first are read in the
    /// meantime.
    pub fn seconds_for(
        &self,
        frames: &[FrameSize],
        probed: &FrameSize,
        overlap: Overlap,
        threads: usize,
    ) -> f64 {
        let read = |frame: &FrameSize| self.read * frame.raw as f64 / probed.raw.max(1) as f64;
        let seconds = |frame: &FrameSize| {
            let build = self.build * frame.raw as f64 / probed.raw.max(1) as f64;
            let image = (self.trace + self.encode / threads as f64).max(self.encode);
            build
                + match overlap {
                    Overlap::Stages => image.max(read(frame)),
                    Overlap::None => image + read(frame),
                }
        };
        let first = match overlap {
            Overlap::Stages => frames.first().map_or(0.0, read),
            Overlap::None => 0.0,
        };
        first + frames.iter().map(seconds).sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use std::path::{Path, PathBuf};

    use spherule_formats::SequenceInput;

    use super::*;

    /// A frame of the dam break, and how to draw it.
    fn example() -> (Setup, Sequence, ImageTask) {
        let example = "examples/dam-break/ParticleData_Fluid_1.bgeo";
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(example);
        let sequence = Sequence::open(&SequenceInput::from_path(&file)).expect("a frame");
        let manifest = crate::manifest::Manifest::new("in");
        let inquiry = crate::resolve::Inquiry::of(&manifest);
        let question = inquiry.question(None);
        let survey = crate::survey::Survey::of(&sequence, question).expect("readable");
        let setup =
            crate::resolve::setup(&manifest, &survey, crate::resolve::SceneInputs::default())
                .expect("pictures");
        let task = ImageTask {
            frame: 1,
            index: 0,
            image: PathBuf::new(),
            preview: None,
            meshes: Vec::new(),
            next_meshes: None,
            refused: None,
        };
        (setup, sequence, task)
    }

    #[test]
    fn what_comes_before_the_pixels_counts_once() {
        let (full, _, task) = example();
        let mut setup = full.clone();
        setup.picture.render.samples = 4;
        let film = Film::new(192, 108, full.picture.render.channels);
        let trial = Trial { setup, film, before: 3.0, in_pixels: 0.5, is_interrupted: false };
        assert_eq!([full.picture.render.width, full.picture.render.samples], [1920, 16]);
        let cost = trial.cost(&full, &task).expect("an image");
        assert!((cost.trace - (3.0 + 400.0 * 0.5)).abs() < 1e-6, "{}", cost.trace);
    }

    // What was stopped before its pixels took that long, however few tiles it would have had.
    #[test]
    fn pixels_have_no_time_before_they_begin() {
        let time_box = TimeBox::new(Duration::ZERO);
        assert!(time_box.is_raised());
        assert_eq!(time_box.seconds()[1], 0.0);
        let before = time_box.start.elapsed();
        time_box.pixels_begin();
        assert!(time_box.seconds()[0] >= before.as_secs_f64());
    }

    // The second probe has time to trace all that it measures.
    #[test]
    fn no_time_to_trace_gives_a_lower_bound() {
        let (setup, sequence, task) = example();
        let cut_off =
            probe_for(Duration::ZERO, &setup, &sequence, &task, &[&task]).expect("a probe");
        assert!(cut_off.is_lower_bound && cut_off.traced_part == 0.0);
        assert_eq!(cut_off.frames, 1);
        assert!(cut_off.particles > 0 && cut_off.trace > 0.0);
        let whole = probe_for(Duration::from_secs(3600), &setup, &sequence, &task, &[&task]);
        assert!(whole.is_ok_and(|probe| !probe.is_lower_bound && probe.traced_part > 0.0));
    }

    #[test]
    fn reading_goes_beside_images_but_for_the_first_frame() {
        let probe = Probe {
            frame: 2,
            particles: 100,
            read: 2.0,
            build: 1.0,
            frames: 1,
            trace: 4.0,
            encode: 2.0,
            image_bytes: 1.0,
            traced_part: 0.1,
            is_lower_bound: false,
        };
        let size = |raw| FrameSize { raw, ..FrameSize::default() };
        let frames = [size(50), size(100), size(300)];
        let seconds = |overlap| probe.seconds_for(&frames, &size(100), overlap, 2);
        // Built in 0.5, 1 and 3 s, read in 1, 2 and 6 s, the last beyond the image's 5 s.
        assert_eq!(seconds(Overlap::Stages), 1.0 + (5.5 + 6.0 + 9.0));
        assert_eq!(seconds(Overlap::None), 6.5 + 8.0 + 14.0);
    }
}
