//! Times and numbers of the sampled frames, for the step from one frame to the next.

/// The first and the last sampled frame: index, number, and time if the frame has one.
#[derive(Clone, Copy, Default)]
pub(super) struct Moments {
    first: Option<(usize, i64, Option<f64>)>,
    last: Option<(usize, i64, Option<f64>)>,
}

impl Moments {
    pub(super) fn add(&mut self, index: usize, number: i64, time: Option<f64>) {
        let moment = Some((index, number, time.filter(|time| time.is_finite())));
        self.first = self.first.or(moment);
        self.last = moment;
    }

    /// Number of frames from the first to the last one, at least one.
    #[expect(clippy::cast_precision_loss, reason = "there are few frames")]
    fn count(&self) -> Option<f64> {
        let count = self.last?.0.checked_sub(self.first?.0)?;
        (count > 0).then_some(count as f64)
    }

    /// Mean time between consecutive frames.
    pub(super) fn time_step(&self) -> Option<f64> {
        let step = (self.last?.2? - self.first?.2?) / self.count()?;
        (step > 0.0).then_some(step)
    }

    /// The larger of the times of the first and the last frame, without a sign.
    pub(super) fn largest_time(&self) -> Option<f64> {
        let times = [self.first, self.last].map(|moment| moment.and_then(|(_, _, time)| time));
        times.into_iter().flatten().map(f64::abs).reduce(f64::max)
    }

    /// Mean difference of the numbers of consecutive frames.
    #[expect(clippy::cast_precision_loss, clippy::cast_possible_truncation, reason = "rounded")]
    pub(super) fn number_step(&self) -> Option<i64> {
        let numbers = self.last?.1.checked_sub(self.first?.1)?;
        Some(((numbers as f64 / self.count()?).round() as i64).max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_means_over_the_frames_between() {
        let mut moments = Moments::default();
        assert_eq!((moments.time_step(), moments.number_step()), (None, None));
        moments.add(0, 100, Some(0.5));
        assert_eq!((moments.time_step(), moments.number_step()), (None, None));
        moments.add(2, 110, None);
        moments.add(4, 140, Some(2.5));
        assert_eq!(moments.time_step(), Some(0.5));
        assert_eq!(moments.number_step(), Some(10));
        // Times that do not increase are none
        moments.add(5, 150, Some(0.5));
        assert_eq!(moments.time_step(), None);
    }
}
