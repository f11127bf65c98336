use std::io::Cursor;

use exr::block::chunk::CompressedBlock;

use super::*;
use crate::output::{Compression, ExrOptions, PreviewOptions, encode_exr, encode_preview};
use crate::render::{Film, FilmPlane};

/// An irregular film with few different values, so that every block is smaller when compressed and is stored
/// compressed.
fn film(width: u32, height: u32, channels: Channels) -> Film {
    let mut film = Film::new(width, height, channels);
    for (at, color) in film.color.iter_mut().enumerate() {
        let shade = ((at.wrapping_mul(0x9e37_79b9) >> 13) & 3) as f32 / 4.0;
        *color = [shade, 0.5, 1.0 - shade, 1.0];
    }
    film
}

fn exr(film: &Film, compression: Compression) -> Vec<u8> {
    let options = ExrOptions { compression, ..ExrOptions::default() };
    encode_exr(film, &options).unwrap().bytes
}

const fn shape(channels: Channels) -> ImageShape {
    ImageShape {
        width: 40,
        height: 37,
        window: DataWindow::whole(40, 37),
        channels,
        attributes: Vec::new(),
        light_groups: Vec::new(),
        has_data_part: false,
        is_on_page: false,
    }
}

fn verify(bytes: &[u8], expected: &ImageShape) -> Result<(), String> {
    verify_exr(Cursor::new(bytes), expected).map_err(|e| e.to_string())
}

/// All combinations of channels.
fn channel_sets() -> impl Iterator<Item = Channels> {
    (0..64_u32).map(|bits| {
        let is_given = |plane: &FilmPlane| bits >> *plane as u32 & 1 == 1;
        Channels::COLOR.with(&FilmPlane::all().filter(is_given).collect::<Vec<_>>())
    })
}

#[test]
fn images_with_overlays_beside_them_are_smaller_than_their_page() {
    let (bytes, expected) = in_parts(Channels::COLOR);
    let page = |width, height| ImageShape { width, height, is_on_page: true, ..expected.clone() };
    let (width, height) = (expected.width, expected.height);
    for larger in [page(width, height), page(width + 5, height), page(width, height + 9)] {
        verify(&bytes, &larger).expect("a picture on a page");
    }
    let error = verify(&bytes, &page(width - 1, height + 9)).unwrap_err();
    assert!(error.contains("expected"), "{error}");
    let whole = ImageShape { is_on_page: false, ..page(width + 5, height) };
    assert!(verify(&bytes, &whole).is_err());
}

#[test]
fn another_part_of_the_image_is_a_fault() {
    let film = film(40, 37, Channels::COLOR);
    let window = DataWindow { left: 3, top: -8, image: [64, 48] };
    let options = ExrOptions { window: Some(window), ..ExrOptions::default() };
    let bytes = encode_exr(&film, &options).unwrap().bytes;
    let expected = |window| ImageShape { window, ..shape(Channels::COLOR) };
    assert_eq!(verify(&bytes, &expected(window)), Ok(()));
    let moved = DataWindow { left: 4, ..window };
    let larger = DataWindow { image: [64, 49], ..window };
    for other in [moved, larger] {
        let fault = verify(&bytes, &expected(other)).unwrap_err();
        let found = "has the data window at (3, -8) in an image of 64x48 at (0, 0), expected";
        assert!(fault.starts_with(found), "{fault}");
    }
}

#[test]
fn written_files_verify() {
    for channels in channel_sets() {
        let bytes = exr(&film(40, 37, channels), Compression::Zip);
        assert_eq!(verify(&bytes, &shape(channels)), Ok(()), "{channels:?}");
    }
    for compression in [Compression::None, Compression::Rle, Compression::Zips, Compression::Piz] {
        let bytes = exr(&film(40, 37, Channels::ALL), compression);
        let verdict = verify(&bytes, &shape(Channels::ALL));
        assert_eq!(verdict, Ok(()), "{compression:?}");
    }
}

/// Colours and data in parts of their own.
fn in_parts(channels: Channels) -> (Vec<u8>, ImageShape) {
    let options = ExrOptions {
        compression: Compression::Piz,
        data_compression: Some(Compression::Zip),
        ..ExrOptions::default()
    };
    let bytes = encode_exr(&film(40, 37, channels), &options).unwrap().bytes;
    let expected = ImageShape { has_data_part: true, ..shape(channels) };
    (bytes, expected)
}

#[test]
fn parts_are_verified() {
    for channels in channel_sets() {
        let (bytes, expected) = in_parts(channels);
        assert_eq!(verify(&bytes, &expected), Ok(()), "{channels:?}");
    }
    let (bytes, expected) = in_parts(Channels::ALL);
    let fault = verify(&bytes, &shape(Channels::ALL)).unwrap_err();
    assert_eq!(fault, "the number of its parts is 2, not 1");
    let single = exr(&film(40, 37, Channels::ALL), Compression::Zip);
    let fault = verify(&single, &expected).unwrap_err();
    assert_eq!(fault, "the number of its parts is 1, not 2");
    for length in (0..bytes.len()).step_by(7) {
        assert!(verify(&bytes[..length], &expected).is_err());
    }
    // Damage at the end is in the part of data, whose blocks have checksums; a byte may have unused bits
    let is_found = |at: &usize| {
        let mut damaged = bytes.clone();
        damaged[*at] ^= 4;
        verify(&damaged, &expected).is_err()
    };
    let found = (bytes.len() - 40..bytes.len()).filter(is_found).count();
    assert!(found >= 36, "{found}");
}

