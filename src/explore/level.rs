//! How fine the pictures of a wish are, one after another: first one that is there at once, then finer ones, and at last
//! the one of the job.

/// Seconds that a picture may take while the mouse moves: about 20 a second.
const QUICK: f64 = 0.045;

/// Seconds that a picture in its own size may take to be the first one.
const SHORT: f64 = 0.15;

/// Seconds that all samples may take to leave out the steps before.
const WHOLE: f64 = 0.4;

/// Samples of the first pictures: noise that is removed is measured by the difference of two.
const FIRST_SAMPLES: u32 = 2;

/// Factor from the samples of one step to those of the next.
const FINER: u32 = 4;

/// The part of [`QUICK`] that is for samples in any case.
const LEAST_PART: f64 = 0.4;

/// The smallest side of a picture, pixels: a smaller one shows nothing.
const LEAST_SIDE: u32 = 36;

/// A picture of a wish.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Level {
    /// Width and height in pixels.
    pub(super) size: [u32; 2],
    /// Samples per pixel.
    pub(super) samples: u32,
    /// Whether it is the picture of the job.
    pub(super) is_last: bool,
}

/// Factor between the samples of pictures that count as small and those that count as large.
const LARGE: f64 = 4.0;

/// A small picture that takes so many times as long as it should shows that all that is known is out of date.
const OUTDATED: f64 = 3.0;

/// The time of pictures of a page: a fixed part, and one for each sample of a pixel. They follow from a small picture and
/// a large one; pictures of one size alone cannot tell the parts apart.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Speed {
    /// None until a picture was small beside the large one.
    small: Option<Timing>,
    /// None until a picture was rendered.
    large: Option<Timing>,
}

/// The large picture before one was rendered: that of one slow core.
const GUESS: Timing = Timing { work: 1e5, seconds: 0.1 };

/// The samples of a picture, all pixels together, and its seconds.
#[derive(Debug, Clone, Copy)]
struct Timing {
    work: f64,
    seconds: f64,
}

impl Timing {
    /// The mean of both if they are about as large, or else the newer one.
    fn then(self, newer: Self) -> Self {
        let ratio = newer.work / self.work;
        if !(0.5..2.0).contains(&ratio) {
            return newer;
        }
        let mean = |a: f64, b: f64| 0.5 * (a + b);
        Self { work: mean(self.work, newer.work), seconds: mean(self.seconds, newer.seconds) }
    }
}

impl Speed {
    /// Learns from a picture that took `seconds`.
    pub(super) fn learn(&mut self, level: &Level, seconds: f64) {
        let newer = Timing { work: level.work(), seconds };
        let Some(large) = self.large else {
            self.large = Some(newer);
            return;
        };
        let ratio = newer.work / large.work;
        if ratio > LARGE {
            *self = Self { small: Some(large), large: Some(newer) };
        } else if ratio * LARGE >= 1.0 {
            self.large = Some(large.then(newer));
        } else {
            let small = self.small.map_or(newer, |small| small.then(newer));
            let is_outdated =
                self.small.is_some() && small.seconds > OUTDATED * self.seconds(level);
            *self = if is_outdated {
                Self { small: None, large: Some(small) }
            } else {
                Self { small: Some(small), large: Some(large) }
            };
        }
    }

    /// The fixed part, and that of a sample, seconds.
    fn parts(&self) -> [f64; 2] {
        let large = self.large.unwrap_or(GUESS);
        let Timing { work, seconds } = large;
        let through_origin = seconds / work;
        let Some(small) = self.small else { return [0.0, through_origin] };
        // Neither is negative, whatever the noise
        let slope = ((seconds - small.seconds) / (work - small.work))
            .clamp(0.05 * through_origin, through_origin);
        let fixed = [small, large].map(|own| own.seconds - slope * own.work);
        [fixed[0].min(fixed[1]).max(0.0), slope]
    }

    fn seconds(&self, level: &Level) -> f64 {
        let [fixed, each] = self.parts();
        fixed + each * level.work()
    }
}

impl Level {
    fn work(&self) -> f64 {
        let [width, height] = self.size.map(f64::from);
        width * height * f64::from(self.samples)
    }
}

