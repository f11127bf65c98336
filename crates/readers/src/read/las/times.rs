//! Times of points in LAZ files, as LASzip compresses them: versions 1 and 2 for formats up to 5, layers for others.
//!
//! A time is the one before it and a difference, which is a small multiple of the difference before. Version 2 has four
//! sequences of times, between which the file switches. Layers are like version 2, but have no symbols for times that are
//! the same as before. The crate `laz` follows switches by recursion, as deep as a file
//! wants; here their number is limited.

use std::io::{Error, ErrorKind, Read, Result};

use laz::decoders::ArithmeticDecoder;
use laz::decompressors::{IntegerDecompressor, IntegerDecompressorBuilder};
use laz::models::{ArithmeticModel, ArithmeticModelBuilder};
use laz::record::FieldDecompressor;

/// Bytes of a time.
pub(super) const LEN: usize = 8;
/// A difference is replaced after so many multiples in a row that are far from 1.
const MANY: u8 = 3;
/// Sequences of version 2. More switches than these in a row lead nowhere new.
const SEQUENCES: usize = 4;

/// Symbols of version 2 where the last difference was zero, and where it was not.
const NONE_SYMBOLS: u32 = 6;
const STEP_SYMBOLS: u32 = 516;
/// The symbols of version 2 for the same time as before, which layers do not have.
const NONE_SAME: u32 = 0;
const STEP_SAME: u32 = 511;

/// A sequence of times.
#[derive(Debug, Clone, Copy, Default)]
struct Sequence {
    /// The bits of the last time, as an integer.
    last: i64,
    /// The last difference.
    step: i32,
    /// Number of multiples in a row that are far from 1.
    extremes: u8,
}

impl Sequence {
    fn add(&mut self, difference: i32) {
        self.last = self.last.wrapping_add(difference.into());
    }

    /// Adds a difference that is an extreme multiple of the last one.
    fn add_extreme(&mut self, difference: i32) {
        self.add(difference);
        self.extremes += 1;
        if self.extremes > MANY {
            (self.step, self.extremes) = (difference, 0);
        }
    }

    fn multiple(&self, factor: i32) -> i32 {
        factor.wrapping_mul(self.step)
    }

    fn store(&self, to: &mut [u8]) {
        to.copy_from_slice(&self.last.to_le_bytes());
    }

    /// Reads the first time.
    fn read(&mut self, source: &mut impl Read, to: &mut [u8]) -> Result<()> {
        let mut bytes = [0; LEN];
        source.read_exact(&mut bytes)?;
        self.last = i64::from_le_bytes(bytes);
        self.store(to);
        Ok(())
    }
}

pub(super) fn model(symbols: u32) -> ArithmeticModel {
    ArithmeticModelBuilder::new(symbols).build()
}

pub(super) fn differences(kinds: u32) -> IntegerDecompressor {
    IntegerDecompressorBuilder::new().bits(32).contexts(kinds).build_initialized()
}

/// Times of version 1.
pub(super) struct Times1 {
    sequence: Sequence,
    after_none: ArithmeticModel,
    after_step: ArithmeticModel,
    differences: IntegerDecompressor,
}

impl Default for Times1 {
    fn default() -> Self {
        Self {
            sequence: Sequence::default(),
            after_none: model(3),
            after_step: model(512),
            differences: differences(6),
        }
    }
}

impl<R: Read> FieldDecompressor<R> for Times1 {
    fn size_of_field(&self) -> usize {
        LEN
    }

    fn decompress_first(&mut self, source: &mut R, to: &mut [u8]) -> Result<()> {
        self.sequence.read(source, to)
    }

