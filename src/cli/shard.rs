//! `--shard 2/4`: a part of the frames that can be told without talking to others.

use std::str::FromStr;

/// The `index`-th (from 1) of `count` workers, each of which does every `count`-th frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Shard {
    index: usize,
    count: usize,
}

impl Shard {
    /// Every `count`-th of `frames`: early and late ones for everybody, as frames often grow over a
    /// sequence.
    pub(super) fn of(self, frames: &[i64]) -> Vec<i64> {
        let mine = frames.iter().skip(self.index - 1).step_by(self.count);
        mine.copied().collect()
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
        const WANTED: &str = "wants two whole numbers such as 2/4, the second of four parts";
        let (index, count) = text.split_once('/').ok_or(WANTED)?;
        let parse = |text: &str| text.trim().parse().map_err(|_| WANTED);
        let (index, count) = (parse(index)?, parse(count)?);
        if index == 0 || index > count {
            return Err("the part must be from 1 to the number of parts, as in 1/4 to 4/4");
        }
        Ok(Self { index, count })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn only_parts_that_there_are() {
        assert_eq!("2/3".parse::<Shard>().unwrap().of(&[5, 6, 7, 8, 9]), [6, 9]);
        assert!("4/4".parse::<Shard>().unwrap().of(&[1, 2]).is_empty());
        for text in [
            "", "1", "0/2", "3/2", "1/0", "-1/2", "a/b", "1/2/3", "1.5/2",
        ] {
            assert!(text.parse::<Shard>().is_err(), "{text}");
        }
    }

    proptest! {
        #[test]
        fn together_they_do_every_frame_once(count in 1usize..20, total in 0i64..200) {
            let frames: Vec<i64> = (-5..total).collect();
            let mut all: Vec<i64> = (1..=count)
                .flat_map(|index| Shard { index, count }.of(&frames))
                .collect();
            all.sort_unstable();
            prop_assert_eq!(all, frames);
        }
    }
}
