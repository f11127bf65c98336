//! Messages of a render: the resolved settings, and progress.

use glam::DVec3;
use serde_json::{Value, json};
use spherule_files::{Bytes, counted};
use spherule_formats::Sequence;

use crate::cli::print;
use crate::cli::progress::ShowReport;
use crate::job::cpu_note;
use crate::manifest::points_on_paper;
use crate::overlay::{Content, Overlay};
use crate::pipeline::{self, RadiusRule, Setup};
use crate::report::FrameReport;
use crate::scene::{CameraPath, Projection, RadiusTable};
use crate::surface::SurfaceKind;
use crate::survey::{Survey, shown_name};

impl ShowReport for FrameReport {
    fn summary(&self) -> String {
        let s = &self.seconds;
        let surface = match s.surface {
            none if none < 5e-4 => String::new(),
            seconds => format!("surface {seconds:.3} s, "),
        };
        let more =
            if print::is_verbose() { format!(" ({})", details(self)) } else { String::new() };
        let notes: String = sampling_notes(self).iter().map(|text| format!(", {text}")).collect();
        format!(
            "{} particles, {} built in {:.3} s, {surface}trace {:.2} s{notes}{more}",
            self.particles, self.build.structure, s.build, s.trace
        )
    }

    fn facts(&self, output: String) -> Value {
        json!({"image": output, "seconds": self.seconds})
    }
}

/// All stages, rays and memory of a picture, for `--verbose`.
pub(in crate::cli) fn details(report: &FrameReport) -> String {
    let s = &report.seconds;
    let stages = [
        ("read", s.read),
        ("build", s.build),
        ("surface", s.surface),
        ("trace", s.trace),
        ("denoise", s.denoise),
        ("encode", s.encode),
    ];
    let times: Vec<String> = stages
        .iter()
        .filter(|(_, seconds)| *seconds > 0.0)
        .map(|(stage, seconds)| format!("{stage} {seconds:.3} s"))
        .collect();
    format!(
        "{}; {:.2} million rays; peak memory {}",
        times.join(", "),
        report.rays.total() as f64 / 1e6,
        Bytes(report.rss.total_peak)
    )
}

/// How many samples a picture with a limit of noise took, and how much light it has lost to the clamp of indirect light.
pub(in crate::cli) fn sampling_notes(report: &FrameReport) -> Vec<String> {
    let mut notes = Vec::new();
    if let Some(sampling) = &report.sampling {
        let noisy = match 100.0 * sampling.noisy {
            percent if percent > 0.0 => {
                format!("; {percent:.1} % of the picture still have more noise (image.max_samples)")
            }
            _ => String::new(),
        };
        notes.push(format!("{:.1} samples per pixel{noisy}", sampling.samples));
    }
    let percent = 100.0 * report.clamped_light;
    if percent > 0.0 {
        notes.push(format!("render.clamp took {percent:.2} % of the light"));
    }
    notes
}

/// Prints the resolved settings.
pub(in crate::cli) fn print_summary(sequence: &Sequence, survey: &Survey, setup: &Setup) {
    // Say what was found
    message!(
        "{}, up to {}",
        counted(sequence.frames().len(), "frame"),
        counted(survey.most_particles, "particle")
    );
    if let Some(parts) = parts_text(sequence) {
        message!("{parts}");
    }
    for text in sequence.file_notes() {
        note!("{text}");
    }
    if let Some(why) = &setup.run.why_cpu {
        note!("{}", cpu_note(why));
    }
    if setup.picture.things.cell.is_none() && !survey.cells.is_empty() {
        note!("{CELL_HINT}");
    }
    // Without particles, the rest means nothing
    if survey.most_particles == 0 {
        return;
    }
    message!("{}", radius_text(setup, survey));
    if let Some(text) = doubtful_radius(setup, survey) {
        note!("{text}");
    }
    if let Some(text) = unframed_text(setup) {
        message!("{text}");
    }
    if let Some(text) = color_text(setup, survey) {
        message!("{text}");
    }
    let styles = setup.picture.particles.others().iter();
    for style in styles.filter(|style| !style.shares_colors) {
        if let Some(text) = map_text(&style.color) {
            message!("style `{}`: {text}", style.name);
        }
    }
    if let Some(text) = small_text(setup) {
        note!("{text}");
    }
    for text in ticks_outside(setup) {
        note!("{text}");
    }
    if let Some(options) = view_options(setup) {
        message!("camera: {options}");
    }
    if survey.origin != DVec3::ZERO {
        message!("origin {}: the particles are far from zero", survey.origin);
    }
}

