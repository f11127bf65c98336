//! `--shard 2/4`: a part of the frames, determined without communication between workers.

use std::str::FromStr;

/// Shard `index` (from 1) of `count`: every `count`-th frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Shard {
    index: usize,
    count: usize,
}

impl Shard {
    /// The frames of this shard. All shards get early and late frames, because frames often grow over a sequence.
    pub(super) fn select(self, frames: &[i64]) -> Vec<i64> {
        let selected = frames.iter().skip(self.index - 1).step_by(self.count);
        selected.copied().collect()
    }
}

impl std::fmt::Display for Shard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

impl FromStr for Shard {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        const EXPECTED: &str = "expected two whole numbers such as 2/4, the second of four parts";
        let (index, count) = text.split_once('/').ok_or(EXPECTED)?;
        let parse = |text: &str| text.trim().parse().map_err(|_| EXPECTED);
        let (index, count) = (parse(index)?, parse(count)?);
        if index == 0 || index > count {
            return Err("the part must be from 1 to the number of parts, such as 1/4 to 4/4");
        }
        Ok(Self { index, count })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn invalid_parts_are_rejected() {
        assert_eq!(
            "2/3".parse::<Shard>().unwrap().select(&[5, 6, 7, 8, 9]),
            [6, 9]
        );
        assert!("4/4".parse::<Shard>().unwrap().select(&[1, 2]).is_empty());
        for text in [
            "", "1", "0/2", "3/2", "1/0", "-1/2", "a/b", "1/2/3", "1.5/2",
        ] {
            assert!(text.parse::<Shard>().is_err(), "{text}");
        }
    }

    proptest! {
        #[test]
        fn all_shards_together_have_every_frame_once(count in 1usize..20, total in 0i64..200) {
            let frames: Vec<i64> = (-5..total).collect();
            let mut all: Vec<i64> = (1..=count)
                .flat_map(|index| Shard { index, count }.select(&frames))
                .collect();
            all.sort_unstable();
            prop_assert_eq!(all, frames);
        }
    }
}