    fn decompress_with(&mut self, decoder: &mut ArithmeticDecoder<R>, to: &mut [u8]) -> Result<()> {
        let Self { sequence, after_none, after_step, differences } = self;
        if sequence.step == 0 {
            match decoder.decode_symbol(after_none)? {
                1 => {
                    sequence.step = differences.decompress(decoder, 0, 0)?;
                    sequence.add(sequence.step);
                }
                2 => sequence.last = decoder.read_int_64()?.cast_signed(),
                _ => {}
            }
        } else {
            match decoder.decode_symbol(after_step)? {
                0 => {
                    let near = sequence.step / 4;
                    sequence.add_extreme(differences.decompress(decoder, near, 2)?);
                }
                1 => {
                    sequence.step = differences.decompress(decoder, sequence.step, 1)?;
                    sequence.extremes = 0;
                    sequence.add(sequence.step);
                }
                factor @ 2..510 => {
                    let kind = if factor < 10 { 3 } else { 4 + u32::from(factor >= 50) };
                    let near = sequence.multiple(factor.cast_signed());
                    let difference = differences.decompress(decoder, near, kind)?;
                    if factor == 509 {
                        sequence.add_extreme(difference);
                    } else {
                        sequence.add(difference);
                    }
                }
                510 => sequence.last = decoder.read_int_64()?.cast_signed(),
                _ => {}
            }
        }
        sequence.store(to);
        Ok(())
    }
}

/// Times of version 2, and of layers.
pub(super) struct Times2 {
    is_layered: bool,
    sequences: [Sequence; SEQUENCES],
    /// The sequence of the last time.
    current: usize,
    /// The one that was begun last.
    newest: usize,
    after_none: ArithmeticModel,
    after_step: ArithmeticModel,
    differences: IntegerDecompressor,
}

impl Default for Times2 {
    fn default() -> Self {
        Self {
            is_layered: false,
            sequences: [Sequence::default(); SEQUENCES],
            current: 0,
            newest: 0,
            after_none: model(NONE_SYMBOLS),
            after_step: model(STEP_SYMBOLS),
            differences: differences(9),
        }
    }
}

/// What a symbol of version 2 says.
enum Next {
    /// A time of the sequence.
    Time,
    /// A time that begins a sequence.
    New,
    /// Another symbol follows, for a sequence so many further.
    Switch(usize),
}

impl Times2 {
    /// Times of a layer, whose first one has these bits.
    pub(super) fn layered(first: i64) -> Self {
        let mut times = Self {
            is_layered: true,
            after_none: model(NONE_SYMBOLS - 1),
            after_step: model(STEP_SYMBOLS - 1),
            ..Self::default()
        };
        times.sequences[0].last = first;
        times
    }

    /// Decodes the bits of the next time.
    pub(super) fn next_time<R: Read>(&mut self, decoder: &mut ArithmeticDecoder<R>) -> Result<i64> {
        for _ in 0..=SEQUENCES {
            match self.step(decoder)? {
                Next::Time => {}
                Next::Switch(further) => {
                    self.current = (self.current + further) % SEQUENCES;
                    continue;
                }
                Next::New => {
                    let before = (self.sequences[self.current].last >> 32) as i32;
                    let upper = self.differences.decompress(decoder, before, 8)?;
                    let last = i64::from(upper) << 32 | i64::from(decoder.read_int()?);
                    self.newest = (self.newest + 1) % SEQUENCES;
                    self.current = self.newest;
                    self.sequences[self.current] = Sequence { last, step: 0, extremes: 0 };
                }
            }
            return Ok(self.sequences[self.current].last);
        }
        Err(Error::new(ErrorKind::InvalidData, "times switch between sequences without end"))
    }