/// Describes the colours that follow from attributes.
fn color_text(setup: &Setup, survey: &Survey) -> Option<String> {
    let rules = &setup.picture.particles;
    match (&rules.first().color, &survey.rgb) {
        // All particles have a style
        _ if rules.is_divided() && survey.color.is_none() => None,
        (pipeline::ColorRule::Rgb { name, .. }, Some(rgb)) => {
            Some(format!("colour by the RGB attribute `{name}` ({})", rgb.encoding.name()))
        }
        (color, _) => map_text(color),
    }
}

/// Describes the colour map of `color`, if it has one.
fn map_text(color: &pipeline::ColorRule) -> Option<String> {
    let pipeline::ColorRule::Attribute { name, map, .. } = color else {
        return None;
    };
    let shown = shown_name(name);
    Some(match (map.range(), map.categories()) {
        (Some(([low, high], _)), _) => {
            let [low, high] = [low, high].map(short);
            format!("colour by `{shown}`, range {low} to {high} (--range {low} {high})")
        }
        (None, categories) => {
            let count = categories.map_or(0, <[_]>::len);
            format!("colour by `{shown}`, {count} categories")
        }
    })
}

/// What draws the simulation cell of a file.
pub(in crate::cli) const CELL_HINT: &str = "--cell draws the simulation cell";

/// The options that place a camera which stands still where it is; None for those that move, and panoramas.
fn view_options(setup: &Setup) -> Option<String> {
    let CameraPath::Still(view) = &setup.picture.view.path else {
        return None;
    };
    let point = |p: DVec3| format!("[{},{},{}]", short(p.x), short(p.y), short(p.z));
    let place = format!(
        "--set 'camera.eye={}' --set 'camera.look_at={}'",
        point(view.eye),
        point(view.look_at)
    );
    match setup.picture.view.projection {
        Projection::Perspective => Some(format!("{place} --set camera.fov={}", short(view.fov))),
        Projection::Orthographic { height } => {
            Some(format!("{place} --projection orthographic --set camera.height={}", short(height)))
        }
        Projection::Equirectangular => None,
    }
}

/// The parts of a time step and the used ones, if there are several.
pub(in crate::cli) fn parts_text(sequence: &Sequence) -> Option<String> {
    let (all, kept) = (sequence.part_names(), sequence.kept_part_names());
    if all.len() < 2 {
        return None;
    }
    let used = if kept.len() == all.len() {
        "; --parts selects some of them".to_owned()
    } else {
        format!("; used: {}", kept.join(", "))
    };
    Some(format!("each step has the parts {}{used}", all.join(", ")))
}

