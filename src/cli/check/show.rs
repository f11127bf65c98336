//! The results of `check` as text and as JSON.

use std::borrow::Cow;

use serde_json::{Map, Value, json};
use spherule_files::{Bytes, counted};
use spherule_jobs::FrameState;

use super::camera::CameraSummary;
use super::{Check, whole};
use crate::accel::Structure;
use crate::cli::job::list;
use crate::cli::progress::duration;
use crate::cli::render::{radius_text, unframed_text};
use crate::manifest::{Channel, Manifest, NamedChannel};
use crate::pipeline::{ColorRule, Overlap, Probe, RadiusRule, Schedule, Setup, gpu};
use crate::render::{NoiseLimit, RendererKind};
use crate::scene::RadiusTable;
use crate::survey::{Survey, shown_name};

impl Check<'_> {
    pub(super) fn to_json(&self) -> Value {
        let manifest = self.render_job.manifest();
        let mut all = Map::new();
        let mut put = |key: &str, value: Value| all.insert(key.to_owned(), value);
        // What is certain without particles
        put("problems", json!(self.problems));
        put("frames", self.frames_json());
        put("images", self.tasks.iter().map(|t| json!(t.image)).collect());
        put("directory", json!(self.render_job.dir()));
        put("image", image_json(manifest));
        // What follows from the survey
        if let Some((survey, setup)) = &self.setup {
            put("structure", json!(structure(survey, setup).name()));
            put("most_particles", json!(survey.most_particles));
            put("radius", radius_json(setup, survey));
            if let ColorRule::Attribute { name, map, .. } = &setup.picture.particles.first().color {
                let range = map.range().map(|(range, _)| range);
                put("range", json!({"value": shown_name(name), "ends": range}));
            }
            put("camera", self.camera(setup).to_json());
        }
        // Estimates
        if let Some(schedule) = &self.schedule {
            put("memory", self.memory_json(schedule));
        }
        put("disk", json!({"estimate": self.disk_bytes().map(whole), "free": self.free_disk}));
        put(
            "time",
            json!({
                "estimate": self.seconds(),
                "survey": self.survey_time.as_secs_f64(),
                "is_lower_bound": self.probe.map(|probe| probe.is_lower_bound),
                "probe": self.probe,
            }),
        );
        Value::Object(all)
    }

    fn frames_json(&self) -> Value {
        json!({
            "all": self.render_job.selected(self.sequence),
            "done": self.in_state(FrameState::Done),
            "failed": self.in_state(FrameState::Failed),
            "to_do": self.tasks.iter().map(|t| t.frame).collect::<Vec<_>>(),
            "too_large": self.too_large(),
        })
    }

    /// Memory of the GPU for the heaviest frame, bytes; None if the CPU renders.
    fn device_bytes(&self) -> Option<u64> {
        let (survey, setup) = self.setup.as_ref()?;
        let is_gpu = setup.picture.renderer == RendererKind::Gpu;
        is_gpu.then(|| gpu::device_bytes(setup, self.sequence, survey.most_particles as u64))
    }

    /// The memory that a frame needs, by its use, and what limits it.
    fn memory_json(&self, schedule: &Schedule) -> Value {
        let manifest = self.render_job.manifest();
        let mut memory = json!(schedule.need);
        if let Some(memory) = memory.as_object_mut() {
            memory.insert("total".into(), json!(schedule.need.total()));
            memory.insert("free".into(), json!(self.free_memory));
            let limit = manifest.render.memory_limit.map(|l| l.0);
            memory.insert("limit".into(), json!(limit));
            memory.insert("device".into(), json!(self.device_bytes()));
            let overlap = schedule.overlap == Overlap::Stages;
            memory.insert("frames_overlap".into(), json!(overlap));
        }
        memory
    }

    pub(super) fn to_lines(&self) -> Vec<String> {
        let mut lines = vec![self.frames_line()];
        let manifest = self.render_job.manifest();
        let names = channels(manifest);
        let [width, height] = manifest.picture().size();
        lines.push(format!(
            "images     {}: {}x{}{}, {} per pixel, {}{}",
            self.render_job.shown_output().display(),
            width,
            height,
            manifest.image.part().map(|part| format!(", part {part:?}")).unwrap_or_default(),
            samples_text(manifest),
            names.join(" "),
            if manifest.output.has_previews() { ", with previews" } else { "" }
        ));
        if let Some((survey, setup)) = &self.setup {
            lines.push(format!(
                "particles  {} at most in the surveyed frames, {}",
                survey.most_particles,
                radius_text(setup, survey)
            ));
            lines.extend(self.camera(setup).to_lines());
            lines.extend(unframed_text(setup).map(|text| format!("           {text}")));
            lines.push(format!("structure  {}", structure(survey, setup)));
        }
        lines.extend(self.memory_lines());
        lines.extend(
            self.device_bytes()
                .map(|bytes| format!("device     a GPU, about {} of its memory", Bytes(bytes))),
        );
        lines.extend(self.disk_line());
        lines.extend(self.time_line());
        lines
    }

    fn camera<'a>(&self, setup: &'a Setup) -> CameraSummary<'a> {
        let mode = self.render_job.manifest().camera.mode;
        CameraSummary::new(setup, mode, &self.render_job.selected(self.sequence))
    }

    fn frames_line(&self) -> String {
        let all = self.render_job.selected(self.sequence);
        let mut line = format!("frames     {} ({})", all.len(), list(&all));
        let pending: Vec<i64> = self.tasks.iter().map(|t| t.frame).collect();
        for (what, frames) in [
            ("done", self.in_state(FrameState::Done)),
            ("failed before", self.in_state(FrameState::Failed)),
            ("too large", self.too_large()),
            ("to do", pending),
        ] {
            if !frames.is_empty() {
                line += &format!("; {what} {} ({})", frames.len(), list(&frames));
            }
        }
        line
    }

    fn memory_lines(&self) -> Vec<String> {
        // No frame that fits needs no memory
        let schedule = self.schedule.as_ref();
        let Some(schedule) = schedule.filter(|schedule| schedule.need.total() > 0) else {
            return Vec::new();
        };
        let mut line = format!("memory     about {}", Bytes(schedule.need.total()));
        if let Some(limit) = self.render_job.manifest().render.memory_limit {
            line += &format!(", the limit is {limit}");
        }
        if let Some(free) = self.free_memory {
            line += &format!(", {} are free", Bytes(free));
        }
        if schedule.overlap == Overlap::None {
            line += "; one frame at a time";
        }
        vec![line, format!("           {}", schedule.need)]
    }

    fn disk_line(&self) -> Option<String> {
        let needed = Bytes(whole(self.disk_bytes()?));
        let free =
            self.free_disk.map_or_else(String::new, |free| format!(", {} are free", Bytes(free)));
        Some(format!("disk       about {needed}{free}"))
    }

    fn time_line(&self) -> Option<String> {
        let probe = self.probe?;
        if probe.is_lower_bound {
            return Some(format!(
                "time       more than {}, a lower bound: frame {} read in {:.3} s and built in {:.3} s just now; \
                 tracing a few of its tiles took longer than {:.0} s and was stopped",
                duration(self.seconds()?),
                probe.frame,
                probe.read,
                probe.build,
                Probe::TIME_BOX.as_secs_f64()
            ));
        }
        let others = match probe.frames {
            1 => String::new(),
            frames => format!(", and of {}", counted(frames as usize - 1, "other")),
        };
        Some(format!(
            "time       about {}, an estimate: frame {} read in {:.3} s and built in {:.3} s just \
             now, {:.2} % of its rays traced{others}",
            duration(self.seconds()?),
            probe.frame,
            probe.read,
            probe.build,
            100.0 * probe.traced_part
        ))
    }
}

