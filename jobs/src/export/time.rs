//! Time limits in the notation of Slurm.

use std::fmt;
use std::str::FromStr;

/// Longest time of a task: `90` (minutes), `90:00`, `02:00:00`, `1-12`, `1-12:30`, `1-12:30:00`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct TimeLimit {
    /// Seconds, at least one.
    pub seconds: u64,
}

const MINUTE: u64 = 60;
const HOUR: u64 = 60 * MINUTE;
const DAY: u64 = 24 * HOUR;
/// Slurm stores minutes in 32 bits. A hundred years are enough.
const MAX_SECONDS: u64 = 36_500 * DAY;

/// The text is not a time limit.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "invalid time limit {text:?} (examples: 02:00:00 for hours, minutes and seconds, 1-12:00:00 with days, 90 for \
     minutes)"
)]
pub struct TimeLimitError {
    /// The text.
    pub text: String,
}

impl FromStr for TimeLimit {
    type Err = TimeLimitError;

    fn from_str(text: &str) -> Result<Self, TimeLimitError> {
        let invalid = || TimeLimitError { text: text.to_owned() };
        let number = |part: &str| {
            let digits = !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit());
            let value = part.parse::<u64>().ok().filter(|_| digits);
            value.filter(|n| *n <= MAX_SECONDS).ok_or_else(invalid)
        };
        // Days are before a hyphen
        let (days, clock) = match text.split_once('-') {
            Some((days, clock)) => (Some(number(days)?), clock),
            None => (None, text),
        };
        // What the other numbers mean depends on how many there are, and on whether there are days
        let parts = clock.split(':').map(number).collect::<Result<Vec<_>, _>>()?;
        let seconds = match (days, parts.as_slice()) {
            (None, [minutes]) => minutes * MINUTE,
            (None, [minutes, seconds]) => minutes * MINUTE + seconds,
            (Some(days), [hours]) => days * DAY + hours * HOUR,
            (Some(days), [hours, minutes]) => days * DAY + hours * HOUR + minutes * MINUTE,
            (days, [hours, minutes, seconds]) => {
                days.unwrap_or(0) * DAY + hours * HOUR + minutes * MINUTE + seconds
            }
            _ => return Err(invalid()),
        };
        if seconds == 0 || seconds > MAX_SECONDS {
            return Err(invalid());
        }
        Ok(Self { seconds })
    }
}

impl fmt::Display for TimeLimit {
    /// `02:00:00` or `1-12:00:00`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (days, rest) = (self.seconds / DAY, self.seconds % DAY);
        if days > 0 {
            write!(f, "{days}-")?;
        }
        let (hours, minutes) = (rest / HOUR, rest % HOUR / MINUTE);
        write!(f, "{hours:02}:{minutes:02}:{:02}", rest % MINUTE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forms() {
        let shown = |text: &str| text.parse::<TimeLimit>().map(|t| t.to_string());
        for (text, means) in [
            ("90", "01:30:00"),
            ("2:30", "00:02:30"),
            ("02:00:00", "02:00:00"),
            ("1-12", "1-12:00:00"),
            ("1-12:30", "1-12:30:00"),
            ("0-36:00:01", "1-12:00:01"),
        ] {
            assert_eq!(shown(text), Ok(means.to_owned()), "{text}");
        }
    }

    #[test]
    fn other_texts_are_rejected() {
        for text in [
            "",
            "0",
            "00:00:00",
            "2h",
            "1:2:3:4",
            "1-",
            "-5",
            "1--2",
            "+5",
            " 5",
            "1-1:1:1:1",
            "99999999999999999999",
            "18446744073709551615-0",
            "2\n",
        ] {
            let error = text.parse::<TimeLimit>().unwrap_err().to_string();
            assert!(error.contains("02:00:00"), "{text}: {error}");
        }
    }
}
