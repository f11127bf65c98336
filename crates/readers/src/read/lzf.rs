//! LZF, which h5py and the Point Cloud Library compress with: runs of literal bytes, and copies of bytes before.

/// Decompresses `data` to at most `most` bytes.
///
/// # Errors
/// What is wrong with the data: it is damaged, or longer.
pub fn decompress(data: &[u8], most: usize) -> Result<Vec<u8>, &'static str> {
    // A copy of three bytes gives up to 264.
    let mut out = Vec::with_capacity(most.min(data.len().saturating_mul(88)));
    let mut rest = data.iter();
    while let Some(control) = rest.next() {
        let control = usize::from(*control);
        if control < 32 {
            let literals = rest.as_slice().get(..=control).ok_or("it ends within literal bytes")?;
            out.extend_from_slice(literals);
            rest = rest.as_slice()[control + 1..].iter();
        } else {
            let mut next = || rest.next().map(|byte| usize::from(*byte));
            let more = match control >> 5 {
                7 => next(),
                length => Some(length),
            };
            let (length, low) = match (more, next()) {
                (Some(more), Some(low)) => {
                    (2 + if control >> 5 == 7 { 7 + more } else { more }, low)
                }
                _ => return Err("it ends within a copy"),
            };
            let distance = ((control & 31) << 8 | low) + 1;
            let from = out.len().checked_sub(distance);
            let from = from.ok_or("a copy from before the start")?;
            if out.len() + length > most {
                return Err("longer than stated");
            }
            // Copies may overlap what they write.
            for at in from..from + length {
                out.push(out[at]);
            }
        }
        if out.len() > most {
            return Err("longer than stated");
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn literals_and_copies() {
        // Written by h5py: 'abc' * 20 and zeros.
        assert_eq!(decompress(&[2, b'a', b'b', b'c'], 3).unwrap(), b"abc");
        let copied = [2, b'a', b'b', b'c', 0b1110_0000, 48, 2];
        assert_eq!(decompress(&copied, 60).unwrap(), b"abc".repeat(20));
        let short = [0, 7, 0b0100_0000, 0];
        assert_eq!(decompress(&short, 5).unwrap(), [7; 5]);
        assert!(decompress(&[], 5).unwrap().is_empty());
    }

    #[test]
    fn damage_is_detected() {
        for damaged in [
            &[2, b'a'][..],
            &[0, 7, 0b0100_0000],
            &[0, 7, 0b1110_0000, 1],
            &[0, 7, 0b0100_0000, 1],
            &[0, 7, 0b1110_0000, 255, 0],
        ] {
            assert!(decompress(damaged, 100).is_err(), "{damaged:?}");
        }
    }
}