/// The picture after `done`, or the first one; None if there is no finer one, or if another wish follows. The job has
/// pictures of this `size` with so many `samples`.
pub(super) fn next(
    done: Option<Level>,
    (size, samples): ([u32; 2], u32),
    speed: Speed,
    is_moving: bool,
) -> Option<Level> {
    let last = Level { size, samples, is_last: true };
    // A step to nearly all samples would take nearly the time of all
    let of = |samples: u32| {
        let is_near = samples.saturating_mul(2) >= last.samples;
        if is_near { last } else { Level { size, samples, is_last: false } }
    };
    let first = of(FIRST_SAMPLES);
    match done {
        None if is_moving => Some(quick(first, speed)),
        None if speed.seconds(&last) <= WHOLE => Some(last),
        None if speed.seconds(&first) <= SHORT => Some(first),
        None => Some(quick(first, speed)),
        Some(_) if is_moving => None,
        Some(done) if done.is_last => None,
        Some(_) if speed.seconds(&last) <= WHOLE => Some(last),
        Some(done) if done.size != size => Some(first),
        Some(done) => Some(of(done.samples.saturating_mul(FINER))),
    }
}

/// A smaller picture that takes as long as [`QUICK`], with the shape of `whole`.
fn quick(whole: Level, speed: Speed) -> Level {
    let size = whole.size;
    // A smaller picture does not save the fixed part
    let [fixed, each] = speed.parts();
    let budget = (QUICK - fixed).max(LEAST_PART * QUICK);
    let scale = (budget / (each * whole.work())).sqrt().min(1.0);
    let [width, height] = size.map(f64::from);
    let least = f64::from(LEAST_SIDE) / width.min(height);
    let scale = scale.max(least).min(1.0);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "at least 1 and at most the size"
    )]
    let size = [width, height].map(|side| (side * scale).round().max(1.0) as u32);
    Level { size, is_last: false, ..whole }
}

#[cfg(test)]
mod tests {
    use super::*;

    const JOB: ([u32; 2], u32) = ([1280, 720], 16);

    fn all(speed: Speed, is_moving: bool) -> Vec<Level> {
        let mut levels = Vec::new();
        while let Some(level) = next(levels.last().copied(), JOB, speed, is_moving) {
            levels.push(level);
            assert!(levels.len() < 20, "no end");
        }
        levels
    }

    #[test]
    fn pictures_become_finer_until_that_of_the_job() {
        // A machine that traces a million samples a second
        let slow = Speed::default();
        let levels = all(slow, false);
        let [width, height] = levels[0].size;
        assert!((20_000..25_000).contains(&(width * height)), "{levels:?}");
        assert!((f64::from(width) / f64::from(height) - 16.0 / 9.0).abs() < 0.02);
        let samples: Vec<u32> = levels.iter().map(|level| level.samples).collect();
        assert_eq!(samples, [2, 2, 16]);
        assert!(levels[2].is_last && levels[2].size == JOB.0 && !levels[1].is_last);
        // One that renders the whole picture at once
        let mut fast = Speed::default();
        for size in [100, 1000] {
            let level = Level { size: [size; 2], samples: 2, is_last: false };
            fast.learn(&level, 1e-9 * level.work());
        }
        assert_eq!(all(fast, false).len(), 1);
        // While the mouse moves there is one picture
        assert_eq!(all(slow, true).len(), 1);
        assert_eq!(all(fast, true)[0], Level { size: JOB.0, samples: 2, is_last: false });
    }

    #[test]
    fn the_size_follows_the_time() {
        let mut speed = Speed::default();
        let whole = |size| Level { size, samples: 2, is_last: false };
        let level = quick(whole(JOB.0), speed);
        // Ten times as slow as was thought
        for _ in 0..10 {
            let level = quick(whole(JOB.0), speed);
            speed.learn(&level, 1e-5 * level.work());
        }
        let smaller = quick(whole(JOB.0), speed);
        assert!(smaller.size[0] < level.size[0] / 2, "{smaller:?}");
        assert!(smaller.size[1] >= LEAST_SIDE);
        // A fast device with a fixed part: larger pictures cost nothing more
        let time = |level: &Level| 0.05 + 1e-8 * level.work();
        speed.learn(&whole(JOB.0), time(&whole(JOB.0)));
        for _ in 0..10 {
            let level = quick(whole(JOB.0), speed);
            speed.learn(&level, time(&level));
        }
        let [fixed, each] = speed.parts();
        assert!((0.03..0.07).contains(&fixed) && each < 3e-8, "{fixed} {each}");
        assert!(quick(whole(JOB.0), speed).size[0] > 800);
        // Particles that take ten times as long; no large picture of them has been rendered yet
        let time = |level: &Level| 1e-6 * level.work();
        for _ in 0..20 {
            let level = quick(whole(JOB.0), speed);
            speed.learn(&level, time(&level));
        }
        let last = quick(whole(JOB.0), speed);
        assert!((0.02..0.09).contains(&time(&last)), "{last:?}");
        // Pictures smaller than the least are rendered as they are
        assert_eq!(quick(whole([20, 10]), speed).size, [20, 10]);
    }
}