    /// Decodes a symbol for the current sequence, and its time unless it begins a sequence.
    fn step<R: Read>(&mut self, decoder: &mut ArithmeticDecoder<R>) -> Result<Next> {
        let Self { sequences, current, after_none, after_step, differences, .. } = self;
        let as_version_2 =
            |symbol: u32, same: u32| symbol + u32::from(self.is_layered && symbol >= same);
        let sequence = &mut sequences[*current];
        if sequence.step == 0 {
            return Ok(match as_version_2(decoder.decode_symbol(after_none)?, NONE_SAME) {
                NONE_SAME => Next::Time,
                1 => {
                    sequence.step = differences.decompress(decoder, 0, 0)?;
                    sequence.extremes = 0;
                    sequence.add(sequence.step);
                    Next::Time
                }
                2 => Next::New,
                symbol => Next::Switch(symbol as usize - 2),
            });
        }
        let symbol = as_version_2(decoder.decode_symbol(after_step)?, STEP_SAME);
        let mut near = |factor: i32, kind: u32| {
            differences.decompress(decoder, sequence.multiple(factor), kind)
        };
        match symbol {
            0 => {
                let difference = near(0, 7)?;
                sequence.add_extreme(difference);
            }
            1 => {
                let difference = near(1, 1)?;
                sequence.extremes = 0;
                sequence.add(difference);
            }
            2..500 => {
                let difference = near(symbol.cast_signed(), 2 + u32::from(symbol >= 10))?;
                sequence.add(difference);
            }
            500 => {
                let difference = near(500, 4)?;
                sequence.add_extreme(difference);
            }
            // Negative multiples of the step: -1 to -9, and -10 for all below
            501..510 => {
                let difference = near(500 - symbol.cast_signed(), 5)?;
                sequence.add(difference);
            }
            510 => {
                let difference = near(-10, 6)?;
                sequence.add_extreme(difference);
            }
            STEP_SAME => {}
            512 => return Ok(Next::New),
            _ => return Ok(Next::Switch(symbol as usize - 512)),
        }
        Ok(Next::Time)
    }
}

impl<R: Read> FieldDecompressor<R> for Times2 {
    fn size_of_field(&self) -> usize {
        LEN
    }

    fn decompress_first(&mut self, source: &mut R, to: &mut [u8]) -> Result<()> {
        self.sequences[0].read(source, to)
    }

    fn decompress_with(&mut self, decoder: &mut ArithmeticDecoder<R>, to: &mut [u8]) -> Result<()> {
        to.copy_from_slice(&self.next_time(decoder)?.to_le_bytes());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use laz::las::{v1, v2};
    use laz::record::{
        FieldCompressor, RecordCompressor, RecordDecompressor, SequentialPointRecordCompressor,
        SequentialPointRecordDecompressor,
    };
    use proptest::prelude::*;

    use super::*;

    /// Compresses times with the crate and decodes them.
    fn check<C, D>(times: &[f64], compressor: C, decompressor: D)
    where
        C: FieldCompressor<Cursor<Vec<u8>>> + Send + Sync + 'static,
        D: FieldDecompressor<Cursor<Vec<u8>>> + Send + Sync + 'static,
    {
        let bytes: Vec<u8> = times.iter().flat_map(|time| time.to_le_bytes()).collect();
        let mut packer = SequentialPointRecordCompressor::new(Cursor::new(Vec::new()));
        packer.add_field_compressor(compressor);
        for time in bytes.chunks(LEN) {
            packer.compress_next(time).expect("a time");
        }
        packer.done().expect("the end");
        let packed = packer.into_inner().into_inner();
        let mut decoder = SequentialPointRecordDecompressor::new(Cursor::new(packed));
        decoder.add_field_decompressor(decompressor);
        let mut found = vec![0; bytes.len()];
        decoder.decompress_many(&mut found).expect("times");
        assert_eq!(found, bytes);
    }

    proptest! {
        /// Steps that repeat, grow, shrink, jump and go back, in up to five sequences.
        #[test]
        fn times_are_those_that_were_compressed(
            steps in prop::collection::vec(
                (prop::sample::select(&[0.0, 1.0, 1.0, 1.0, 2.0, -1.0, 12.0, -30.0, 700.0, 1e6, -1e9][..]), 0..5_usize),
                1..400,
            ),
        ) {
            let mut sequences = [1e5, 2e5, 3e5, 4e5, 5e5];
            let times: Vec<f64> = steps.iter().map(|(step, sequence)| {
                sequences[*sequence] += 1e-7 * step;
                sequences[*sequence]
            }).collect();
            check(&times, v1::LasGpsTimeCompressor::default(), Times1::default());
            check(&times, v2::GpsTimeCompressor::default(), Times2::default());
        }
    }
}