/// Describes the radius.
pub(in crate::cli) fn radius_text(setup: &Setup, survey: &Survey) -> String {
    match &setup.picture.particles.first().radius {
        RadiusRule::Common(radius) => format!("radius {radius}"),
        RadiusRule::FileOr(_) if survey.has_radii => "radius from the files".to_owned(),
        RadiusRule::FileOr(radius) => {
            let radius = short(f64::from(*radius));
            let why = match (setup.picture.surface.kind, survey.packed_radius) {
                (SurfaceKind::Spheres, _) if survey.is_flat => "large enough to cover the plane",
                (SurfaceKind::Spheres, _) | (_, None) => "half the typical distance of neighbours",
                (SurfaceKind::Union, _) => {
                    "from the particle density, enlarged so that spheres overlap"
                }
                (SurfaceKind::Smooth, _) => "from the particle density",
            };
            format!("radius {radius}, {why} (--radius sets it)")
        }
        RadiusRule::Attribute { name, scale } => format!("radius {scale} x attribute `{name}`"),
        RadiusRule::Table { name, table, scale } => {
            let scale = short(*scale);
            match table {
                RadiusTable::VanDerWaals => {
                    format!("van der Waals radii of elements in `{name}`, angstroms x {scale}")
                }
                RadiusTable::Covalent => {
                    format!("covalent radii of elements in `{name}`, angstroms x {scale}")
                }
                RadiusTable::Values(_) => format!("radii by `{name}` x {scale}"),
            }
        }
    }
}

/// Height in points below which text cannot be read on paper.
const MIN_POINTS: f64 = 6.0;

/// Says that text is too small on paper, if it is.
fn small_text(setup: &Setup) -> Option<String> {
    let picture = &setup.picture;
    let dpi = picture.files.exr.dpi?;
    let has_text = |overlay: &&Overlay| !matches!(overlay.content, Content::Image(_));
    let sizes = picture.files.overlays.iter().filter(has_text);
    let page = picture.files.preview.page.map(|own| own.page.size[1]);
    let height = page.unwrap_or(picture.render.height);
    let points = sizes.map(|overlay| points_on_paper(overlay.size, height, dpi));
    let least = points.fold(f64::INFINITY, f64::min);
    (least < MIN_POINTS - 1e-3).then(|| {
        format!(
            "text is {least:.1} points high on paper; from {MIN_POINTS} on it can be read (size = \"7pt\" of [[overlay]])"
        )
    })
}

/// Says which ticks of colour bars are outside of the range, and so not drawn.
fn ticks_outside(setup: &Setup) -> Vec<String> {
    let bars = setup.picture.files.overlays.iter().filter_map(|overlay| match &overlay.content {
        Content::ColorBar(bar) => bar.tick_settings(),
        _ => None,
    });
    let lines = bars.filter_map(|settings| {
        let outside = settings.outside();
        let [low, high] = settings.range.map(|value| short(value * settings.factor));
        let values: Vec<String> = outside.iter().take(5).map(|value| short(*value).to_string()).collect();
        let more = if outside.len() > 5 { ", ..." } else { "" };
        (!outside.is_empty()).then(|| {
            format!(
                "overlay.ticks: {}{more} not drawn: outside of the range {low} to {high} of the bar (--range sets it)",
                values.join(", ")
            )
        })
    });
    lines.collect()
}

/// Factor between a given radius and half the distance of neighbours beyond which the unit is probably another one.
const DOUBTFUL: f64 = 10.0;

/// Says that a given radius is far from the spacing of the particles, if it is.
fn doubtful_radius(setup: &Setup, survey: &Survey) -> Option<String> {
    let RadiusRule::Common(radius) = setup.picture.particles.first().radius else {
        return None;
    };
    let spacing = f64::from(survey.radius?);
    let factor = f64::from(radius) / spacing;
    let is_doubtful = !(DOUBTFUL.recip()..=DOUBTFUL).contains(&factor);
    is_doubtful.then(|| {
        format!(
            "the radius {radius} is {} times half the typical distance of neighbours, {}; is its unit that of the \
             positions?",
            short(factor),
            short(spacing)
        )
    })
}

/// Says how many particles the camera may leave out, if there are any.
pub(in crate::cli) fn unframed_text(setup: &Setup) -> Option<String> {
    let particles = match setup.picture.view.unframed {
        0 => return None,
        1 => "1 particle is".to_owned(),
        some => format!("up to {some} particles of a frame are"),
    };
    Some(format!(
        "{particles} far from the others and may be outside of the picture (camera.mode = \"fixed\" places the camera)"
    ))
}

/// Rounds to four digits.
fn short(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}
