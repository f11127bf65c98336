//! `report.json`. Its keys must not change, because scripts depend on them.

use serde_json::{Map, Value, json};

use super::{JobFrame, JobReport, Status};

impl JobReport {
    /// The report as JSON.
    pub fn to_json(&self) -> Value {
        let frames: Vec<Value> = self.frames.iter().map(JobFrame::to_json).collect();
        let settings: Map<String, Value> =
            self.settings.iter().map(|(k, v)| (k.clone(), json!(v))).collect();
        let slowest: Vec<Value> = self
            .slowest()
            .into_iter()
            .map(|(frame, report)| {
                json!({"frame": frame.number, "seconds": report.total().as_secs_f64()})
            })
            .collect();
        json!({
            "frames": frames,
            "totals": self.totals_json(),
            "slowest": slowest,
            "settings": settings,
            "machine": {
                "threads": self.machine.threads,
                "simd": self.machine.simd,
                "os": std::env::consts::OS,
                "arch": std::env::consts::ARCH,
                "spherule": env!("CARGO_PKG_VERSION"),
            },
        })
    }

    fn totals_json(&self) -> Value {
        let totals = &self.totals;
        json!({
            "frames": self.frames.len(),
            "done": self.with_status(Status::Done).len(),
            "failed": self.with_status(Status::Failed),
            "pending": self.with_status(Status::Pending).len(),
            "particles": totals.particles,
            "particles_read": totals.particles_read,
            "dropped": totals.dropped,
            "clamped_radii": totals.clamped_radii,
            "clamped_pixels": totals.clamped_pixels,
            "clamped_light": totals.clamped_light,
            "seconds": totals.seconds,
            "rays": totals.rays,
            "rays_per_second": totals.rays_per_second(),
            "rss": totals.rss,
            "device": totals.device,
        })
    }
}

impl JobFrame {
    /// The entry of the ledger, with the values derived from it.
    fn to_json(&self) -> Value {
        let mut json = json!({
            "frame": self.number,
            "image": self.image,
            "status": self.status.name(),
        });
        let Some(into) = json.as_object_mut() else {
            return json;
        };
        if let Some(reason) = &self.reason {
            into.insert("reason".into(), json!(reason));
        }
        if let Value::Object(details) = &self.details {
            into.extend(details.clone());
        }
        if let Some(report) = &self.report {
            into.insert("rays_per_second".into(), json!(report.rays_per_second()));
            if let Some(Value::Object(bytes)) = into.get_mut("bytes") {
                bytes.insert("per_particle".into(), json!(report.bytes_per_particle()));
            }
        }
        json
    }
}
