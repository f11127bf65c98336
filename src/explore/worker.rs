//! The thread that renders.

use std::time::{Duration, Instant};

use serde_json::{Value, json};
use spherule_jobs::catch_panic;

use super::error::{ExploreError, Fault};
use super::level::Level;
use super::shared::{PageTask, Shared, Shown, Task};
use super::stage::{Prepared, Stage, StagePicture, Under};
use crate::pipeline::{ColorRule, ImageError, Setup};
use crate::render::Stop;
use crate::scene::Projection;

/// Stops when something is more urgent.
struct Urgent<'a> {
    shared: &'a Shared,
    task: &'a PageTask,
    since: Instant,
}

/// How long the first picture of a wish is not stopped: pages on which something moves would else show none.
const FIRST: Duration = Duration::from_secs(1);

impl Stop for Urgent<'_> {
    fn is_raised(&self) -> bool {
        let may_stop = self.task.done.is_some() || self.since.elapsed() > FIRST;
        may_stop && self.shared.has_news(self.task.page, self.task.number)
    }
}

/// Does what there is to do until the end.
pub(super) fn run(shared: &Shared, mut stage: Stage) {
    while let Some(task) = shared.next_task() {
        match task {
            Task::Errand(errand) => {
                // Who asked gets no answer if there is a bug
                let _: Result<(), ImageError> = catch_panic(|| {
                    errand(&mut stage);
                    Ok(())
                });
            }
            Task::Picture(task) => rayon::scope(|_| show(shared, &mut stage, &task)),
        }
    }
}

/// Renders the next picture of a wish.
fn show(shared: &Shared, stage: &mut Stage, task: &PageTask) {
    let start = Instant::now();
    // Panics of rendering are caught where the renderer is
    let prepared = catch_panic(|| {
        let prepared = stage.prepare(&task.wish.settings);
        Ok::<_, ImageError>(prepared.map(|prepared| {
            let render = &prepared.setup.picture.render;
            task.level([render.width, render.height], render.samples)
        }))
    });
    let fail = |error: ExploreError| shared.publish(task, (None, 0.0), Err(error.fault()));
    let level = match prepared {
        Ok(Ok(Some(level))) => level,
        Ok(Ok(None)) => return shared.finish(task.page, task.number),
        Ok(Err(error)) => return fail(error),
        Err(bug) => return fail(bug.into()),
    };
    let stop = Urgent { shared, task, since: Instant::now() };
    match stage.picture(task.wish.frame, &level, &stop) {
        Ok(picture) => {
            let seconds = picture.seconds;
            let total = start.elapsed().as_secs_f64();
            let prepared = stage.prepared().expect("settings come first");
            let facts = facts(prepared, task.wish.frame, &level, (&picture, total));
            let StagePicture { encoded, under, .. } = picture;
            let shown = Shown { bytes: encoded.bytes, mime: encoded.mime, facts };
            shared.publish(task, (Some(level), seconds), Ok((shown, under)));
        }
        // The task comes again, unless the page wishes something else
        Err(error) if error.is_interrupted() => {}
        Err(error) => fail(error),
    }
}

/// What a page says about a picture.
fn facts(
    prepared: &Prepared,
    frame: i64,
    level: &Level,
    (picture, total): (&StagePicture, f64),
) -> Value {
    let setup = &prepared.setup;
    let view = setup.picture.view.path.view(frame);
    let (projection, height) = match setup.picture.view.projection {
        Projection::Perspective => ("perspective", None),
        Projection::Orthographic { height } => ("orthographic", Some(height)),
        Projection::Equirectangular => ("equirectangular", None),
    };
    // The part of the whole image that the picture shows
    let whole = [setup.picture.render.width, setup.picture.render.height];
    let window = setup.picture.render.window;
    let (first, image) = window.map_or(([0, 0], whole), |own| ([own.left, own.top], own.image));
    let notes = prepared.lines.iter().chain(&picture.notes);
    json!({
        "frame": frame,
        "time": picture.time,
        "particles": picture.particles,
        "every": picture.every,
        "size": level.size,
        "of": whole,
        "window": { "first": first, "image": image },
        "is_stereo": setup.picture.scene.camera.eyes() != [1, 1],
        "layout": picture.encoded.layout,
        "samples": level.samples,
        "of_samples": setup.picture.render.samples,
        "is_last": level.is_last,
        "milliseconds": (total * 1e3).round(),
        "notes": notes.collect::<Vec<_>>(),
        "range": color_range(setup),
        "bounds": [prepared.survey.min.to_array(), prepared.survey.max.to_array()],
        "view": {
            "eye": view.eye.to_array(),
            "look_at": view.look_at.to_array(),
            "up": view.up.to_array(),
            "fov": view.fov,
            "projection": projection,
            "height": height,
            "axis": setup.picture.view.up.to_array(),
        },
    })
}

/// The values at the ends of the colours, if these follow a value.
fn color_range(setup: &Setup) -> Option<[f64; 2]> {
    match &setup.picture.particles.first().color {
        ColorRule::Attribute { map, .. } => map.range().map(|(range, _)| range),
        _ => None,
    }
}

impl Under {
    /// The id and the point at a place, as fractions of the width and the height from the top left.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "fractions of a size, clamped to its pixels"
    )]
    pub(super) fn at(&self, [x, y]: [f64; 2]) -> Option<(u32, [f32; 3])> {
        let [width, height] = self.size;
        let place = |part: f64, count: u32| {
            let at = (part.clamp(0.0, 1.0) * f64::from(count)) as u32;
            at.min(count.saturating_sub(1)) as usize
        };
        let pixel = place(y, height) * width as usize + place(x, width);
        let id = *self.ids.get(pixel)?;
        let point = *self.points.get(pixel)?;
        (id != crate::render::NO_ID).then_some((id, point))
    }
}

impl From<Fault> for ExploreError {
    fn from(fault: Fault) -> Self {
        Self::Setting(fault)
    }
}