/// The names of the channels of the images.
fn channels(manifest: &Manifest) -> Vec<Cow<'static, str>> {
    let output = &manifest.output;
    let is_stored = |channel: &&Channel| {
        !output.path.is_png() || **channel == Channel::Named(NamedChannel::Rgba)
    };
    output.channels.iter().filter(is_stored).map(Channel::name).collect()
}

/// The structure for the largest surveyed frame. Other frames may have another.
fn structure(survey: &Survey, setup: &Setup) -> Structure {
    let has_values = setup.picture.particles.first().color.is_by_particle();
    setup.build_settings(survey.most_particles, has_values).structure
}

fn samples_text(manifest: &Manifest) -> String {
    let samples = manifest.image.samples;
    match manifest.noise_limit() {
        None => counted(samples as usize, "sample"),
        Some(limit) => {
            let least = NoiseLimit::least_samples(samples);
            let most = limit.most_samples(least);
            format!("{least} to {most} samples (noise {})", limit.noise)
        }
    }
}

fn image_json(manifest: &Manifest) -> Value {
    let [width, height] = manifest.picture().size();
    let limit = manifest.noise_limit();
    let samples = manifest.image.samples;
    let least = limit.map_or(samples, |_| NoiseLimit::least_samples(samples));
    let mut image = json!({
        "width": width,
        "height": height,
        "samples": least,
        "max_samples": limit.map(|limit| limit.most_samples(least)),
        // The digits of the shorter type
        "noise": limit.and_then(|limit| limit.noise.to_string().parse::<f64>().ok()),
        "channels": channels(manifest),
        "preview": manifest.output.has_previews(),
    });
    if let Some(part) = manifest.image.part() {
        image["data_window"] = json!(part);
    }
    image
}

fn radius_json(setup: &Setup, survey: &Survey) -> Value {
    match &setup.picture.particles.first().radius {
        RadiusRule::Common(radius) => json!(radius),
        RadiusRule::FileOr(_) if survey.has_radii => json!("file"),
        RadiusRule::FileOr(radius) => json!(radius),
        RadiusRule::Attribute { name, scale } => json!({"attribute": name, "scale": scale}),
        RadiusRule::Table { name, table, scale } => {
            let table = match table {
                RadiusTable::VanDerWaals => "vdw",
                RadiusTable::Covalent => "covalent",
                RadiusTable::Values(_) => "values",
            };
            json!({"attribute": name, "table": table, "scale": scale})
        }
    }
}