#[test]
fn wrong_size_or_channels_are_faults() {
    let bytes = exr(&film(40, 37, Channels::COLOR), Compression::Zip);
    let mut expected = shape(Channels::COLOR);
    expected.height = 38;
    assert_eq!(verify(&bytes, &expected).unwrap_err(), "is 40x37, expected 40x38");
    let expected = shape(Channels::COLOR.with(&[FilmPlane::Id]));
    assert_eq!(
        verify(&bytes, &expected).unwrap_err(),
        "has the channels A (half), B (half), G (half), R (half), \
         expected R (half), G (half), B (half), A (half), id.I (uint)"
    );
    let more = exr(&film(40, 37, Channels::ALL), Compression::Zip);
    assert!(verify(&more, &shape(Channels::COLOR)).is_err());
}

/// All samples of a file, block by block.
fn samples(bytes: &[u8]) -> Vec<u8> {
    let reader = exr::block::read(Cursor::new(bytes), true).unwrap();
    let meta = reader.meta_data().clone();
    let chunks = reader.filter_chunks(true, |_, _, _| true).unwrap();
    chunks
        .flat_map(|chunk| {
            UncompressedBlock::decompress_chunk(chunk.unwrap(), &meta, true).unwrap().data
        })
        .collect()
}

/// Start of the table of block offsets. The blocks follow it, up to the end of the file.
fn end_of_header(bytes: &[u8]) -> usize {
    let reader = exr::block::read(Cursor::new(bytes), true).unwrap();
    let chunks = reader.all_chunks(true).unwrap().map(Result::unwrap);
    let lengths = chunks.map(|chunk| match chunk.compressed_block {
        // Plus the entry in the table (8 bytes), the row (4) and the length (4)
        CompressedBlock::ScanLine(block) => block.compressed_pixels_le.len() + 8 + 4 + 4,
        other => panic!("{other:?}"),
    });
    bytes.len() - lengths.sum::<usize>()
}

// Flips each bit of a file, and decodes the file each time.
#[test]
fn flipped_bits_that_change_a_pixel_are_detected() {
    let bytes = exr(&film(40, 37, Channels::ALL), Compression::Zip);
    let good = samples(&bytes);
    let start = end_of_header(&bytes);
    let mut missed = 0;
    for at in start..bytes.len() {
        for bit in 0..8 {
            let mut damaged = bytes.clone();
            damaged[at] ^= 1 << bit;
            // The last byte of a block has unused bits, so some flips change no sample
            let is_sound = verify(&damaged, &shape(Channels::ALL)).is_ok();
            missed += usize::from(is_sound && samples(&damaged) != good);
        }
    }
    // Adler-32 is weak for data with few different values: some permutations of bytes have the same checksum
    let all = 8 * (bytes.len() - start);
    assert!(missed * 100 < all, "{missed} of {all}");
}

// The file is cut at each of its bytes, since any may be the end of a part.
#[test]
fn truncated_files_are_detected_and_huge_sizes_allocate_nothing() {
    let bytes = exr(&film(40, 37, Channels::ALL), Compression::Piz);
    for length in 0..bytes.len() {
        assert!(verify(&bytes[..length], &shape(Channels::ALL)).is_err());
    }
    // An absurd size in the header is rejected before memory is allocated
    let mut huge = exr(&film(40, 37, Channels::COLOR), Compression::Zip);
    let window = b"dataWindow\0box2i\0";
    let at = huge.windows(window.len()).position(|w| w == window).unwrap();
    let corner = at + window.len() + 4 + 8;
    huge[corner..corner + 8].copy_from_slice(&[0xff, 0xff, 0xff, 0x0f, 0xff, 0xff, 0xff, 0x0f]);
    assert!(verify(&huge, &shape(Channels::COLOR)).is_err());
}

#[test]
fn previews_are_decoded_to_their_last_byte() {
    let png =
        encode_preview(&film(40, 37, Channels::COLOR), &PreviewOptions::default(), &[]).unwrap();
    let verify = |bytes: &[u8], expected: &ImageShape| {
        verify_preview(Cursor::new(bytes), expected).map_err(|e| e.to_string())
    };
    let expected = shape(Channels::COLOR);
    assert_eq!(verify(&png, &expected), Ok(()));
    for at in 0..png.len() {
        let mut damaged = png.clone();
        damaged[at] ^= 4;
        assert!(verify(&damaged, &expected).is_err(), "byte {at} flipped");
        assert!(verify(&png[..at], &expected).is_err(), "cut at byte {at}");
    }
    let mut other = expected;
    other.width = 41;
    assert_eq!(verify(&png, &other).unwrap_err(), "is 40x37, expected 41x37");
}
