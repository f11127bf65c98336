//! Time limits as Slurm writes them.

use std::fmt;
use std::str::FromStr;

/// How long a task may take: `90` (minutes), `90:00`, `02:00:00`, `1-12`, `1-12:30`, `1-12:30:00`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct TimeLimit {
    /// Seconds; more than none.
    pub seconds: u64,
}

const MINUTE: u64 = 60;
const HOUR: u64 = 60 * MINUTE;
const DAY: u64 = 24 * HOUR;
/// Slurm counts minutes in 32 bits; nobody waits for a hundred years.
const MOST: u64 = 36_500 * DAY;

impl FromStr for TimeLimit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "{text:?} is no time limit; write it as 02:00:00 (hours, minutes, seconds), \
                 1-12:00:00 (with days) or 90 (minutes)"
            )
        };
        let number = |part: &str| {
            let digits = !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit());
            let value = part.parse::<u64>().ok().filter(|_| digits);
            value.filter(|n| *n <= MOST).ok_or_else(wrong)
        };
        let (days, clock) = match text.split_once('-') {
            Some((days, clock)) => (Some(number(days)?), clock),
            None => (None, text),
        };
        let parts = clock
            .split(':')
            .map(number)
            .collect::<Result<Vec<_>, _>>()?;
        let seconds = match (days, parts.as_slice()) {
            (None, [minutes]) => minutes * MINUTE,
            (None, [minutes, seconds]) => minutes * MINUTE + seconds,
            (Some(days), [hours]) => days * DAY + hours * HOUR,
            (Some(days), [hours, minutes]) => days * DAY + hours * HOUR + minutes * MINUTE,
            (days, [hours, minutes, seconds]) => {
                days.unwrap_or(0) * DAY + hours * HOUR + minutes * MINUTE + seconds
            }
            _ => return Err(wrong()),
        };
        if seconds == 0 || seconds > MOST {
            return Err(wrong());
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
    fn other_texts_are_refused() {
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
            let error = text.parse::<TimeLimit>().unwrap_err();
            assert!(error.contains("02:00:00"), "{text}: {error}");
        }
    }
}
